"""Checks for columns of angles in another unit than declared.

Gon declared as degrees, and vice versa: there are two kinds of evidence. Reciprocal sights: forward
and back azimuths differ by half a circle; forward and back zenith angles have the sum of half a
circle. Known points: coordinates determine the angle between them.

Packed degrees, minutes and seconds (12.3045 for 12° 30' 45") declared as decimal degrees: in
decimal degrees, the second pair of decimals reaches 60 in four of ten readings. Packed minutes and
seconds never reach 60.
"""

import numpy as np

from tankcal.job.checking import has_rows
from tankcal.job.contract.observations import ANGLES
from tankcal.messages import message

HALF_CIRCLE = {"deg": 180.0, "gon": 200.0}
OTHER = {"deg": "gon", "gon": "deg"}
IN_WORDS = {"deg": message("degrees", "degrees"), "gon": message("gon", "gon")}
OF_RECIPROCAL = 2.0  # tolerance of half a circle, degrees or gon; the units differ by 20
OF_KNOWN_DEG = 1.0  # tolerance of angles between known points
MIN_SIGHTS = 3  # smallest number of such angles
SAME_HEIGHT_M = 0.1  # largest difference of the heights of instrument and target
MIN_TURN_DEG = 20.0  # for smaller angles, the units differ by less than 2 degrees
# Packed degrees
OF_PAIR, BY_CHANCE = 0.6, 1e-6  # probability of a pair below 60; smallest probability of a column
EACH = 1e-3  # readings that agree to this interval count once, degrees
DIGITS = 7  # number of decimals, more than any circle shows


def check_gon(files, places):
    """Report each column of angles that fits the other unit only."""
    for name, angle in ANGLES.items():
        table = files.tables[name]
        if not has_rows(table):
            continue
        for unit in HALF_CIRCLE:
            column = f"{angle}_{unit}"
            if table.columns.get(column) is None:
                continue
            values = table.numbers(column)
            level = np.where(_is_level(files, name, table), values, np.nan)
            expected = _reciprocal(name, _sights(files, name, table, level), unit)
            expected = expected or _known(name, _sights(files, name, table, values), unit, places)
            if expected:
                files.log.problem(table.file, expected, None, column)


def _sights(files, name, table, values):
    """Valid rows (at, from or set, to, value) of a table of angles."""
    if "setup" in table.columns:
        setups = files.tables["setups"]
        if not has_rows(setups):
            return []
        stations = dict(zip(setups.of("setup"), setups.of("station"), strict=True))
        at = [stations.get(setup) for setup in table.of("setup")]
        sets = table.of("set") if name == "directions" else [None] * len(at)
        origin = list(zip(table.of("setup"), sets, strict=True))
    elif name == "horizontal_angles":
        at, origin = table.of("at"), table.of("from")
    else:
        at, origin = table.of("from"), [None] * len(values)
    return [
        row
        for row in zip(at, origin, table.of("to"), values.tolist(), strict=True)
        if None not in (row[0], row[2]) and np.isfinite(row[3])
    ]


def _is_level(files, name, table):
    """True where instrument and target have the same height above their marks, shape (n,)."""
    setups = files.tables["setups"]
    if name != "zenith_angles" or not has_rows(setups):
        return np.ones(len(table.rows), dtype=bool)
    heights = dict(zip(setups.of("setup"), setups.of("instrument_height_m"), strict=True))
    instrument = np.array([heights.get(setup) or 0.0 for setup in table.of("setup")])
    target = np.nan_to_num(table.numbers("target_height_m"))
    return np.abs(instrument - target) < SAME_HEIGHT_M


def _reciprocal(name, sights, unit):
    """Message if reciprocal sights give half a circle in the other unit, else ""."""
    if name not in ("azimuths", "zenith_angles"):
        return ""
    value = {(at, to): angle for at, _, to, angle in sights}
    pairs = [(value[ends], value[ends[::-1]]) for ends in value if ends[::-1] in value]
    if name == "azimuths":
        halves = [abs(forward - back) for forward, back in pairs if forward > back]
    else:
        halves = [forward + back for forward, back in pairs]
    if not halves:
        return ""
    half, other = float(np.median(halves)), OTHER[unit]
    if abs(half - HALF_CIRCLE[other]) > OF_RECIPROCAL:
        return ""
    as_other, as_unit = IN_WORDS[other], IN_WORDS[unit]
    return message(
        "half_circle",
        "forward and back sights give half a circle as {half:.2f}, so they are in "
        "{as_other}; expected {as_unit}, or the column in {unit}",
        half=half,
        as_other=as_other,
        as_unit=as_unit,
        unit=other,
    )


