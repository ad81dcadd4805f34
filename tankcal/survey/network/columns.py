"""In which column of the adjustment each unknown stands; which points can be eliminated."""

import numpy as np

from tankcal.survey.observations import Layout


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
    tools = survey.instruments
    free_scale = np.array([tool.scale_sd != 0 for tool in tools], dtype=bool)
    free_offset = np.array([tool.offset_sd_m != 0 for tool in tools], dtype=bool)
    free_system = np.ones((len(survey.systems), 7), dtype=bool)
    free_system[:, 6] = [system.scale_free for system in survey.systems]
    next_column = 0

    def columns(free):
        nonlocal next_column
        found = np.full(free.shape, -1)
        count = int(np.count_nonzero(free))
        found[free] = np.arange(next_column, next_column + count)
        next_column += count
        return found

    own = _of_one_photo(table, interior_free)
    interior = columns(interior_free & ~own.any(axis=0))
    both = columns(np.hstack([free_photos, own[:, own.any(axis=0)]]))  # each photo's own together
    of_photos, interior[own.any(axis=0)] = both[:, :6], both[:, 6:].max(axis=0, initial=-1)
    scale, offset, system = (columns(free) for free in (free_scale, free_offset, free_system))
    orientation = columns(np.ones(len(survey.sets), dtype=bool))
    of_points = columns(free_points & ~eliminated[:, None])
    reduced = next_column
    last = np.flatnonzero(eliminated)
    if survey.image_points is not None:  # points in the same photos next to one another
        mark = np.random.default_rng(0).random(len(free_photos))
        seen = np.bincount(
            survey.image_points.point, weights=mark[survey.image_points.photo], minlength=points
        )
        last = last[np.argsort(seen[last], kind="stable")]
    of_points[last] = next_column + np.arange(3 * len(last)).reshape(-1, 3)
    return Layout(of_points, of_photos, interior, orientation, scale, offset, system), reduced


def _of_one_photo(table, interior_free):
    """(photos, q + 1) True where a free interior parameter is that of one photo only."""
    own = np.zeros((len(table), len(interior_free)), dtype=bool)
    own[np.arange(len(table))[:, None], table] = True
    return own & interior_free & (own.sum(axis=0) == 1)
