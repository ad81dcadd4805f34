"""Assembly of the least squares problem of a survey: unknowns and their columns."""

from dataclasses import dataclass
from functools import partial

import numpy as np

from tankcal.camera.model import PARAMETERS
from tankcal.errors import SolutionError
from tankcal.messages import fill_template, list_some, message
from tankcal.solver import Group, Model
from tankcal.solver.elimination import PART
from tankcal.survey.network.blocks import CORRELATED, correlated_groups, is_in_block
from tankcal.survey.network.survey import FEWEST, IMAGES, SCOPES
from tankcal.survey.observations import (
    NUISANCES,
    KnownUnknowns,
    Layout,
    State,
)


@dataclass(frozen=True)
class HeldObservations:
    """Observations that hold exactly (sd 0).

    Attributes
    ----------
    observations : Observations
        As in the survey, relative to the centre.
    conditions : Observations
        The same observations as conditions.
    row_of : ndarray of int, shape (conditions,)
        Number of the observation of each condition.
    source, rows
        See Problem.
    """

    observations: object
    conditions: object
    row_of: np.ndarray
    source: object
    rows: np.ndarray


@dataclass(frozen=True)
class Problem:
    """A survey ready for adjustment; coordinates are relative to `centre_m`.

    Attributes
    ----------
    model, state, layout
        Input of the solver.
    observations : tuple
        One for each group of the model.
    sources : tuple
        Source of each group: "image points", a number in Survey.observations, or "known
        beforehand".
    rows_of : tuple
        Row numbers of each group in its source.
    centre_m : ndarray, shape (3,)
    set_aside : tuple, length points
        Reason why a point is not adjusted; empty if it is.
    eliminated : ndarray of bool, shape (points,)
        True for points eliminated from the normal equations.
    interior_of : ndarray of int, shape (photos, 13)
        Indices of the parameters of each photo in State.interior.
    exact : tuple of HeldObservations
        Observations that hold exactly.
    points, photos : tuple
        Names.
    ordinary : int
        Number of groups before the groups of correlated observations.
    blocks : tuple
        Pairs (number of a group of correlated observations, Members), the last groups; the number
        is None if the whole block is rejected.
    """

    model: Model
    state: State
    layout: Layout
    observations: tuple
    sources: tuple
    rows_of: tuple
    centre_m: np.ndarray
    set_aside: tuple
    eliminated: np.ndarray
    interior_of: np.ndarray
    exact: tuple = ()
    points: tuple = ()
    photos: tuple = ()
    ordinary: int = 0
    blocks: tuple = ()

    @property
    def aside(self):
        """Mask (points,) of points that are not adjusted."""
        return _are_nonempty(self.set_aside)

    def name_of_point(self, point):
        """Name of a point."""
        return self.points[point]

    def relative(self, observations):
        """Convert observations from the frame of the survey to coordinates relative to the
        centre."""
        return observations.relative(self.centre_m)


