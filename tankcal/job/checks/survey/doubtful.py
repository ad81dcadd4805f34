"""What can be told from the files alone of wrong units and swapped coordinates."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from tankcal.job.checking import has_rows, tiny_sd
from tankcal.job.checks.survey.gon import check_gon
from tankcal.job.contract.observations import ANGLES, READINGS
from tankcal.messages import message

# Where things are before anything is adjusted: known coordinates, distances between them.

MANY = 100  # points


@dataclass(frozen=True)
class Places:
    """Known places in the survey's frame.

    of         {point: (3,) coordinates, m, nan where not known}; photos as ("photo", name)
    measured   {point: list of (other point, distance m, is it horizontal?)}
    extent_m   largest extent of the known coordinates along an axis; None: fewer than 3 points
    """

    of: dict
    measured: dict
    extent_m: float | None

    def where_others_lie(self, name):
        """How many other points there are, their middle (2,), and how far from it they lie.

        Of many points all count: one does not move their median.
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
        there = ~np.isnan(xy).any(axis=1)
        return [name for name, one in zip(self.of, there, strict=True) if one], xy[there]


def _middle_of(xy):
    if not len(xy):
        return 0, np.zeros(2), 0.0
    middle = np.median(xy, axis=0)
    return len(xy), middle, float(np.median(np.hypot(*(xy - middle).T)))


def places_of(files):
    """The Places of a survey."""
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
    return Places(of, _measured(files.tables["distances"]), extent)


def _measured(table):
    measured = {}
    if not has_rows(table):
        return measured
    rows = zip(
        table.of("from"), table.of("to"), table.of("distance_m"), table.of("kind"), strict=True
    )
    for start, end, distance, kind in rows:
        if None not in (start, end, distance) and start != end:
            for one, other in ((start, end), (end, start)):
                measured.setdefault(one, []).append((other, distance, kind == "horizontal"))
    return measured


TINY = {"mm": 0.005, "um": 0.05, "arcsec": 0.01}  # sds: all below that are doubted
SURE = 0.1  # part of that, below which those of readings are refused
OF_SDS = {
    **dict.fromkeys(("s_mm", "sx_mm", "sy_mm", "sz_mm"), "mm"),
    **dict.fromkeys(("sx_um", "sy_um", "s_um"), "um"),
    "s_arcsec": "arcsec",
}
MUCH_LARGER = 200  # distances in parts of the survey's extent
THOUSANDFOLD = (500, 2000)  # distances in parts of those between known points
MIN_OF_OTHERS = 4  # points that tell where the survey is
FAR, NEAR = 20, 5  # times the usual distance from the middle
VERY_FAR = 1000  # the same, beyond any doubt
MISFIT, FIT = 0.10, 0.02  # of a measured distance
MIN_MISFIT_M = 1.0


def check_doubtful(files):
    """Standard deviations, distances, control and angles that look wrong."""
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
    """Control that lies much further apart than the tank is large."""
    size, known = _tank_size_m(files), np.array(list(places.of.values())).reshape(-1, 3)
    known = known[~np.isnan(known).any(axis=1)]
    if size is None or len(known) < MIN_OF_OTHERS:
        return
    usual = float(np.median(np.linalg.norm(known - np.median(known, axis=0), axis=1)))
    if usual > MUCH_LARGER * size:
        expected = message(
            "known_in_millimetres",
            "the known points typically lie {usual:.4g} m from their middle, and the tank "
            "measures {size:.4g} m; expected metres: are they in millimetres?",
            usual=usual,
            size=size,
        )
        files.log.problem(files.tables["control"].file, expected, None, "x_m")


def _tank_size_m(files):
    """Nominal diagonal of the tank, or None."""
    if files.values is None:
        return None
    sizes = [files.values["tank"][f"nominal_{name}_m"] for name in ("diameter", "height")]
    return None if None in sizes else float(np.hypot(*sizes))


def _check_distances(files, places, table):
    """Distances that only fit the known points, the tank or one another in millimetres."""
    distance = table.numbers("distance_m")
    there = ~np.isnan(distance)
    if not there.any():
        return
    typical, extent = float(np.median(distance[there])), places.extent_m
    of = message("the_known_points", "the known points")
    for i in np.flatnonzero(there & (distance > MUCH_LARGER * typical)):
        found = distance[i]
        expected = message(
            "distance_in_millimetres",
            "found {found:.4g} m where half of the distances are below {typical:.4g} m; "
            "expected metres: is it in millimetres?",
            found=found,
            typical=typical,
        )
        files.log.problem(table.file, expected, table.rows[i], "distance_m")
    if extent is None:
        extent = _tank_size_m(files)
        of = message("the_tank", "the tank")
    ratio = _ratio_to_known(places) if table is files.tables["distances"] else 0.0
    found = ""
    if extent and typical > MUCH_LARGER * extent:
        found = message(
            "distances_beside_extent",
            "half of them are above {typical:.4g} m, but {of} extend over {extent:.4g} m",
            typical=typical,
            of=of,
            extent=extent,
        )
    elif THOUSANDFOLD[0] < ratio < THOUSANDFOLD[1]:
        found = message(
            "distances_beside_known",
            "those between known points are {ratio:.4g} times what follows from their coordinates",
            ratio=ratio,
        )
    if found:
        expected = message(
            "distances_in_millimetres",
            "{found}; expected metres: are they in millimetres?",
            found=found,
        )
        files.log.problem(table.file, expected, None, "distance_m")


def _ratio_to_known(places):
    """Median ratio of measured distances between known points to computed ones; 0: none."""
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
    """Control points that lie with the others, or fit their distances, once x and y are swapped.

    Refused where the others lie a thousand times closer together.
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
    here = places.of[point][:2]
    count, middle, usual = places.where_others_lie(point)
    if np.isnan(here).any() or count < of_others:
        return ""
    far, swapped = (float(np.hypot(*(place - middle))) for place in (here, here[::-1]))
    if far > times * usual > 0 and swapped < NEAR * usual:
        return message(
            "far_from_others",
            "{point!r} is {far_m:.4g} m from the middle of the other known points, which "
            "typically lie {usual_m:.3g} m from it; with x and y swapped {swapped_m:.3g} m",
            point=point,
            far_m=far,
            usual_m=usual,
            swapped_m=swapped,
        )
    return ""


def _misfit_unless_swapped(point, places):
    """Distances to two points or more that do not fit, but all of them do with x and y swapped."""
    here = places.of[point]
    misfits, others = [], set()
    for other, distance, is_horizontal in places.measured.get(point, ()):
        use = slice(0, 2) if is_horizontal else slice(0, 3)
        ends = (here[use], here[[1, 0, 2]][use], places.of.get(other, np.full(3, np.nan))[use])
        as_given, swapped = (float(np.linalg.norm(end - ends[2])) for end in ends[:2])
        if np.isfinite(as_given):
            others.add(other)
            misfits.append((abs(as_given - distance), abs(swapped - distance), distance))
    if len(others) < 2:
        return ""
    bad = sum(one > max(MISFIT * distance, MIN_MISFIT_M) for one, _, distance in misfits)
    if 2 * bad > len(misfits) and all(two < FIT * distance for _, two, distance in misfits):
        worst = max(misfits)
        return message(
            "misses_distances",
            "{point!r} misses the measured distances to other known points by up to"
            " {worst_m:.3g} m; with x and y swapped it fits them",
            point=point,
            worst_m=worst[0],
        )
    return ""
