"""The seven ways in which a whole survey can move, and which of them nothing observes.

Translations, rotations about the axes through the centre, and scale move points, projection
centres, directions of circles and further systems together, so that no image, angle or ratio of
distances changes. Source: Koch 1999, Parameter Estimation and Hypothesis Testing, section 3.3;
Meissl 1969.
"""

from dataclasses import replace

import numpy as np

WAYS = ("x", "y", "z", "about X", "about Y", "about Z", "scale")
UNFELT = 1e-8  # change of the whitened rows, with all columns scaled to length one
DEPENDS, TINY = 1e-6, 1e-12  # change of a quantity over the sum of its parts' changes; m or rad
AS_IF_FIXED = 1e4  # weight of a fixed unknown among the rows, as if it were known to 0.1 mm


def directions(layout, state):
    """The seven directions (unknowns, 7) at a state; fixed unknowns are left out."""
    whole = np.zeros((unknowns(layout) + 1, 7))
    for columns, derivative in _parts(layout, state):
        whole[columns.ravel()] = derivative.reshape(-1, 7)
    return whole[:-1]


def unknowns(layout):
    """Number of unknowns of a layout."""
    return 1 + max((columns.max(initial=-1) for columns in vars(layout).values()), default=-1)


def _parts(layout, state):
    """Columns (...) of each kind of unknown with their derivatives (..., 7)."""
    yield from zip((getattr(layout, name) for name in _NAMES), _derivatives(state), strict=True)


_NAMES = ("points", "photos", "orientation", "scale", "system")


def _derivatives(state):
    """Derivatives (..., 7) of the unknowns of _NAMES by the seven ways."""
    n = len(state.photo_xyz_m)
    photos = np.zeros((n, 6, 7))
    if n:
        photos[:, :3] = _of_places(state.photo_xyz_m)
        photos[:, 3:, 3:6] = -state.rotation
    turn = np.zeros((len(state.orientation_rad), 7))
    turn[:, 5] = -1.0
    stretch = np.zeros((len(state.scale), 7))
    stretch[:, 6] = -(1.0 + state.scale)
    systems = np.zeros((len(state.system), 7, 7))
    if len(systems):
        m = 1.0 + state.system_scale
        systems[:, :3, 3:6] = -state.system
        systems[:, 3:6, :3] = -m[:, None, None] * state.system
        systems[:, 6, 6] = -m
    return _of_places(state.xyz_m), photos, turn, stretch, systems


def _of_places(xyz):
    """Derivatives (n, 3, 7) of places by the seven ways."""
    x, y, z = xyz.T
    out = np.zeros((len(xyz), 3, 7))
    out[:, :, :3] = np.eye(3)
    out[:, 0, 4], out[:, 0, 5] = z, -y
    out[:, 1, 3], out[:, 1, 5] = -z, x
    out[:, 2, 3], out[:, 2, 4] = y, -x
    out[:, :, 6] = xyz
    return out


def unobserved(problem, unfelt=UNFELT, fixed=True):
    """Combinations (7, d) of the seven ways that neither observations nor fixed unknowns feel.

    unfelt  see UNFELT      fixed  False: as if only observations held anything
    """
    layout, state = problem.layout, problem.state
    idle = _idle(problem)
    whole = np.vstack([directions(layout, state), np.zeros(7)])
    felt, lengths = [np.zeros((1, 7))], np.zeros(len(whole))
    for one, weight in _feeling(problem):
        columns = one.columns(layout)
        w = np.empty((len(one), one.rows))
        jac = np.empty((len(one), one.rows, columns.shape[1]))
        undisturbed = one.undisturbed(state)
        one.fill(undisturbed, w, jac)
        jac *= weight
        ways = whole
        if undisturbed is not state:
            ways = np.vstack([directions(layout, undisturbed), np.zeros(7)])
        moved = np.einsum("nmk,nkd->nmd", jac, ways[columns]).reshape(-1, 7)
        felt.append(np.linalg.qr(moved, mode="r"))
        np.add.at(lengths, columns, np.einsum("nmk,nmk->nk", jac, jac))
    square = (whole[:-1] ** 2).T @ lengths[:-1]
    for columns, derivative in _parts(layout, state):
        holds = (columns < 0) & np.logical_not(idle.get(id(columns), False))
        sharp = AS_IF_FIXED * derivative[holds].reshape(-1, 7)
        if fixed and len(sharp):
            felt.append(np.linalg.qr(sharp, mode="r"))
            square += np.sum(sharp**2, axis=0)
    moving = (square > 0) | whole.any(axis=0)  # heights at one place know no turn about Z
    size = np.sqrt(np.where(square > 0, square, 1.0))[moving]
    _, singular, vectors = np.linalg.svd(np.vstack(felt)[:, moving] / size)
    rank = int(np.sum(singular > unfelt))
    free = np.zeros((7, len(size) - rank))
    free[moving] = (vectors[rank:] / size).T
    return free


def _feeling(problem):
    """Observations that may feel the datum, each with what its rows are multiplied by."""
    yield from ((one, 1.0) for one in problem.observations if one.feels_datum)
    yield from ((held.conditions, AS_IF_FIXED) for held in problem.exact)


def _idle(problem):
    """{id of columns: mask} of the unknowns that have no column because nobody observed them."""
    layout = problem.layout
    aside = np.array([bool(why) for why in problem.set_aside], dtype=bool)
    unused = np.ones(len(layout.scale), dtype=bool)
    for one, _ in _feeling(problem):
        instrument = getattr(one, "instrument", np.zeros(0, dtype=int))
        unused[instrument[instrument >= 0]] = False
    return {id(layout.points): aside[:, None], id(layout.scale): unused}


