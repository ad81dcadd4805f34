"""A single point from everything that ties it to known ones, whatever the mixture.

Polar points, arcs, resections and levels are computed where they are whole. Where only a mixture
fixes a point (an azimuth and an angle at it, two slope distances and a level) all its observations
are solved by damped least squares from many starts: every place at which they are met is found, and
whether there is one such place, several, or a line of them.
"""

from dataclasses import dataclass, replace

import numpy as np

from tankcal.survey.observations import Directions, Layout, State
from tankcal.survey.start.polar import APART, orient_circles

MOST = 12  # points that are looked for at a time
STEPS = 40
MET = 1e-4  # of the extent: sum of the misfits of a place at which all readings are met
RADII = (0.25, 0.8)  # of the extent of the known ends, about which starts lie
BEARINGS = 8
STEEPLY = (-0.5, 0.0, 0.5)  # of the extent: heights of the starts
FAR = 30.0  # times the extent: farther away lines of sight are as good as parallel
WEAK = 1e-3  # change of all misfits over that of the place, below which it may move freely
ENDS = 3  # known ends about which starts are laid
SHOWN = 4  # places beyond which they are no longer several, but a line of them


@dataclass(frozen=True)
class Sought:
    """What the observations say of a point.

    place_m   (3,) where it stands; nan where nothing was found of a coordinate
    rivals_m  (k, 3) places that fit as well, when there are several
    rows      usable values that tie it to known points       unknowns  values that they must fix
    """

    place_m: np.ndarray
    rivals_m: np.ndarray
    rows: int
    unknowns: int


def position_single_points(survey, plan, xyz_m, sought_already):
    """Coordinates (points, 3) with those of single points that are tied to known ones in all.

    sought_already  dict that remembers what was found, for the next call with the same survey
    """
    xyz, sought = xyz_m.copy(), 0
    for point in np.flatnonzero(np.isnan(xyz_m).any(axis=1) & _tied(survey)):
        found = sought_point(survey, plan, xyz, point, sought_already)
        sought += found.rows >= found.unknowns
        new = np.isfinite(found.place_m)
        xyz[point, new] = found.place_m[new]
        if sought >= MOST:
            break
    return xyz


def sought_point(survey, plan, xyz_m, point, sought_already):
    """The Sought of a point whose coordinates are (partly) nan."""
    zeros = orient_circles(plan, xyz_m[:, :2])[: len(survey.sets)]
    tries = [_Ties(survey, xyz_m, zeros, point, in_plan) for in_plan in (False, True)]
    first = None
    for ties in tries:
        found = Sought(np.full(3, np.nan), np.zeros((0, 3)), ties.rows, ties.unknowns)
        if ties.rows >= ties.unknowns > 0:
            if ties.key not in sought_already:
                sought_already[ties.key] = _solved(ties)
            found = sought_already[ties.key]
        if np.isfinite(found.place_m).any():
            return found
        first = found if first is None or len(found.rivals_m) > len(first.rivals_m) else first
    return first


def misfit_of_places(survey, plan, xyz_m, points):
    """Sum of the misfits, m, of readings between points (k,), at their places, and known ones."""
    zeros = orient_circles(plan, xyz_m[:, :2])[: len(survey.sets)]
    total = 0.0
    for point in points:
        open_m = xyz_m.copy()
        open_m[point] = np.nan
        ties = _Ties(survey, open_m, zeros, point, in_plan=False)
        if ties.unknowns:
            with np.errstate(all="ignore"):
                off, _ = ties.trial(ties.turned(xyz_m[[point]][:, ties.axes]))
            total += float(np.abs(off).sum())
    return total


def _tied(survey):
    """(points,) True for points that angles, distances or levels speak of."""
    found = np.zeros(len(survey.points), dtype=bool)
    for one in survey.observations:
        if one.places_points and one.rows == 1:
            for name in one.ties:
                found[getattr(one, name)] = True
    return found