def assemble(survey):
    """Assemble the Problem of a survey.

    Raises
    ------
    SolutionError
        If unknowns cannot be determined.
    """
    set_aside = _set_aside(survey)
    is_used = ~_are_nonempty(set_aside)
    centre = _centre(survey)
    table, values, interior_free, known = _interior(survey)
    groups, sources, rows_of, exact = _other_groups(survey, is_used, centre)
    eliminated = eliminated_points(survey, groups, is_used, exact)
    # A block may connect points, so none of its points is eliminated.
    for block in survey.correlated:
        for source in np.unique(block.source):
            group = survey.observations[source]
            for name in group.ties:
                eliminated[getattr(group, name)[block.row[block.source == source]]] = False
    layout, reduced = layout_of(survey, eliminated, is_used, interior_free, table)
    for group, rows in _image_groups(survey, is_used, layout, reduced, table):
        groups.append(group)
        sources.append(IMAGES)
        rows_of.append(rows)
    for group in known + _known_nuisances(survey):
        groups.append(group)
        sources.append("known beforehand")
        rows_of.append(np.arange(len(group)))
    # Observations and state use the same centre, which keeps rounding small.
    state = _state(survey, centre, values)
    ordinary, blocks = len(groups), []
    for group, members in correlated_groups(survey, is_used, centre, state):
        blocks.append((None if group is None else len(groups), members))
        if group is not None:
            groups.append(group)
            sources.append(CORRELATED)
            rows_of.append(np.zeros(1, dtype=int))
    # Derivatives must exist at the start values.
    _refuse_coincident(survey, groups, state)
    model = Model(
        reduced=reduced,
        blocks=int(np.count_nonzero(eliminated)),
        groups=_groups(groups, layout),
        moved=layout.moved,
        name_of=lambda column: name_of(survey, layout, table, column),
        describe_directions=partial(describe_directions, survey, layout, table),
        exact=_groups([held.conditions for held in exact], layout),
        name_of_exact=lambda row: name_of_exact(survey, exact, row),
    )
    return Problem(
        model, state, layout, tuple(groups), tuple(sources), tuple(rows_of),
        centre, set_aside, eliminated, table, exact, survey.points,
        () if survey.photos is None else survey.photos.names,
        ordinary, tuple(blocks),
    )  # fmt: skip


def _refuse_coincident(survey, groups, state):
    """Raise SolutionError if both ends of a sight start at the same place, where it has no
    derivatives."""
    for observations in groups:
        bad = observations.without_derivatives(state)
        if bad.any():
            raise SolutionError(
                message(
                    "ends_coincide",
                    "both ends of {observation} have the same approximate place: the "
                    "points have too few observations, or one point has two names",
                    observation=describe_observation(survey, observations, int(np.argmax(bad))),
                )
            )


def _groups(observations, layout):
    """Solver groups of observations."""
    return tuple(
        Group(item.columns(layout).astype(np.int32, copy=False), item.rows, item.fill, item.part)
        for item in observations
    )


def _set_aside(survey):
    """Reason for each point why it cannot be determined; empty if it can."""
    images = survey.image_points
    if images is not None:
        _refuse_poor_photos(survey)
    bad = survey.values_of_points() < FEWEST
    if not bad.any():
        return ("",) * len(bad)
    rays = np.zeros(len(bad), dtype=int)
    if images is not None:
        rays += np.bincount(images.of_used("point"), minlength=len(bad))
    names = zip(survey.points, rays.tolist(), bad, strict=True)
    return tuple(_poor(name, count) if is_bad else "" for name, count, is_bad in names)


def _are_nonempty(texts):
    """Mask (n,) of texts that are not empty."""
    if not any(texts):  # fast path for surveys of many points
        return np.zeros(len(texts), dtype=bool)
    return np.array([bool(text) for text in texts])


def _poor(name, rays):
    """Reason for a point with too few observations."""
    if rays == 1:
        return one_ray_sentence(name)
    return message("hardly_observed", "point {point} has too few observations", point=name)


def one_ray_sentence(name):
    """Sentence about a point shown by one image only."""
    return message("one_ray", "point {point} has only one ray", point=name)


def _refuse_poor_photos(survey):
    """Raise SolutionError if a photo has fewer observations than unknowns."""
    images, photos = survey.image_points, survey.photos
    rays = np.bincount(images.of_used("photo"), minlength=len(photos.names))
    count = 2 * rays
    for item in survey.observations:
        if hasattr(item, "photo"):
            count += item.rows * np.bincount(item.photo, minlength=len(count))
    if photos.fixed is not None:
        count += np.repeat(photos.fixed, (1, 1, 1, 3), axis=1).sum(axis=1)
    # A photo has six unknowns of exterior orientation.
    poor = (count < 6).nonzero()[0]
    if len(poor):
        photos_in_words = ", ".join(f"{photos.names[i]} ({rays[i]})" for i in poor)
        raise SolutionError(
            message(
                "photo_short_of_points",
                "a photo needs at least 3 image points: {photos}",
                photos=photos_in_words,
            )
        )


