"""Position of a single point from all its observations to known points, of any kind.

Polar points, arcs, resections and levels are computed elsewhere where they are complete. If only a
mixture determines a point (an azimuth and an angle at it, two slope distances and a level), all its
observations are solved by damped least squares from many starts. The solutions show whether there
is one position, several, or a line of positions.
"""

from dataclasses import dataclass, replace

import numpy as np

from tankcal.errors import SolutionError
from tankcal.messages import join_with_or, list_some, message
from tankcal.survey.network.survey import FEWEST
from tankcal.survey.observations import (
    Directions,
    Distances,
    HeightDifferences,
    Layout,
    State,
    VerticalAngles,
)
from tankcal.survey.start.polar import APART, orient_circles

MOST = 12  # points sought in one call
STEPS = 40
MET = 1e-4  # relative sum of misfits below which all readings are met
RADII = (0.25, 0.8)  # radii of the starts around known ends, relative to their extent
BEARINGS = 8
STEEPLY = (-0.5, 0.0, 0.5)  # heights of the starts, relative to the extent
FAR = 30.0  # times the extent: beyond, lines of sight are nearly parallel
WEAK = 1e-3  # smallest singular value of a determined position
ENDS = 3  # known ends around which starts are placed
SHOWN = 4  # number of positions above which they form a line


@dataclass(frozen=True)
class Sought:
    """Result of the search for a point.

    Attributes
    ----------
    place_m : ndarray, shape (3,)
        Position; nan where not determined.
    rivals_m : ndarray, shape (k, 3)
        Equivalent positions, if there are several.
    rows : int
        Usable values between the point and known points.
    unknowns : int
        Unknowns that these must determine.
    """

    place_m: np.ndarray
    rivals_m: np.ndarray
    rows: int
    unknowns: int


def position_single_points(survey, plan, xyz_m, sought_already):
    """Compute single points with enough observations to known points.

    Parameters
    ----------
    survey : network.Survey
    plan : Plan
    xyz_m : ndarray, shape (points, 3)
    sought_already : dict
        Cache for further calls with the same survey.

    Returns
    -------
    ndarray, shape (points, 3)
    """
    xyz, sought = xyz_m.copy(), 0
    for point in np.flatnonzero(np.isnan(xyz_m).any(axis=1) & _tied_points(survey)):
        result = sought_point(survey, plan, xyz, point, sought_already)
        sought += result.rows >= result.unknowns
        new = np.isfinite(result.place_m)
        xyz[point, new] = result.place_m[new]
        if sought >= MOST:
            break
    return xyz


def sought_point(survey, plan, xyz_m, point, sought_already):
    """Search for a point with (partly) unknown coordinates.

    Parameters
    ----------
    survey : network.Survey
    plan : Plan
    xyz_m : ndarray, shape (points, 3)
    point : int
    sought_already : dict
        Cache for further calls with the same survey.

    Returns
    -------
    Sought
    """
    zeros = orient_circles(plan, xyz_m[:, :2])[: len(survey.sets)]
    # All observations first, then those in plan only.
    tries = [_Ties(survey, xyz_m, zeros, point, in_plan) for in_plan in (False, True)]
    first = None
    for ties in tries:
        result = Sought(np.full(3, np.nan), np.zeros((0, 3)), ties.rows, ties.unknowns)
        if ties.rows >= ties.unknowns > 0:
            if ties.key not in sought_already:
                sought_already[ties.key] = _search_position(ties)
            result = sought_already[ties.key]
        if np.isfinite(result.place_m).any():
            return result
        first = result if first is None or len(result.rivals_m) > len(first.rivals_m) else first
    return first


def misfit_of_places(survey, plan, xyz_m, points):
    """Sum of the misfits, m, of readings between given points and known points.

    Parameters
    ----------
    survey : network.Survey
    plan : Plan
    xyz_m : ndarray, shape (points, 3)
    points : sequence of int
    """
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


def _tied_points(survey):
    """Mask (points,) of points with angles, distances or levels."""
    mask = np.zeros(len(survey.points), dtype=bool)
    for item in survey.observations:
        if item.places_points and item.rows == 1:
            for name in item.ties:
                mask[getattr(item, name)] = True
    return mask


