"""Checks of units and swapped coordinates, from the files of the survey alone.

Checks for columns of angles in another unit than declared.

Gon declared as degrees, and vice versa: there are two kinds of evidence. Reciprocal sights: forward
and back azimuths differ by half a circle; forward and back zenith angles have the sum of half a
circle. Known points: coordinates determine the angle between them.

Packed degrees, minutes and seconds (12.3045 for 12° 30' 45") declared as decimal degrees: in
decimal degrees, the second pair of decimals reaches 60 in four of ten readings. Packed minutes and
seconds never reach 60.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from tankcal.job.checking import has_rows, tiny_sd
from tankcal.job.contract.observations import ANGLES, READINGS
from tankcal.messages import message

# Known coordinates, and distances between them, before the adjustment.

MANY = 100  # with more points, a single point does not affect the median
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


@dataclass(frozen=True)
class Places:
    """Known positions in the frame of the survey.

    Attributes
    ----------
    of : dict
        {point: coordinates (3,), m, nan where not known}; photos as ("photo", name).
    measured : dict
        {point: list of (other point, distance in m, is it horizontal)}.
    extent_m : float or None
        Largest extent of the known coordinates along an axis; None: fewer than 3 points.
    """

    of: dict
    measured: dict
    extent_m: float | None

    def where_others_lie(self, name):
        """Number of the other points, their centre (2,), and their typical distance from it, m.

        For many points, the point itself is included, because it does not affect the median.
        """
        names, xy = self._in_plan
        if len(xy) > MANY:
            return self._middle
        return _middle_of(xy[[other != name for other in names]])

    @cached_property
    def _middle(self):
        return _middle_of(self._in_plan[1])

    @cached_property
    def _in_plan(self):
        xy = np.array([place[:2] for place in self.of.values()]).reshape(-1, 2)
        is_known = ~np.isnan(xy).any(axis=1)
        return [name for name, keep in zip(self.of, is_known, strict=True) if keep], xy[is_known]


def _middle_of(xy):
    if not len(xy):
        return 0, np.zeros(2), 0.0
    middle = np.median(xy, axis=0)
    return len(xy), middle, float(np.median(np.hypot(*(xy - middle).T)))


def places_of(files):
    """`Places` of a survey."""
    of = {}
    for name, key in (("photos", "photo"), ("check", "point"), ("control", "point")):
        table = files.tables[name]
        if not has_rows(table):
            continue
        xyz = np.column_stack([table.numbers(f"{axis}_m") for axis in "xyz"])
        systems = table.of("system") if "system" in table.columns else [None] * len(xyz)
        for point, system, place in zip(table.of(key), systems, xyz, strict=True):
            if point is not None and system is None:
                of[("photo", point) if name == "photos" else point] = place
    extent = None
    known = np.array(list(of.values())).reshape(-1, 3)
    if np.sum(~np.isnan(known).any(axis=1)) > 2:
        extent = float(np.max(np.nanmax(known, axis=0) - np.nanmin(known, axis=0)))
    return Places(of, _distances_by_kind(files.tables["distances"]), extent)


def _distances_by_kind(table):
    measured = {}
    if not has_rows(table):
        return measured
    rows = zip(
        table.of("from"), table.of("to"), table.of("distance_m"), table.of("kind"), strict=True
    )
    for start, end, distance, kind in rows:
        if None not in (start, end, distance) and start != end:
            for point, other in ((start, end), (end, start)):
                measured.setdefault(point, []).append((other, distance, kind == "horizontal"))
    return measured


TINY = {"mm": 0.005, "um": 0.05, "arcsec": 0.01}  # if all sds are smaller, they are suspicious
SURE = 0.1  # share of TINY below which sds of readings are refused
OF_SDS = {
    **dict.fromkeys(("s_mm", "sx_mm", "sy_mm", "sz_mm"), "mm"),
    **dict.fromkeys(("sx_um", "sy_um", "s_um"), "um"),
    "s_arcsec": "arcsec",
}
MUCH_LARGER = 200  # implausible ratio of distances to the extent of the survey
THOUSANDFOLD = (500, 2000)  # ratio to known distances that indicates millimetres
MIN_OF_OTHERS = 4  # smallest number of points that determine the centre of the survey
FAR, NEAR = 20, 5  # multiples of the typical distance from the centre
VERY_FAR = 1000  # multiple of the typical distance that is certainly wrong
MISFIT, FIT = 0.10, 0.02  # relative difference from a measured distance
MIN_MISFIT_M = 1.0  # smallest difference that counts as a misfit


def check_doubtful(files):
    """Check standard deviations, distances, control and angles for implausible values."""
    for name in ("image_points", "fiducials", "control", "check", *READINGS):
        if has_rows(files.tables[name]):
            _warn_tiny_sds(files, name, files.tables[name])
    places = places_of(files)
    for name in ("distances", "slope_distances"):
        if has_rows(files.tables[name]):
            _check_distances(files, places, files.tables[name])
    if has_rows(files.tables["control"]):
        _check_size(files, places)
        _tell_swapped(files, places)
    if any(has_rows(files.tables[name]) for name in ANGLES):
        check_gon(files, places)


def _warn_tiny_sds(files, name, table):
    for column, unit in OF_SDS.items():
        if table.columns.get(column) is None:
            continue
        sd = table.numbers(column)
        given = sd[sd > 0]
        if len(given) and given.max() < TINY[unit]:
            is_sure = name in READINGS and given.max() < SURE * TINY[unit]
            tell = files.log.problem if is_sure else files.log.warning
            tell(table.file, tiny_sd(unit, given.max()), None, column)


def _check_size(files, places):
    """Refuse control points much farther apart than the size of the tank."""
    size, coordinates = _tank_size_m(files), np.array(list(places.of.values())).reshape(-1, 3)
    coordinates = coordinates[~np.isnan(coordinates).any(axis=1)]
    if size is None or len(coordinates) < MIN_OF_OTHERS:
        return
    typical = float(np.median(np.linalg.norm(coordinates - np.median(coordinates, axis=0), axis=1)))
    if typical > MUCH_LARGER * size:
        expected = message(
            "known_in_millimetres",
            "the known points typically lie {usual:.4g} m from their middle, and the tank "
            "measures {size:.4g} m; expected metres: are they in millimetres?",
            usual=typical,
            size=size,
        )
        files.log.problem(files.tables["control"].file, expected, None, "x_m")


def _tank_size_m(files):
    """Nominal diagonal of the tank, m; None if not given."""
    if files.values is None:
        return None
    sizes = [files.values["tank"][f"nominal_{name}_m"] for name in ("diameter", "height")]
    return None if None in sizes else float(np.hypot(*sizes))


def _check_distances(files, places, table):
    """Refuse distances that fit known points, tank or other distances only in millimetres."""
    distance = table.numbers("distance_m")
    is_given = ~np.isnan(distance)
    if not is_given.any():
        return
    typical, extent = float(np.median(distance[is_given])), places.extent_m
    region = message("the_known_points", "the known points")
    for i in np.flatnonzero(is_given & (distance > MUCH_LARGER * typical)):
        evidence = distance[i]
        expected = message(
            "distance_in_millimetres",
            "found {found:.4g} m where half of the distances are below {typical:.4g} m; "
            "expected metres: is it in millimetres?",
            found=evidence,
            typical=typical,
        )
        files.log.problem(table.file, expected, table.rows[i], "distance_m")
    if extent is None:
        extent = _tank_size_m(files)
        region = message("the_tank", "the tank")
    ratio = _ratio_to_known(places) if table is files.tables["distances"] else 0.0
    evidence = ""
    if extent and typical > MUCH_LARGER * extent:
        evidence = message(
            "distances_beside_extent",
            "half of them are above {typical:.4g} m, but {of} extend over {extent:.4g} m",
            typical=typical,
            of=region,
            extent=extent,
        )
    elif THOUSANDFOLD[0] < ratio < THOUSANDFOLD[1]:
        evidence = message(
            "distances_beside_known",
            "those between known points are {ratio:.4g} times what follows from their coordinates",
            ratio=ratio,
        )
    if evidence:
        expected = message(
            "distances_in_millimetres",
            "{found}; expected metres: are they in millimetres?",
            found=evidence,
        )
        files.log.problem(table.file, expected, None, "distance_m")


def _ratio_to_known(places):
    """Median ratio of measured to computed distances between known points; 0 without any."""
    ratios = []
    for point, measured in places.measured.items():
        for other, distance, is_horizontal in measured:
            if point in places.of and other in places.of:
                use = slice(0, 2) if is_horizontal else slice(0, 3)
                computed = np.linalg.norm((places.of[point] - places.of[other])[use])
                if computed > 0:
                    ratios.append(distance / computed)
    return float(np.median(ratios)) if ratios else 0.0


def _tell_swapped(files, places):
    """Report control points that fit other points or distances only with x and y swapped.

    A point is refused if the other points lie a thousand times closer together; else it is a
    warning.
    """
    control = files.tables["control"]
    for row, point, system in zip(
        control.rows, control.of("point"), control.of("system"), strict=True
    ):
        if system is not None or point not in places.of:
            continue
        certain = _far_unless_swapped(point, places, VERY_FAR, 2)
        if certain:
            files.log.problem(control.file, _is_swapped(certain), row, "x_m")
            continue
        evidence = _far_unless_swapped(point, places) or _misfit_unless_swapped(point, places)
        if evidence:
            files.log.warning(control.file, _is_swapped(evidence), row, "x_m")


def _is_swapped(evidence):
    return message("swapped", "{evidence}: are x and y swapped?", evidence=evidence)


def _far_unless_swapped(point, places, times=FAR, of_others=MIN_OF_OTHERS):
    xy = places.of[point][:2]
    count, middle, typical = places.where_others_lie(point)
    if np.isnan(xy).any() or count < of_others:
        return ""
    distance, swapped = (float(np.hypot(*(place - middle))) for place in (xy, xy[::-1]))
    if distance > times * typical > 0 and swapped < NEAR * typical:
        return message(
            "far_from_others",
            "{point!r} is {far_m:.4g} m from the middle of the other known points, which "
            "typically lie {usual_m:.3g} m from it; with x and y swapped {swapped_m:.3g} m",
            point=point,
            far_m=distance,
            usual_m=typical,
            swapped_m=swapped,
        )
    return ""


def _misfit_unless_swapped(point, places):
    """Evidence that two distances or more fit only with x and y swapped."""
    xyz = places.of[point]
    misfits, others = [], set()
    for other, distance, is_horizontal in places.measured.get(point, ()):
        use = slice(0, 2) if is_horizontal else slice(0, 3)
        ends = (xyz[use], xyz[[1, 0, 2]][use], places.of.get(other, np.full(3, np.nan))[use])
        as_given, swapped = (float(np.linalg.norm(end - ends[2])) for end in ends[:2])
        if np.isfinite(as_given):
            others.add(other)
            misfits.append((abs(as_given - distance), abs(swapped - distance), distance))
    if len(others) < 2:
        return ""
    misfit_count = sum(
        given > max(MISFIT * distance, MIN_MISFIT_M) for given, _, distance in misfits
    )
    if 2 * misfit_count > len(misfits) and all(
        after < FIT * distance for _, after, distance in misfits
    ):
        worst = max(misfits)
        return message(
            "misses_distances",
            "{point!r} misses the measured distances to other known points by up to"
            " {worst_m:.3g} m; with x and y swapped it fits them",
            point=point,
            worst_m=worst[0],
        )
    return ""


# ---- checks for columns of angles in another unit than declared


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
            expected = expected or _compare_with_known_points(
                name, _sights(files, name, table, values), unit, places
            )
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


def _compare_with_known_points(name, sights, unit, places):
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