def _known(name, sights, unit, places):
    """Message if angles between known points fit in the other unit only, else ""."""
    if name in ("zenith_angles", "vertical_angles"):
        return ""
    turns = _turns(name, sights, places)
    if len(turns) < MIN_SIGHTS:
        return ""
    observed, computed = np.array(turns).T
    misfit = {}
    for candidate in HALF_CIRCLE:
        turn = observed * 180.0 / HALF_CIRCLE[candidate]
        misfit[candidate] = float(np.median(np.abs((turn - computed + 180.0) % 360.0 - 180.0)))
    other = OTHER[unit]
    if misfit[other] > OF_KNOWN_DEG or misfit[unit] < 5 * max(misfit[other], 0.2):
        return ""
    as_other, as_unit = IN_WORDS[other], IN_WORDS[unit]
    here, there = misfit[unit], misfit[other]
    return message(
        "angles_of_known",
        "between points of known coordinates the angles are off by {here:.2g} degrees (median), "
        "but by {there:.2g} if they are in {as_other}; expected {as_unit}, or the column in {unit}",
        here=here,
        there=there,
        as_other=as_other,
        as_unit=as_unit,
        unit=other,
    )


def _turns(name, sights, places):
    """(observed in the unit of the column, computed in degrees) of angles between known points."""
    turns, zero = [], {}
    for at, origin, to, value in sights:
        azimuth = _azimuth_deg(places, at, to)
        if azimuth is None:
            continue
        if name == "azimuths":
            turns.append((value, azimuth))
        elif name == "horizontal_angles":
            start = _azimuth_deg(places, at, origin)
            if start is not None:
                turns.append((value, azimuth - start))
        else:
            first, start = zero.setdefault(origin, (value, azimuth))
            turns.append((value - first, azimuth - start))
    return [turn for turn in turns if abs(turn[0]) > MIN_TURN_DEG]


def _azimuth_deg(places, at, to):
    station, target = places.of.get(at), places.of.get(to)
    if station is None or target is None:
        return None
    dx, dy = (target - station)[:2]
    if not np.isfinite(dx + dy) or (dx == 0 and dy == 0):
        return None
    return float(np.degrees(np.arctan2(dx, dy)))


def chance_of_packed(degrees):
    """Probability that decimal degrees look as packed as these; 1.0 if a pair reaches 60.

    Parameters
    ----------
    degrees : array_like, shape (n,)
        Values as written. Values with at most two decimals, and repetitions to three decimals, do
        not count.

    Returns
    -------
    float

    Examples
    --------
    >>> chance_of_packed([12.3045, 81.0015, 200.594]), chance_of_packed([12.3045, 81.0061])
    (0.216, 1.0)
    """
    values = np.abs(np.asarray(degrees, dtype=float))
    values = values[np.isfinite(values)]
    unit = 10**DIGITS
    decimals = np.rint(values % 1 * unit).astype(int) % unit
    minutes, seconds = decimals // 10 ** (DIGITS - 2), decimals // 10 ** (DIGITS - 4) % 100
    if np.any((minutes >= 60) | (seconds >= 60)):
        return 1.0
    has_seconds = decimals % 10 ** (DIGITS - 2) > 0
    return round(OF_PAIR ** len(np.unique(np.floor(values[has_seconds] / EACH + EACH))), 12)


def refuse_packed(table, column, log):
    """Report a column of degrees with packed minutes and seconds."""
    degrees = table.numbers(column)
    chance = chance_of_packed(degrees)
    if chance < BY_CHANCE:
        first = int(np.argmax(np.isfinite(degrees)))
        expected = message(
            "packed_dms",
            "no minutes or seconds of the {count} angles reach 60 if they are read as degrees,"
            " minutes and seconds (12.3045 for 12 30 45): expected decimal degrees, or such angles"
            " in the column {dms}, as 12 30 45",
            count=int(np.isfinite(degrees).sum()),
            dms=column.removesuffix("deg") + "dms",
        )
        log.problem(table.file, expected, table.rows[first], column)
