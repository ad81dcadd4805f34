"""The gauge's own volumes against its levels: a table that was changed behind the archive."""

from dataclasses import replace

import numpy as np
import pandas as pd

from tankcal.job.tables import Log
from tankcal.messages import message
from tankcal.products.upkeep.logs import Findings

BIN_M = 0.02  # levels that are compared
DAY_NS = 86400 * 10**9
CHANGED, CHANGED_M3 = 0.002, 0.005  # of the volume, and the least, of a changed table
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
