"""The unknowns of an adjustment: in which column each stands, and what the user calls it."""

import numpy as np

from tankcal.camera.model import PARAMETERS
from tankcal.messages import fill_template, list_some
from tankcal.survey.observations import NUISANCES, Layout


def eliminated_points(survey, others, used, exact):
    """Points that may be eliminated: free, in no exact condition, no two of them in one row."""
    eliminated = used.copy()
    for held in exact:
        for name in held.conditions.ties:
            eliminated[getattr(held.conditions, name)] = False
    if survey.fixed is not None:
        eliminated &= ~survey.fixed.any(axis=1)
    neighbours = {}
    for one in others:
        if len(one.ties) > 1:
            for row in np.column_stack([getattr(one, name) for name in one.ties]).tolist():
                for point in row:
                    neighbours.setdefault(point, set()).update(row)
    done = set()
    for point in sorted(neighbours, key=lambda p: len(neighbours[p])):
        if eliminated[point] and neighbours[point] & done:
            eliminated[point] = False
        if eliminated[point]:
            done.add(point)
    return eliminated


def layout_of(survey, eliminated, used, interior_free, table):
    """The Layout, reduced unknowns first, and how many of these there are."""
    photos, points = survey.photos, len(survey.points)
    free_points = np.repeat(used[:, None], 3, axis=1)
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
        found = np.full(free.shape, -1)
        if not free.size:
            return found
        count = int(np.count_nonzero(free))
        found[free] = np.arange(next_column, next_column + count)
        next_column += count
        return found

    own = _of_one_photo(table, interior_free)
    mine = own.any(axis=0)
    interior = columns(interior_free & ~mine)
    both = columns(np.concatenate([free_photos, own[:, mine]], axis=1))  # each photo's own together
    of_photos, interior[mine] = both[:, :6], both[:, 6:].max(axis=0, initial=-1)
    nuisance = {of: columns(one.sd != 0) for of, one in survey.nuisances.items()}
    system = columns(free_system)
    of_points = columns(free_points & ~eliminated[:, None])
    reduced = next_column
    last = eliminated.nonzero()[0]
    if survey.image_points is not None:  # points in the same photos, or nearly, next to one another
        mark = 10.0 ** (-12 * np.arange(len(free_photos)) / max(len(free_photos) - 1, 1))
        seen = np.bincount(
            survey.image_points.point, weights=mark[survey.image_points.photo], minlength=points
        )
        last = last[seen[last].argsort(kind="stable")]
    of_points[last] = next_column + np.arange(3 * len(last)).reshape(-1, 3)
    return Layout(of_points, of_photos, interior, nuisance, system), reduced


def _of_one_photo(table, interior_free):
    """(photos, q + 1) True where a free interior parameter is that of one photo only."""
    own = np.zeros((len(table), len(interior_free)), dtype=bool)
    own[np.arange(len(table))[:, None], table] = True
    return own & interior_free & (own.sum(axis=0) == 1)


ELEMENTS = ("x", "y", "z", "omega", "phi", "kappa")


def name_of_exact(survey, exact, row):
    """What the user calls a row of the exact conditions, all of them counted through."""
    for held in exact:
        count = len(held.conditions) * held.conditions.rows
        if row < count:
            return told(survey, held.observations, held.row_of[row // held.conditions.rows])
        row -= count
    raise IndexError(row)


def told(survey, one, row):
    """What the user calls an observation: its kind and what it ties together."""
    ends = [name for name in ("origin", "start", "end", "point") if name in one.ties]
    names = [survey.points[getattr(one, name)[row]] for name in ends]
    if hasattr(one, "photo"):
        names.insert(0, survey.photos.names[one.photo[row]])
    text = f"{one.kind} {' - '.join(names)}".rstrip()
    if hasattr(one, "element"):
        return f"{text} {ELEMENTS[one.element[row]]}"
    return f"{text} {'xyz'[one.axis[row]]}" if hasattr(one, "axis") else text


def name_of(survey, layout, table, column):
    """What the user calls the unknown in a column."""
    for row, axis in np.argwhere(layout.points == column):
        return f"{'xyz'[axis]} of point {survey.points[row]}"
    for row, element in np.argwhere(layout.photos == column):
        what = ("x", "y", "z", "rotation 1", "rotation 2", "rotation 3")[element]
        return f"{what} of photo {survey.photos.names[row]}"
    for place in np.flatnonzero(layout.interior == column):
        photo, number = np.argwhere(table == place)[0]
        camera = survey.cameras[survey.photos.camera[photo]].name
        return f"{PARAMETERS[number]} of {camera}"
    for of, columns in layout.nuisance.items():
        for place in np.flatnonzero(columns == column):
            return f"{NUISANCES[of].element} of {survey.nuisances[of].owners[place]}"
    system = np.argwhere(layout.system == column)[0, 0]
    return f"transformation of system {survey.systems[system].name}"


SHARE = 0.1  # of the largest part of a direction: below it an unknown does not take part
LISTED = 3  # parts in a sentence; more of a kind are one, with their number
NAMED = 5  # names in it


def in_words(survey, layout, table, directions):
    """The unknowns that take part in directions (unknowns, d) that nothing determines, in words."""
    size = np.append(np.sqrt(np.sum(directions**2, axis=1)), 0.0)
    size[size < SHARE * size.max()] = 0.0
    parts, told_already = [], np.zeros(len(size), dtype=bool)
    photos = () if survey.photos is None else survey.photos.names
    for what, one, names, columns in (
        ("position", "photo", photos, layout.photos[:, :3]),
        ("rotation", "photo", photos, layout.photos[:, 3:]),
        ("place", "point", survey.points, layout.points),
    ):
        who = np.flatnonzero(size[columns].max(axis=1, initial=0.0) > 0) if len(names) else []
        told_already[columns.ravel()] = True
        if len(who) > LISTED:
            parts.append(f"the {what}s of {_many(names, who, one)}")
        else:
            parts += [f"the {what} of {one} {names[i]}" for i in who]
    others = np.flatnonzero((size[:-1] > 0) & ~told_already[:-1])
    parts = list(dict.fromkeys(name_of(survey, layout, table, column) for column in others)) + parts
    if len(parts) == 1:
        return parts[0]
    told_of = f"{', '.join(parts[:-1])} and {parts[-1]} cannot be told apart"
    return told_of + (f"; fix {parts[0]} or give it a standard deviation" if len(others) else "")


def _many(names, who, one):
    """Some of the photos or points, `who` their numbers: all of them, or how many and which."""
    if len(who) == len(names):
        return f"all {one}s"
    which = list_some([names[i] for i in who], NAMED)
    return fill_template(
        "{count} {what}s ({which})", {"count": len(who), "what": one, "which": which}
    )
