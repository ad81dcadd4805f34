"""Where things are before anything is adjusted: known coordinates, distances between them."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from tankcal.job.checks.common import has_rows

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