def _other_groups(survey, is_used, centre):
    """Collect observations other than image points, between adjusted points.

    Parameters
    ----------
    survey : Survey
    used : ndarray of bool, shape (points,)
    centre : ndarray, shape (3,)

    Returns
    -------
    groups : list of Observations
        Relative to the centre.
    sources : list of int
        Numbers in the survey.
    rows_of : list of ndarray
        Row numbers.
    exact : tuple of HeldObservations
        Observations that hold exactly.
    """
    groups, sources, rows_of, exact = [], [], [], []
    for number, table in enumerate(survey.observations):
        keep = np.ones(len(table), dtype=bool)
        for name in table.ties:
            keep &= is_used[getattr(table, name)]
        holds = table.exact
        # Exact observations become conditions of the solver; a weight 1/0 would be infinite.
        if holds.any() and (sharp := (keep & holds & table.in_use).nonzero()[0]).size:
            taken = table.taken(sharp).relative(centre)
            exact.append(HeldObservations(taken, *taken.conditions(), number, sharp))
            if holds.all():
                continue
        rows = (keep & ~holds & ~is_in_block(survey, number)).nonzero()[0]
        groups.append((table if len(rows) == len(table) else table.taken(rows)).relative(centre))
        sources.append(number)
        rows_of.append(rows)
    return groups, sources, rows_of, tuple(exact)


def _centre(survey):
    """Mean of the start coordinates, the origin of the adjustment."""
    known = np.isfinite(survey.xyz_m)
    if not known.all():
        missing = [survey.points[i] for i in np.flatnonzero(~known.all(axis=1))[:5]]
        raise SolutionError(
            message(
                "no_approximate_coordinates",
                "no approximate coordinates for {points}",
                points=missing,
            )
        )
    return survey.xyz_m.mean(axis=0)


def _interior(survey):
    """Interior parameters of the photos.

    Returns
    -------
    table : ndarray of int, shape (photos, 13)
        Index of each parameter in `values`.
    values : ndarray, shape (q + 1,)
        The last value is 0, for omitted parameters.
    free : ndarray of bool, shape (q + 1,)
        True for unknowns.
    observed : list of KnownUnknowns
        Weighted parameters.
    """
    photos = survey.photos
    if photos is None:
        return np.zeros((0, 13), dtype=int), np.zeros(1), np.zeros(1, dtype=bool), []
    table = np.full((len(photos.names), 13), -1)
    values, free, weighted, shared = [], [], [], {}
    for camera, settings in enumerate(survey.cameras):
        photos_of_camera = (photos.camera == camera).nonzero()[0]
        if not len(photos_of_camera):
            continue
        if settings.scope[0] == "off" or not settings.values[0] > 0:
            raise SolutionError(
                message(
                    "no_principal_distance",
                    "{camera} has no principal distance c",
                    camera=settings.name,
                )
            )
        numbers_of_scope = [
            [k for k in range(13) if settings.scope[k] == scope] for scope in SCOPES
        ]
        assignments = [
            (shared, photos_of_camera, numbers_of_scope[1]),
            ({}, photos_of_camera, numbers_of_scope[2]),
        ]
        assignments += (
            [({}, [photo], numbers_of_scope[3]) for photo in photos_of_camera]
            if numbers_of_scope[3]
            else []
        )
        for place, group, numbers in assignments:
            for k in numbers:
                if k not in place:
                    # A parameter shared by photos has one index; its place depends on the scope.
                    place[k] = len(values)
                    values.append(settings.values[k])
                    free.append(settings.state[k] != "fixed")
                    if settings.state[k] == "weighted":
                        weighted.append((place[k], values[-1], settings.sd[k]))
                table[group, k] = place[k]
    # Omitted parameters point to the last value, 0.
    table[table < 0] = len(values)
    observed = []
    if weighted:
        index, value, sd = np.array(weighted).T
        observed = [KnownUnknowns(value, sd, "interior", index.astype(int))]
    return table, np.array([*values, 0.0]), np.array([*free, False]), observed