class _Ties:
    """All observations between one point and known points, for many trial positions at once."""

    def __init__(self, survey, xyz_m, zeros, point, in_plan):
        self.survey, self.xyz, self.point = survey, xyz_m, point
        self.zeros = zeros
        self.nuisance = {
            name_of_unknown: item.value for name_of_unknown, item in survey.nuisances.items()
        }
        self.groups = []
        ends = []
        for item in survey.observations:
            if not (item.places_points and item.rows == 1):
                continue
            item = self._usable(item, in_plan)
            if len(item):
                self.groups.append(item)
                ends += [getattr(item, name) for name in item.ties]
        ends = np.unique(np.concatenate(ends)) if ends else np.zeros(0, dtype=int)
        self.ends = ends[ends != point]
        self.sets = sorted({int(s) for item in self.groups if isinstance(item, Directions)
                            for s in item.set[item.start == point]})  # fmt: skip
        axes = np.flatnonzero(np.isnan(xyz_m[point]))
        self.axes = [axis for axis in axes if axis == 2 or self._flat] if self.groups else []
        if not self._high:
            self.axes = [axis for axis in self.axes if axis < 2]
        self.rows = sum(len(item) for item in self.groups)
        self.unknowns = len(self.axes) + len(self.sets) if self.axes else 0
        self.extent = self._extent()

    def _usable(self, item, in_plan):
        """Rows between the point and known points; coordinates that they do not use may be
        unknown."""
        is_of_point = np.zeros(len(item), dtype=bool)
        for name in item.ties:
            is_of_point |= getattr(item, name) == self.point
        if item.use is not None:
            is_of_point &= item.use > 0
        # A direction to the point requires an oriented circle.
        if isinstance(item, Directions):
            is_of_point &= (item.start == self.point) | np.isfinite(self.zeros[item.set])
        if in_plan and 2 in item.axes:
            is_of_point[:] = False
        item = item.taken(np.flatnonzero(is_of_point))
        known = np.ones(len(item), dtype=bool)
        for name in item.ties:
            end = getattr(item, name)
            known &= (end == self.point) | np.isfinite(self.xyz[end][:, item.axes]).all(axis=1)
        return item.taken(np.flatnonzero(known))

    @property
    def _flat(self):
        """Whether an observation depends on the position in plan."""
        return any(0 in item.axes for item in self.groups)

    @property
    def _high(self):
        """Whether an observation depends on the height."""
        return any(2 in item.axes for item in self.groups)

    def _extent(self):
        """Extent of the known ends and of the distances to them, m."""
        if not len(self.ends):
            return 1.0
        ends = np.nan_to_num(self.xyz[self.ends])
        sizes = [float(np.linalg.norm(np.ptp(ends, axis=0)))]
        sizes += [float(np.max(np.abs(item.value))) for item in self.groups if item.unit == "m"]
        return max(max(sizes), 1e-3)

    @property
    def key(self):
        """Identification of the problem within one survey, for the cache."""
        places = self.xyz[[self.point, *self.ends]].tobytes()
        return self.point, self.rows, tuple(self.ends), tuple(self.axes), places

    def starts(self):
        """Start positions (k, axes) of the search."""
        ends = np.nan_to_num(self.xyz[self.ends])
        middles = np.vstack([ends.mean(axis=0), ends[:ENDS]])
        # The offset of 0.1 rad avoids starts on symmetry axes, where derivatives vanish.
        t = 2 * np.pi * np.arange(BEARINGS) / BEARINGS + 0.1
        ring = np.column_stack([np.sin(t), np.cos(t)])
        rings = np.concatenate([radius * self.extent * ring for radius in RADII])
        places = (middles[:, None, :2] + rings[None]).reshape(-1, 2)
        high = middles[0, 2] + self.extent * np.array(STEEPLY)
        places = np.column_stack([np.repeat(places, 3, axis=0), np.tile(high, len(places))])
        return np.unique(places[:, self.axes], axis=0)

    def trial(self, places):
        """Misfits (k, rows), m, and derivatives of k positions (k, axes + sets)."""
        k, n, sets = len(places), len(self.xyz), len(self.survey.sets)
        trial_points = np.tile(self.xyz[self.point], (k, 1))
        trial_points[:, self.axes] = places[:, : len(self.axes)]
        zeros = np.concatenate([self.zeros, places[:, len(self.axes) :].ravel()])
        nuisance = self.nuisance | {"orientation_rad": zeros}
        # Each trial position is an additional point, and each trial circle an additional set.
        state = State(xyz_m=np.vstack([self.xyz, trial_points]), nuisance=nuisance)
        columns = np.full((n + k, 3), -1)
        columns[n:, self.axes] = np.arange(len(self.axes))
        turns = np.full(len(zeros), -1)
        turns[sets:] = np.tile(len(self.axes) + np.arange(len(self.sets)), k)
        fixed = {
            name_of_unknown: np.full(len(value), -1) for name_of_unknown, value in nuisance.items()
        }
        layout = Layout(columns, np.zeros((0, 6)), np.full(1, -1),
                        fixed | {"orientation_rad": turns}, np.zeros((0, 7)))  # fmt: skip
        off, jac = [], []
        for item in self.groups:
            many = self._repeat_observations(item, k)
            computed, derivatives = many.computed(state, True)
            size = self.extent if item.unit == "rad" else 1.0
            rows = np.zeros((len(many), self.unknowns + 1))
            np.add.at(rows, (np.arange(len(many))[:, None], many.columns(layout)),
                      derivatives[:, 0])  # fmt: skip
            off.append(size * many.difference(computed).reshape(k, len(item)))
            jac.append(size * rows[:, :-1].reshape(k, len(item), self.unknowns))
        return np.concatenate(off, axis=1), np.concatenate(jac, axis=1)

    def _repeat_observations(self, item, k):
        """The observations k times, each with its own point and circles."""
        which = np.repeat(np.arange(k), len(item))
        many = item.taken(np.tile(np.arange(len(item)), k))
        changes = {}
        for name in many.ties:
            end = getattr(many, name)
            changes[name] = np.where(end == self.point, len(self.xyz) + which, end)
        if isinstance(item, Directions) and self.sets:
            place = np.searchsorted(self.sets, many.set)
            own_set = len(self.survey.sets) + len(self.sets) * which + place
            changes["set"] = np.where(many.start == self.point, own_set, many.set)
        return replace(many, **changes)

    def turned(self, places):
        """Append to positions (k, axes) the circle zeros that fit them (k, sets)."""
        if not self.sets:
            return places
        state = np.hstack([places, np.zeros((len(places), len(self.sets)))])
        off, jac = self.trial(state)
        for column in range(len(self.axes), self.unknowns):
            rows_of_set = np.flatnonzero(jac[0, :, column] != 0)
            state[:, column] = off[:, rows_of_set[0]] / self.extent  # the first sight fits exactly
        return state