def dependent(adjusted, quantities, fixed=False):
    """Which quantities depend on the choice of the datum: (n,) True for those that do.

    A quantity depends on it when a motion or scaling of the whole survey that no observation feels
    would change it. Distances do when nothing gives the scale, heights and coordinates nearly
    always, shapes never.

    quantities  observations of tankcal.observations between points of the survey; values and sds
                do not matter
    fixed       True: coordinates and photos held fixed count as known, not as a choice
    """
    problem, state = adjusted.problem, adjusted.solution.state
    free = unobserved(problem, fixed=fixed)
    if not free.shape[1]:
        return np.zeros(len(quantities), dtype=bool)
    first, parts, whole = 0, {}, []
    for name, derivative in zip(_NAMES, _derivatives(state), strict=True):
        count = int(np.prod(derivative.shape[:-1]))
        parts[name] = first + np.arange(count).reshape(derivative.shape[:-1])
        whole.append(derivative.reshape(count, 7))
        first += count
    one = problem.relative(quantities)
    interior, offset = problem.layout.interior, problem.layout.offset
    layout = replace(
        problem.layout,
        **parts,
        interior=np.full_like(interior, -1),
        offset=np.full_like(offset, -1),
    )
    ways = np.vstack([*whole, np.zeros((1, 7))]) @ free
    _, derivatives = one.computed(state, True)
    columns = one.columns(layout)
    change = np.einsum("nmk,nkd->nmd", derivatives, ways[columns])
    size = np.einsum("nmk,nkd->nmd", np.abs(derivatives), np.abs(ways[columns]))
    return (np.abs(change) > DEPENDS * np.maximum(size, TINY)).any(axis=(1, 2))


def in_words(combinations, problem=None):
    """The datum defect in words, from combinations (7, d) of the seven ways.

    problem  to name the points that a single rotation leaves in place, or None
    """
    d = combinations.shape[1]
    basis = np.linalg.qr(combinations)[0]
    share = np.sum(basis**2, axis=1)
    pure = [i for i in range(7) if share[i] > 1 - 1e-6]
    parts = []
    shifts = [WAYS[i] for i in pure if i < 3]
    turns = [WAYS[i] for i in pure if 3 <= i < 6]
    if len(shifts) == 3:
        parts.append("three translations")
    elif shifts:
        parts.append("the translation" + "s" * (len(shifts) > 1) + " in " + " and ".join(shifts))
    if len(turns) == 3:
        parts.append("three rotations")
    elif turns:
        parts.append("the rotation" + "s" * (len(turns) > 1) + " " + " and ".join(turns))
    if 6 in pure:
        parts.append("the scale")
    if len(pure) < d:
        rest = d - len(pure)
        mixed = [WAYS[i] for i in range(7) if 1e-6 < share[i] <= 1 - 1e-6]
        about = "" if problem is None else _about_what_stays(combinations, problem)
        parts.append(about or f"{rest} combination{'s' * (rest > 1)} of {', '.join(mixed)}")
    listed = parts[0] if len(parts) == 1 else ", ".join(parts[:-1]) + " and " + parts[-1]
    verb = "is" if d == 1 else "are"
    return (
        f"datum defect {d}: {listed} {verb} not determined by any observation; "
        "add control or choose datum = inner"
    )


def _about_what_stays(combinations, problem):
    """Words on turning and stretching about what keeps its place, "" when nothing does."""
    turns, stretches = (
        np.linalg.matrix_rank(combinations[rows], tol=1e-6 * np.abs(combinations[rows]).max())
        if np.abs(combinations[rows]).max() > 1e-9 * np.abs(combinations).max()
        else 0
        for rows in (slice(3, 6), slice(6, 7))
    )
    if turns + stretches != combinations.shape[1]:
        return ""
    still, count = _staying(combinations, problem)
    if not count:
        return ""
    if turns == 1 and not stretches and count > 1:
        return f"the rotation about the line through {still}"
    what = ["", "the rotation", "two rotations", "three rotations"][turns]
    both = " and ".join(filter(None, [what, "the scale" * stretches]))
    return f"{both} about {still}"


def _staying(combinations, problem):
    """Names of the points and photos that no combination (7, d) moves, in words, and how many."""
    used = ~_idle(problem)[id(problem.layout.points)][:, 0]
    xyz = np.vstack([problem.state.xyz_m[used], problem.state.photo_xyz_m])
    size = np.linalg.norm(_of_places(xyz) @ combinations, axis=(1, 2))
    points = np.flatnonzero(used)
    still = np.flatnonzero(size < 1e-3 * size.max())
    found = [
        _plural("point", [problem.name_of_point(int(points[i])) for i in still if i < len(points)]),
        _plural("photo", [problem.photos[i - len(points)] for i in still if i >= len(points)]),
    ]
    return " and ".join(filter(None, found)), len(still)


def _plural(what, names):
    return f"{what}{'s' * (len(names) > 1)} {', '.join(names[:4])}" if names else ""


def held(problem, over, combinations, photo=None):
    """The Problem with a datum by inner constraints over chosen points, or over one photo.

    over          (k,) points that take part, or None: all
    combinations  (7, d) from `unobserved`
    photo         number of the photo that is moved and turned as little as can be, in place of the
                  points; None: the points take part
    """
    layout, mask = problem.layout, np.zeros(problem.model.unknowns + 1)
    if photo is None:
        members = slice(None) if over is None else np.asarray(over)
        mask[layout.points[members].ravel()] = 1.0
    else:
        mask[layout.photos[photo]] = 1.0

    def free(state):
        return directions(layout, state) @ combinations

    return replace(problem, model=replace(problem.model, free=free, inner=mask[:-1]))