class _Ties:
    """All observations between one point and known ones, for many trial places at once."""

    def __init__(self, survey, xyz_m, zeros, point, in_plan):
        self.survey, self.xyz, self.point = survey, xyz_m, point
        self.zeros = zeros
        self.nuisance = {of: one.value for of, one in survey.nuisances.items()}
        self.groups = []
        ends = []
        for one in survey.observations:
            if not (one.places_points and one.rows == 1):
                continue
            one = self._usable(one, in_plan)
            if len(one):
                self.groups.append(one)
                ends += [getattr(one, name) for name in one.ties]
        ends = np.unique(np.concatenate(ends)) if ends else np.zeros(0, dtype=int)
        self.ends = ends[ends != point]
        self.sets = sorted({int(s) for one in self.groups if isinstance(one, Directions)
                            for s in one.set[one.start == point]})  # fmt: skip
        axes = np.flatnonzero(np.isnan(xyz_m[point]))
        self.axes = [axis for axis in axes if axis == 2 or self._flat] if self.groups else []
        if not self._high:
            self.axes = [axis for axis in self.axes if axis < 2]
        self.rows = sum(len(one) for one in self.groups)
        self.unknowns = len(self.axes) + len(self.sets) if self.axes else 0
        self.extent = self._extent()

    def _usable(self, one, in_plan):
        """Rows that tie the point to known ones, coordinates that they do not need left open."""
        mine = np.zeros(len(one), dtype=bool)
        for name in one.ties:
            mine |= getattr(one, name) == self.point
        if one.use is not None:
            mine &= one.use > 0
        if isinstance(one, Directions):
            mine &= (one.start == self.point) | np.isfinite(self.zeros[one.set])
        if in_plan and 2 in one.axes:
            mine[:] = False
        one = one.taken(np.flatnonzero(mine))
        known = np.ones(len(one), dtype=bool)
        for name in one.ties:
            end = getattr(one, name)
            known &= (end == self.point) | np.isfinite(self.xyz[end][:, one.axes]).all(axis=1)
        return one.taken(np.flatnonzero(known))

    @property
    def _flat(self):
        return any(0 in one.axes for one in self.groups)

    @property
    def _high(self):
        return any(2 in one.axes for one in self.groups)

    def _extent(self):
        """Size of the figure: of the known ends and of the distances to them."""
        if not len(self.ends):
            return 1.0
        ends = np.nan_to_num(self.xyz[self.ends])
        sizes = [float(np.linalg.norm(np.ptp(ends, axis=0)))]
        sizes += [float(np.max(np.abs(one.value))) for one in self.groups if one.unit == "m"]
        return max(max(sizes), 1e-3)

    @property
    def key(self):
        """What the Sought depends on, within one survey."""
        places = self.xyz[[self.point, *self.ends]].tobytes()
        return self.point, self.rows, tuple(self.ends), tuple(self.axes), places

    def starts(self):
        """Places (k, axes) from which the point is looked for."""
        ends = np.nan_to_num(self.xyz[self.ends])
        middles = np.vstack([ends.mean(axis=0), ends[:ENDS]])
        t = 2 * np.pi * np.arange(BEARINGS) / BEARINGS + 0.1
        ring = np.column_stack([np.sin(t), np.cos(t)])
        rings = np.concatenate([radius * self.extent * ring for radius in RADII])
        places = (middles[:, None, :2] + rings[None]).reshape(-1, 2)
        high = middles[0, 2] + self.extent * np.array(STEEPLY)
        places = np.column_stack([np.repeat(places, 3, axis=0), np.tile(high, len(places))])
        return np.unique(places[:, self.axes], axis=0)

    def trial(self, places):
        """States of k places (k, axes + sets): misfits (k, rows), m, and derivatives."""
        k, n, sets = len(places), len(self.xyz), len(self.survey.sets)
        own = np.tile(self.xyz[self.point], (k, 1))
        own[:, self.axes] = places[:, : len(self.axes)]
        zeros = np.concatenate([self.zeros, places[:, len(self.axes) :].ravel()])
        nuisance = self.nuisance | {"orientation_rad": zeros}
        state = State(xyz_m=np.vstack([self.xyz, own]), nuisance=nuisance)
        columns = np.full((n + k, 3), -1)
        columns[n:, self.axes] = np.arange(len(self.axes))
        turns = np.full(len(zeros), -1)
        turns[sets:] = np.tile(len(self.axes) + np.arange(len(self.sets)), k)
        fixed = {of: np.full(len(value), -1) for of, value in nuisance.items()}
        layout = Layout(columns, np.zeros((0, 6)), np.full(1, -1),
                        fixed | {"orientation_rad": turns}, np.zeros((0, 7)))  # fmt: skip
        off, jac = [], []
        for one in self.groups:
            many = self._copied(one, k)
            computed, derivatives = many.computed(state, True)
            size = self.extent if one.unit == "rad" else 1.0
            rows = np.zeros((len(many), self.unknowns + 1))
            np.add.at(rows, (np.arange(len(many))[:, None], many.columns(layout)),
                      derivatives[:, 0])  # fmt: skip
            off.append(size * many.difference(computed).reshape(k, len(one)))
            jac.append(size * rows[:, :-1].reshape(k, len(one), self.unknowns))
        return np.concatenate(off, axis=1), np.concatenate(jac, axis=1)

    def _copied(self, one, k):
        """The observations k times, each time to a point, and from circles, of their own."""
        which = np.repeat(np.arange(k), len(one))
        many = one.taken(np.tile(np.arange(len(one)), k))
        changes = {}
        for name in many.ties:
            end = getattr(many, name)
            changes[name] = np.where(end == self.point, len(self.xyz) + which, end)
        if isinstance(one, Directions) and self.sets:
            place = np.searchsorted(self.sets, many.set)
            own = len(self.survey.sets) + len(self.sets) * which + place
            changes["set"] = np.where(many.start == self.point, own, many.set)
        return replace(many, **changes)

    def turned(self, places):
        """Places (k, axes) with the zeros of the point's own circles that fit them (k, sets)."""
        if not self.sets:
            return places
        both = np.hstack([places, np.zeros((len(places), len(self.sets)))])
        off, jac = self.trial(both)
        for column in range(len(self.axes), self.unknowns):
            mine = np.flatnonzero(jac[0, :, column] != 0)
            both[:, column] = off[:, mine[0]] / self.extent  # the first sight agrees
        return both