def _search_position(ties):
    """Search for the position of a point with enough observations."""
    with np.errstate(all="ignore"):
        places = _refine_positions(ties, ties.turned(ties.starts()))
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
    # Positions are equivalent if all their readings are met.
    fits = misfit <= max(MET * ties.extent, misfit[best])
    distinct = [best]
    for i in np.flatnonzero(fits)[np.argsort(misfit[fits], kind="stable")]:
        apart = np.linalg.norm(places[distinct, :axes] - places[i, :axes], axis=1)
        if (apart > APART * ties.extent).all():
            distinct.append(i)
    rivals = np.tile(ties.xyz[ties.point], (len(distinct), 1))
    rivals[:, ties.axes] = places[distinct, :axes]
    lengths = np.linalg.norm(jac[best], axis=0)
    # Scaled columns make the singular value independent of the units.
    firm = np.linalg.svd(jac[best] / np.maximum(lengths, 1e-12), compute_uv=False)[-1] > WEAK
    place = rivals[0] if len(distinct) == 1 and firm else nothing
    return Sought(place, rivals, ties.rows, ties.unknowns)


def _refine_positions(ties, places):
    """Positions (k, unknowns) after damped Gauss-Newton steps, each independent."""
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
        # A step is limited to the extent of the figure, so that no trial diverges.
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


# ---- messages about unknowns without start values

LISTED = 10


class SeveralPlacesError(SolutionError):
    """Several positions fit the measurements: not a mistake, but one reading too few."""


def refuse_missing(survey, sights, xyz_m, piece, sets, reasons, why=lambda point: None):
    """Complete coordinates, or raise an error that lists the missing start values.

    Points with too few observations take the mean position; the adjustment later omits them by
    name.

    Parameters
    ----------
    survey : network.Survey
    sights : sequence of Sight
    xyz_m : ndarray, shape (points, 3)
    piece : Piece
    sets : ndarray, shape (sets,)
    reasons : list of str
    why : callable
        why(point) returns the error of a point without position, see `unfixed_point_error`, or
        None.

    Returns
    -------
    ndarray, shape (points, 3)

    Raises
    ------
    SolutionError
        If a photo, a point with enough observations, or a circle has no start value.
    """
    hopeless = survey.values_of_points() < FEWEST
    missing = np.isnan(xyz_m) & ~hopeless[:, None]
    told = []
    known = np.isfinite(xyz_m).all(axis=1)
    for photo in np.flatnonzero(~piece.oriented):
        count = known[sights[photo].point].sum()
        name = survey.photos.names[photo]
        if count == 3:
            told.append(
                message(
                    "photo_of_three",
                    "photo {name} (3 known points, which several positions explain)",
                    name=name,
                )
            )
        else:
            told.append(
                message(
                    "photo_of_points", "photo {name} ({count} known points)", name=name, count=count
                )
            )
    without_plan = np.flatnonzero(missing[:, :2].any(axis=1))
    points = [message("named_point", "point {point}", point=survey.points[i]) for i in without_plan]
    told += points if len(points) <= LISTED else [list_some(points, LISTED)]
    flat = np.isfinite(xyz_m[:, :2]).all(axis=1) & np.isnan(xyz_m[:, 2])
    level = np.flatnonzero(flat if (flat & ~hopeless).any() else flat & ~hopeless)
    # Circles follow from points, so they are listed only if no point is missing.
    if not told:
        unknown = [
            message("named_set", "orientation of direction set {number}", number=number)
            for number in np.flatnonzero(np.isnan(sets)) + 1
        ]
        told += unknown if len(unknown) <= LISTED else [list_some(unknown, LISTED)]
    sentences = (
        [message("not_started", "no approximate values for {told}", told=[*told])] if told else []
    )
    if len(level):
        sentences.append(_no_heights(survey, level))
    if sentences:
        errors = [item for item in map(why, without_plan[:LISTED]) if item is not None]
        several = len(errors) == len(told) and all(
            isinstance(item, SeveralPlacesError) for item in errors
        )
        kind = SeveralPlacesError if several and errors else SolutionError
        texts = [
            *sentences,
            *(item.args[0] for item in errors),
            *(item for item in reasons if item),
        ]
        raise kind(join_with_semicolons(texts))
    # Points without observations need finite coordinates only.
    middle = np.nanmean(xyz_m, axis=0) if known.any() else np.zeros(3)
    return np.where(np.isnan(xyz_m), middle, xyz_m)