def _known_nuisances(survey):
    """Observations of weighted scales and offsets of instruments."""
    observed = []
    for name, shared in survey.nuisances.items():
        index = (shared.sd > 0).nonzero()[0]
        if len(index):
            observed.append(KnownUnknowns(shared.value[index], shared.sd[index], name, index))
    return observed


def _image_groups(survey, is_used, layout, reduced, table):
    """Yield image coordinates by form of camera, those of eliminated points first and point by
    point.

    Within each part that is evaluated together, the image points of a photo are adjacent: their
    rows have the same columns, so that one product forms all their squares.
    """
    images = survey.image_points
    if images is None or not len(images):
        return
    if not (images.sd > 0).all():
        raise SolutionError(
            message(
                "image_coordinate_exact",
                "an image coordinate cannot hold exactly: its sd must be above zero",
            )
        )
    first = layout.points[:, 0]
    last = np.count_nonzero(first >= reduced)
    of_point = np.where(first < reduced, last, (first - reduced) // 3)
    key = of_point.astype(np.min_scalar_type(last)).take(images.point)  # small integers sort faster
    for form, order in survey.by_form(images):
        table_of_form = table[
            [survey.cameras[camera].form == form for camera in survey.photos.camera]
        ]
        if not is_used.all():
            order = order[is_used[images.point[order]]]
        of_order = key[order]
        if (of_order[1:] < of_order[:-1]).any():
            order = order[of_order.argsort(kind="stable")]
        eliminated = np.count_nonzero(key[order] < last)
        # Eliminated and reduced points must not share a part.
        part = np.minimum(np.arange(len(order)), eliminated) // PART
        part[eliminated:] += 1
        of_photo = part * len(survey.photos.names) + images.photo[order]
        of_photo = of_photo.astype(np.min_scalar_type(of_photo.max(initial=0)))
        order = order[of_photo.argsort(kind="stable")]
        active = (table_of_form < layout.interior.size - 1).any(axis=0).nonzero()[0]
        active = active[(layout.interior[table_of_form[:, active]] >= 0).any(axis=0)]
        yield images.taken(order, form=form, active=active, interior_of=table), order


def _state(survey, centre, values):
    """Start values of all unknowns, relative to the centre."""
    photos, systems = survey.photos, survey.systems
    values_of_state = {
        "nuisance": {name: shared.value for name, shared in survey.nuisances.items()}
    }
    if photos is not None:
        values_of_state |= {"photo_xyz_m": photos.xyz_m - centre, "rotation": photos.rotation}
    if systems:
        rotation = np.array([system.rotation for system in systems])
        scale = np.array([system.scale for system in systems])
        shift = np.array([system.shift_m for system in systems])
        # The shift of the centre enters the transformation: X_system = (1 + m) R (x + centre) +
        # shift.
        shift = shift + (1 + scale)[:, None] * (rotation @ centre)
        values_of_state |= {"system": rotation, "system_shift_m": shift, "system_scale": scale}
    return State(xyz_m=survey.xyz_m - centre, interior=values, **values_of_state)


# ---- columns and names of the unknowns


def eliminated_points(survey, others, is_used, exact):
    """Mask of points that may be eliminated: free, in no exact condition, no two in one row.

    Parameters
    ----------
    survey : Survey
    others : list of Observations
        All except image points.
    used : ndarray of bool, shape (points,)
    exact : tuple of Held

    Returns
    -------
    ndarray of bool, shape (points,)
    """
    eliminated = is_used.copy()
    for held in exact:
        for name in held.conditions.ties:
            eliminated[getattr(held.conditions, name)] = False
    if survey.fixed is not None:
        eliminated &= ~survey.fixed.any(axis=1)
    # Two eliminated points in one row would couple their blocks.
    neighbours = {}
    for group in others:
        if len(group.ties) > 1:
            for row in np.column_stack([getattr(group, name) for name in group.ties]).tolist():
                for point in row:
                    neighbours.setdefault(point, set()).update(row)
    selected = set()
    # Greedy independent set: taking points with few neighbours first leaves more points to
    # eliminate.
    for point in sorted(neighbours, key=lambda p: len(neighbours[p])):
        if eliminated[point] and neighbours[point] & selected:
            eliminated[point] = False
        if eliminated[point]:
            selected.add(point)
    return eliminated


def layout_of(survey, eliminated, is_used, interior_free, table):
    """The Layout, reduced unknowns first, and the number of reduced unknowns.

    Parameters
    ----------
    survey : Survey
    eliminated, used : ndarray of bool, shape (points,)
    interior_free : ndarray of bool, shape (q + 1,)
    table : ndarray of int, shape (photos, 13)
        See `assembly.Problem.interior_of`.
    """
    photos, points = survey.photos, len(survey.points)
    free_points = np.repeat(is_used[:, None], 3, axis=1)
    if survey.fixed is not None:
        free_points &= ~survey.fixed
    free_photos = np.ones((0 if photos is None else len(photos.names), 6), dtype=bool)
    if photos is not None and photos.fixed is not None:
        free_photos = ~np.repeat(photos.fixed, (1, 1, 1, 3), axis=1)
    free_system = np.ones((len(survey.systems), 7), dtype=bool)
    free_system[:, 6] = [system.scale_free for system in survey.systems]
    next_column = 0

    def columns(free):
        nonlocal next_column
        numbers = np.full(free.shape, -1)
        if not free.size:
            return numbers
        count = int(np.count_nonzero(free))
        numbers[free] = np.arange(next_column, next_column + count)
        next_column += count
        return numbers

    is_own = _single_photo_parameters(table, interior_free)
    is_of_one_photo = is_own.any(axis=0)
    interior = columns(interior_free & ~is_of_one_photo)
    # Parameters of a single photo stand beside the columns of its orientation.
    columns_of_photos = columns(np.concatenate([free_photos, is_own[:, is_of_one_photo]], axis=1))
    of_photos, interior[is_of_one_photo] = (
        columns_of_photos[:, :6],
        columns_of_photos[:, 6:].max(axis=0, initial=-1),
    )
    nuisance = {name: columns(shared.sd != 0) for name, shared in survey.nuisances.items()}
    system = columns(free_system)
    of_points = columns(free_points & ~eliminated[:, None])
    reduced = next_column
    last = eliminated.nonzero()[0]
    # Sort eliminated points so that points in the same photos are adjacent.
    if survey.image_points is not None:
        mark = 10.0 ** (-12 * np.arange(len(free_photos)) / max(len(free_photos) - 1, 1))
        photo_key = np.bincount(
            survey.image_points.point, weights=mark[survey.image_points.photo], minlength=points
        )
        last = last[photo_key[last].argsort(kind="stable")]
    of_points[last] = next_column + np.arange(3 * len(last)).reshape(-1, 3)
    return Layout(of_points, of_photos, interior, nuisance, system), reduced


def _single_photo_parameters(table, interior_free):
    """Mask (photos, q + 1) of free interior parameters used by one photo only."""
    mask = np.zeros((len(table), len(interior_free)), dtype=bool)
    mask[np.arange(len(table))[:, None], table] = True
    return mask & interior_free & (mask.sum(axis=0) == 1)


ELEMENTS = ("x", "y", "z", "omega", "phi", "kappa")


def name_of_exact(survey, exact, row):
    """Name of a row of the exact conditions, numbered consecutively."""
    for held in exact:
        count = len(held.conditions) * held.conditions.rows
        if row < count:
            return describe_observation(
                survey, held.observations, held.row_of[row // held.conditions.rows]
            )
        row -= count
    raise IndexError(row)


def describe_observation(survey, observations, row):
    """Name of an observation in messages: its kind and its points."""
    ends = [name for name in ("origin", "start", "end", "point") if name in observations.ties]
    names = [survey.points[getattr(observations, name)[row]] for name in ends]
    if hasattr(observations, "photo"):
        names.insert(0, survey.photos.names[observations.photo[row]])
    text = f"{observations.kind} {' - '.join(names)}".rstrip()
    if hasattr(observations, "element"):
        return f"{text} {ELEMENTS[observations.element[row]]}"
    return f"{text} {'xyz'[observations.axis[row]]}" if hasattr(observations, "axis") else text


def name_of(survey, layout, table, column):
    """Name of the unknown in a column."""
    for row, axis in np.argwhere(layout.points == column):
        return f"{'xyz'[axis]} of point {survey.points[row]}"
    for row, element in np.argwhere(layout.photos == column):
        what = ("x", "y", "z", "rotation 1", "rotation 2", "rotation 3")[element]
        return f"{what} of photo {survey.photos.names[row]}"
    for place in np.flatnonzero(layout.interior == column):
        photo, number = np.argwhere(table == place)[0]
        camera = survey.cameras[survey.photos.camera[photo]].name
        return f"{PARAMETERS[number]} of {camera}"
    for kind, columns in layout.nuisance.items():
        for place in np.flatnonzero(columns == column):
            return f"{NUISANCES[kind].element} of {survey.nuisances[kind].owners[place]}"
    system = np.argwhere(layout.system == column)[0, 0]
    return f"transformation of system {survey.systems[system].name}"


# share of the largest component of a direction, below which an unknown does not belong to it
SHARE = 0.1
LISTED = 3  # parts listed in a sentence; more of a kind are counted
NAMED = 5  # names listed


def describe_directions(survey, layout, table, directions):
    """Describe the unknowns in undetermined directions (unknowns, d)."""
    size = np.append(np.sqrt(np.sum(directions**2, axis=1)), 0.0)
    # Small components of a singular vector are rounding, not participation.
    size[size < SHARE * size.max()] = 0.0
    parts, is_listed = [], np.zeros(len(size), dtype=bool)
    photos = () if survey.photos is None else survey.photos.names
    for what, noun, names, columns in (
        ("position", "photo", photos, layout.photos[:, :3]),
        ("rotation", "photo", photos, layout.photos[:, 3:]),
        ("place", "point", survey.points, layout.points),
    ):
        who = np.flatnonzero(size[columns].max(axis=1, initial=0.0) > 0) if len(names) else []
        is_listed[columns.ravel()] = True
        if len(who) > LISTED:
            parts.append(f"the {what}s of {_many(names, who, noun)}")
        else:
            parts += [f"the {what} of {noun} {names[i]}" for i in who]
    other_columns = np.flatnonzero((size[:-1] > 0) & ~is_listed[:-1])
    parts = (
        list(dict.fromkeys(name_of(survey, layout, table, column) for column in other_columns))
        + parts
    )
    if len(parts) == 1:
        return parts[0]
    told_of = f"{', '.join(parts[:-1])} and {parts[-1]} cannot be told apart"
    return told_of + (
        f"; fix {parts[0]} or give it a standard deviation" if len(other_columns) else ""
    )


def _many(names, who, noun):
    """Some of the photos or points in words: all, or their number and some names."""
    if len(who) == len(names):
        return f"all {noun}s"
    which = list_some([names[i] for i in who], NAMED)
    return fill_template(
        "{count} {what}s ({which})", {"count": len(who), "what": noun, "which": which}
    )