def _solved(ties):
    """The Sought of ties with enough rows."""
    with np.errstate(all="ignore"):
        places = _settled(ties, ties.turned(ties.starts()))
    off, jac = ties.trial(places)
    misfit = np.abs(off).sum(axis=1)
    axes = len(ties.axes)
    ends = np.nan_to_num(ties.xyz[ties.ends])[:, ties.axes]
    away = np.abs(places[:, None, :axes] - ends[None]).max(axis=(1, 2))
    sound = np.isfinite(misfit) & np.isfinite(jac).all(axis=(1, 2)) & (away < FAR * ties.extent)
    nothing = np.full(3, np.nan)
    if not sound.any():
        return Sought(nothing, np.zeros((0, 3)), ties.rows, ties.unknowns)
    places, misfit, jac = places[sound], misfit[sound], jac[sound]
    best = int(np.argmin(misfit))
    fits = misfit <= max(MET * ties.extent, misfit[best])
    distinct = [best]
    for i in np.flatnonzero(fits)[np.argsort(misfit[fits], kind="stable")]:
        apart = np.linalg.norm(places[distinct, :axes] - places[i, :axes], axis=1)
        if (apart > APART * ties.extent).all():
            distinct.append(i)
    rivals = np.tile(ties.xyz[ties.point], (len(distinct), 1))
    rivals[:, ties.axes] = places[distinct, :axes]
    lengths = np.linalg.norm(jac[best], axis=0)
    firm = np.linalg.svd(jac[best] / np.maximum(lengths, 1e-12), compute_uv=False)[-1] > WEAK
    place = rivals[0] if len(distinct) == 1 and firm else nothing
    return Sought(place, rivals, ties.rows, ties.unknowns)


def _settled(ties, places):
    """Places (k, unknowns) after damped Gauss-Newton steps, each on its own."""
    off, jac = ties.trial(places)
    cost, damping = np.sum(off**2, axis=1), np.full(len(places), 1e-3)
    eye = np.eye(ties.unknowns)
    for _ in range(STEPS):
        normal = np.einsum("kri,krj->kij", jac, jac)
        size = np.maximum(np.einsum("kii->ki", normal), 1e-12)
        system = normal + (damping[:, None] * size)[:, :, None] * eye
        alive = np.isfinite(system).all(axis=(1, 2)) & np.isfinite(cost)
        step = np.zeros_like(places)
        right = np.einsum("kri,kr->ki", jac, off)[alive]
        step[alive] = -np.linalg.solve(system[alive], right[:, :, None])[:, :, 0]
        length = np.linalg.norm(step, axis=1, keepdims=True)
        step *= np.minimum(1.0, ties.extent / np.maximum(length, 1e-12))
        new_off, new_jac = ties.trial(places + step)
        new_cost = np.sum(new_off**2, axis=1)
        better = new_cost < cost
        places = np.where(better[:, None], places + step, places)
        off, jac = (np.where(better.reshape(-1, *[1] * (a.ndim - 1)), a, b)
                    for a, b in ((new_off, off), (new_jac, jac)))  # fmt: skip
        cost = np.where(better, new_cost, cost)
        damping = np.clip(np.where(better, damping / 5, damping * 10), 1e-12, 1e8)
        if not (better & (length[:, 0] > 1e-6 * ties.extent)).any():
            break
    return places
