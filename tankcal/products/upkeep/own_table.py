"""The gauge's own volumes against its levels, and its level of water at the bottom."""

from dataclasses import replace

import numpy as np
import pandas as pd

from tankcal.job.tables import Log
from tankcal.messages import message
from tankcal.products.upkeep.logs import Findings

BIN_M = 0.02  # levels that are compared
DAY_NS = 86400 * 10**9
CHANGED, CHANGED_M3 = 0.002, 0.005  # of the volume, and the least, of a changed table
WATER_M = 0.003  # rise of the level of water that is more than the scatter of a float
MOST_BINS = 0.5  # share of the known levels of a day that must have changed


def compare_own_volumes(file, table, findings, events, log):
    """Warn if the volumes of a gauge change at equal levels, without an event table_changed.

    Parameters
    ----------
    file : logs.LogFile
        Level log; without volumes there is no comparison.
    table : quantity.table.TankTable
        Interpolates between levels of a bin.
    findings : logs.Findings
    events : list of dict
    log : Log
    """
    if file.profile.format == "csv" and not file.has_column("volume"):
        return
    known, changed = pd.Series(dtype=float), []
    # Its rows are counted already.
    for chunk in replace(file, findings=Findings(), log=Log(), span=[0, None, None]).chunks():
        if "volume" not in chunk or "level" not in chunk:
            return
        level, volume = chunk["level"], chunk["volume"]
        is_used = np.isfinite(level) & np.isfinite(volume) & ~table.is_outside(level)
        level, volume, time = level[is_used], volume[is_used], chunk["time"][is_used]
        rows = pd.DataFrame({
            "day": time // DAY_NS, "bin": np.round(level / BIN_M), "volume": volume,
            "difference": volume - table.volume(level),
        })  # fmt: skip
        for day, values in rows.groupby("day"):
            means = values.groupby("bin")[["difference", "volume"]].mean()
            both = means.index.intersection(known.index)
            limit = np.maximum(CHANGED * means.volume[both], CHANGED_M3)
            moved = np.abs(means.difference[both] - known[both]) > limit
            if len(both) and moved.mean() > MOST_BINS:
                changed.append(int(day) * DAY_NS)
            known = means.difference.combine_first(known) if not changed else known
    declared = any(event["kind"] == "table_changed" for event in events)
    if changed and not declared:
        findings.add("levels", "table_changed", changed)
        text = message("upkeep_table_changed", "the gauge states other volumes at equal levels "
                       "from {day} on: its table was changed; expected an event table_changed",
                       day=str(np.datetime64(changed[0], "ns"))[:10])  # fmt: skip
        log.warning(file.path.name, text, column="volume")


def find_water(pieces, table, events, name, log):
    """Warn if the level of water rises between two drainings: liquid that no ticket contains.

    Parameters
    ----------
    pieces : levels.Pieces
    table : quantity.table.TankTable
    events : list of dict
    name : str
        File of the levels.
    log : Log
    """
    known = np.isfinite(pieces.water_m)
    time, water = pieces.time_ns[known], pieces.water_m[known]
    drawn = [event["time"] for event in events if event["kind"] == "water_drawn"]
    for part in np.split(np.arange(len(time)), np.searchsorted(time, drawn)):
        if not len(part):
            continue
        days = (time[part] - time[part[0]]) // DAY_NS
        ends = [float(np.median(water[part[days == day]])) for day in (days[0], days[-1])]
        if ends[1] - ends[0] > WATER_M:
            litres = 1000 * float(np.diff(table.volume(np.array(ends)))[0])
            first, last = np.datetime_as_string(time[part[[0, -1]]].view("datetime64[ns]"), "D")
            log.warning(name, message(
                "upkeep_water", "the water rose by {rise:.0f} mm ({litres:.0f} L by the table) "
                "from {first} to {last}: water came in, and is a gain in the balance; expected a "
                "constant level, or an event water_drawn", rise=1000 * (ends[1] - ends[0]),
                litres=litres, first=str(first), last=str(last)), column="water_mm")  # fmt: skip