def unfixed_point_error(survey, sought, point, centre_m):
    """SolutionError of a point that its observations to known points do not determine, or None.

    Parameters
    ----------
    survey : network.Survey
    found : Sought
    point : int
    centre_m : ndarray, shape (3,)
        Added to the coordinates.
    """
    name = survey.points[point]
    if not sought.unknowns:
        return None
    if sought.rows < sought.unknowns:
        return SolutionError(
            message(
                "point_short_of_readings",
                "point {name} has {rows} reading to known points, and {unknowns} are needed"
                if sought.rows == 1
                else "point {name} has {rows} readings to known points, and {unknowns} are needed",
                name=name,
                rows=sought.rows,
                unknowns=sought.unknowns,
            )
        )
    if len(sought.rivals_m) > SHOWN or len(sought.rivals_m) == 1:
        return SolutionError(
            message(
                "point_moves_freely",
                "the readings between point {name} and known points leave it free to move (lines "
                "or circles that coincide, or hardly cross): another reading is needed",
                name=name,
            )
        )
    if not len(sought.rivals_m):
        return SolutionError(
            message(
                "point_fits_nowhere",
                "no place of point {name} agrees with the readings between it and known points",
                name=name,
            )
        )
    places = [
        "(" + ", ".join(f"{value:.2f}" for value in place[np.isfinite(place)]) + ")"
        for place in sought.rivals_m + centre_m
    ]
    return SeveralPlacesError(
        message(
            "point_at_several_places",
            "point {name} may be at {places}, which fit equally well: another reading is "
            "needed, or approximate coordinates (in control.csv, standard deviations blank)",
            name=name,
            places=join_with_or(places),
        )
    )


def loose_frame_sentence(survey, local, known):
    """Sentence about points (points,) of a local frame in plan that is not joined."""
    names = [str(survey.points[i]) for i in np.flatnonzero(local & ~known)]
    some = list_some(names, LISTED)
    common = int((local & known).sum())
    if common > 1:
        return message(
            "either_side",
            "points {some} may be on either side of the line through the known ones: give "
            "one of them approximate coordinates (in control.csv, standard deviations blank)",
            some=some,
        )
    if common == 1:
        return message(
            "points_share_one",
            "points {some} are connected to each other, but share only 1 known point with "
            "the rest: 2 are needed, or 1 and an azimuth",
            some=some,
        )
    return message(
        "points_share_few",
        "points {some} are connected to each other, but share only {common} known points "
        "with the rest: 2 are needed, or 1 and an azimuth",
        some=some,
        common=common,
    )


def join_with_semicolons(parts):
    """Join parts with semicolons."""
    *first, last = parts
    if not first:
        return last
    before = join_with_semicolons(first)
    return message("and_also", "{before}; {last}", before=before, last=last)


def _no_heights(survey, level):
    """Sentence about points without heights, with the reason and a remedy."""
    names = list_some([str(survey.points[i]) for i in level], LISTED)
    kinds = (HeightDifferences, VerticalAngles)
    observed = any(isinstance(item, kinds) and len(item) for item in survey.observations)
    spatial = any(
        isinstance(item, Distances) and not item.horizontal for item in survey.observations
    )
    why = message(
        "no_height_observed",
        "no zenith angle, vertical angle or levelled height difference was observed",
    )
    if observed:
        why = message("heights_hang_free", "they are not connected to any point with a known z")
    end = (
        message(
            "distances_taken_spatial",
            "; distances are taken as spatial ones unless kind = horizontal",
        )
        if spatial
        else ""
    )
    return message(
        "heights_not_determined",
        "the heights (z) of {names} are not determined: {why}; give their z as control{end}",
        names=names,
        why=why,
        end=end,
    )
