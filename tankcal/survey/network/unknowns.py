"""Unknowns of an adjustment: their columns and their names in messages."""

import numpy as np

from tankcal.camera.model import PARAMETERS
from tankcal.messages import fill_template, list_some
from tankcal.survey.observations import NUISANCES, Layout


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
            return told(survey, held.observations, held.row_of[row // held.conditions.rows])
        row -= count
    raise IndexError(row)


def told(survey, observations, row):
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
