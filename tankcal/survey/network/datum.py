"""Datum of a survey: its free motions, its choice, and the coordinates that hold the frame.

There are seven motions: six rigid motions and scale. Translations, rotations about the axes through
the centre, and scale move points, projection centres, circle orientations and further systems
together. No image, angle or ratio of distances changes. Motions that no observation determines are
the defect of the datum. Source: Koch 1999, Parameter Estimation and Hypothesis Testing, section
3.3; Meissl 1969.
"""

from dataclasses import dataclass, field, replace

import numpy as np
import scipy.linalg

from tankcal.errors import InputError, Problem, SolutionError
from tankcal.messages import join_with_and, list_some, message
from tankcal.survey.network.assembly import assemble
from tankcal.survey.observations import ControlCoordinates
from tankcal.survey.observations.base import NUISANCES
from tankcal.survey.results import DatumReport

SHIFTS, TURNS = ("x", "y", "z"), ("X", "Y", "Z")
THREE_TURNS = message("rotations", "three rotations")
SCALE = message("scale", "the scale")
# largest change of the whitened rows by an undetermined motion, columns scaled to length one
UNFELT = 1e-8
# relative change of a quantity that depends on the datum; smallest change, m or rad
DEPENDS, TINY = 1e-6, 1e-12
NAMED = 4  # points and photos listed in a sentence
AS_IF_FIXED = 1e4  # weight of a fixed unknown as a row: as if known to 0.1 mm


def directions(layout, state):
    """The seven directions (unknowns, 7) at a state; fixed unknowns are omitted."""
    return _together(layout, _datum_derivatives(layout, state))[:-1]


def _together(layout, parts):
    """Directions (unknowns + 1, 7) from parts, with a final row of zeros for fixed unknowns."""
    whole = np.zeros((layout.unknowns + 1, 7))
    for columns, derivative in parts:
        whole[columns.ravel()] = derivative.reshape(-1, 7)
    whole[-1] = 0.0
    return whole


def _datum_derivatives(layout, state):
    """Yield columns (...) of each kind of unknown with their derivatives (..., 7)."""
    derivatives = _derivatives(state)
    for name in ("points", "photos"):
        yield getattr(layout, name), derivatives[name]
    for of in state.nuisance:
        yield layout.nuisance[of], derivatives[of]
    yield layout.system, derivatives["system"]


def _derivatives(state):
    """{name: derivatives (..., 7)} of the unknowns by the seven motions."""
    n = len(state.photo_xyz_m)
    photos = np.zeros((n, 6, 7))
    if n:
        photos[:, :3] = motion_derivatives(state.photo_xyz_m)
        # Photo rotations turn with the frame; the sign follows from the small rotation acting on
        # the left.
        photos[:, 3:, 3:6] = -state.rotation
    systems = np.zeros((len(state.system), 7, 7))
    if len(systems):
        m = 1.0 + state.system_scale
        systems[:, :3, 3:6] = -state.system
        systems[:, 3:6, :3] = -m[:, None, None] * state.system
        systems[:, 6, 6] = -m
    shared = {name: NUISANCES[name].ways(value) for name, value in state.nuisance.items()}
    return {
        "points": motion_derivatives(state.xyz_m),
        "photos": photos,
        **shared,
        "system": systems,
    }


def motion_derivatives(xyz):
    """Derivatives (n, 3, 7) of positions by translation, small rotation and scale."""
    x, y, z = xyz.T
    out = np.zeros((len(xyz), 3, 7))
    out[:, :, :3] = np.eye(3)
    out[:, 0, 4], out[:, 0, 5] = z, -y
    out[:, 1, 3], out[:, 1, 5] = -z, x
    out[:, 2, 3], out[:, 2, 4] = y, -x
    out[:, :, 6] = xyz
    return out


def null_space(problem, unfelt=UNFELT, fixed=True, state=None, count=None):
    """Combinations (7, d) of the seven motions that neither observations nor fixed unknowns
    determine.

    Parameters
    ----------
    problem : Problem
    unfelt : float
        See UNFELT.
    fixed : bool
        False: fixed unknowns do not count.
    state : State, optional
        Point of linearization; default: the start values.
    count : int, optional
        Value of d; default: all combinations below `unfelt`.

    Returns
    -------
    ndarray, shape (7, d)
    """
    layout, state = problem.layout, problem.state if state is None else state
    idle = _idle(problem)
    parts = [*_datum_derivatives(layout, state)]
    whole = _together(layout, parts)
    felt, lengths = [np.zeros((1, 7))], np.zeros(len(whole))
    for observations, weight in _feeling(problem):
        columns = observations.columns(layout)
        w = np.empty((len(observations), observations.rows))
        jac = np.empty((len(observations), observations.rows, columns.shape[1]))
        undisturbed = observations.undisturbed(state)
        observations.fill(undisturbed, w, jac)
        jac *= weight
        ways = whole
        if undisturbed is not state:
            ways = _together(layout, _datum_derivatives(layout, undisturbed))
        moved = np.einsum("nmk,nkd->nmd", jac, ways[columns]).reshape(-1, 7)
        # The triangular factor keeps the singular values of the rows, at size 7 x 7.
        felt.append(np.linalg.qr(moved, mode="r"))
        np.add.at(lengths, columns, np.einsum("nmk,nmk->nk", jac, jac))
    square = np.einsum("ud,ud,u->d", whole, whole, lengths)
    for columns, derivative in parts:
        holds = (columns < 0) & np.logical_not(idle.get(id(columns), False))
        # A fixed unknown resists a motion like a very accurate observation.
        sharp = AS_IF_FIXED * derivative[holds].reshape(-1, 7)
        if fixed and sharp.any():
            felt.append(np.linalg.qr(sharp, mode="r"))
            square += np.sum(sharp**2, axis=0)
    moving = (square > 0) | whole.any(axis=0)  # heights alone do not define the azimuth
    # Scaling makes translations, rotations and scale comparable.
    size = np.sqrt(np.where(square > 0, square, 1.0))[moving]
    _, singular, vectors = np.linalg.svd(np.vstack(felt)[:, moving] / size)
    rank = len(size) - count if count is not None else int(np.sum(singular > unfelt))
    free = np.zeros((7, len(size) - rank))
    free[moving] = (vectors[rank:] / size).T
    return free


def _feeling(problem):
    """Yield observations that may determine the datum, with the factor of their rows."""
    yield from ((group, 1.0) for group in problem.observations if group.feels_datum)
    yield from ((held.conditions, AS_IF_FIXED) for held in problem.exact)


def _idle(problem):
    """{id of columns: mask} of the unknowns without a column because they were not observed."""
    layout = problem.layout
    unused = {name: np.ones(len(columns), dtype=bool) for name, columns in layout.nuisance.items()}
    for observations, _ in _feeling(problem):
        for name, numbers in observations.nuisances:
            number = getattr(observations, numbers)
            unused[name][number[number >= 0]] = False
    idle = {id(layout.nuisance[name]): rows for name, rows in unused.items()}
    return {id(layout.points): problem.aside[:, None], **idle}


def depends_on_datum(adjusted, quantities, fixed=False):
    """Determine which quantities depend on the choice of the datum.

    A quantity depends on it if an undetermined motion or scaling of the survey changes the
    quantity. Distances depend on it without an observed scale, heights and coordinates nearly
    always, shapes never.

    Parameters
    ----------
    adjusted : Adjusted
    quantities : Observations
        Between points of the survey; values and sds do not matter.
    fixed : bool
        True: fixed coordinates and photos count as known, not as a choice.

    Returns
    -------
    ndarray of bool, shape (n,)
    """
    problem, state = adjusted.problem, adjusted.solution.unknowns
    free = null_space(problem, fixed=fixed)
    if not free.shape[1]:
        return np.zeros(len(quantities), dtype=bool)
    first, parts, whole = 0, {}, []
    for name, derivative in _derivatives(state).items():
        count = int(np.prod(derivative.shape[:-1]))
        parts[name] = first + np.arange(count).reshape(derivative.shape[:-1])
        whole.append(derivative.reshape(count, 7))
        first += count
    relative_quantities = problem.relative(quantities)
    nuisance = {of: parts.pop(of) for of in state.nuisance}
    interior = np.full_like(problem.layout.interior, -1)
    layout = replace(problem.layout, **parts, nuisance=nuisance, interior=interior)
    ways = np.vstack([*whole, np.zeros((1, 7))]) @ free
    _, derivatives = relative_quantities.computed(state, True)
    columns = relative_quantities.columns(layout)
    # A change far below the sum of its parts is rounding.
    change = np.einsum("nmk,nkd->nmd", derivatives, ways[columns])
    size = np.einsum("nmk,nkd->nmd", np.abs(derivatives), np.abs(ways[columns]))
    return (np.abs(change) > DEPENDS * np.maximum(size, TINY)).any(axis=(1, 2))


def datum_defect_sentence(combinations, problem=None):
    """Sentence with the datum defect and a remedy; see `defect_in_words`."""
    defect = defect_in_words(combinations, problem)
    return message(
        "defect_and_help", "{defect}; add control or choose datum = inner", defect=defect
    )


def defect_in_words(combinations, problem=None):
    """Describe a datum defect in words.

    Parameters
    ----------
    combinations : ndarray, shape (7, d)
    problem : Problem, optional
        Supplies the names of points that a single rotation leaves in place.

    Returns
    -------
    Message
    """
    d = combinations.shape[1]
    basis = np.linalg.qr(combinations)[0]
    share = np.sum(basis**2, axis=1)
    # Rows of an orthonormal basis show the share of each motion in the null space.
    pure = [i for i in range(7) if share[i] > 1 - 1e-6]
    parts = _ways(pure)
    if len(pure) < d:
        mixed = [i for i in range(7) if 1e-6 < share[i] <= 1 - 1e-6]
        about = None if problem is None else _fixed_place_sentence(combinations, problem)
        parts.append(about or _mixture(d - len(pure), _ways(mixed)))
    if d == 1:
        single = "datum defect 1: {what} is not determined by any observation"
        return message("datum_defect_one", single, what=join_with_and(parts))
    several = "datum defect {defect}: {what} are not determined by any observation"
    return message("datum_defect", several, defect=d, what=join_with_and(parts))


def _ways(numbers):
    """Names of some of the seven motions; three of a kind are named together."""
    shifts = [SHIFTS[i] for i in numbers if i < 3]
    turns = [TURNS[i - 3] for i in numbers if 3 <= i < 6]
    names = [
        message("translation", "the translation in {axis}", axis=axis_name) for axis_name in shifts
    ]
    if len(shifts) == 3:
        names = [message("translations", "three translations")]
    if len(turns) == 3:
        names.append(THREE_TURNS)
    else:
        names += [
            message("rotation", "the rotation about {axis}", axis=axis_name) for axis_name in turns
        ]
    return names + [SCALE] * (6 in numbers)


def _mixture(count, ways):
    """A combination of motions, in words."""
    if count == 1:
        return message("combination", "a combination of {ways}", ways=ways)
    return message("combinations", "{count} combinations of {ways}", count=count, ways=ways)


def _fixed_place_sentence(combinations, problem):
    """Rotations and scale about fixed positions, in words; None if no position stays."""
    turns, stretches = (
        np.linalg.matrix_rank(combinations[rows], tol=1e-6 * np.abs(combinations[rows]).max())
        if np.abs(combinations[rows]).max() > 1e-9 * np.abs(combinations).max()
        else 0
        for rows in (slice(3, 6), slice(6, 7))
    )
    if turns + stretches != combinations.shape[1]:
        return None
    still, count = _staying(combinations, problem)
    if not count:
        return None
    if turns == 1 and not stretches and count > 1:
        return message("about_line", "the rotation about the line through {still}", still=still)
    what = {
        1: [message("one_rotation", "the rotation")],
        2: [message("two_rotations", "two rotations")],
        3: [THREE_TURNS],
    }.get(turns, [])
    what += [SCALE] * stretches
    return message("about_place", "{what} about {still}", what=join_with_and(what), still=still)


def _staying(combinations, problem):
    """Points and photos that no combination (7, d) moves, in words, and their number."""
    is_used = ~_idle(problem)[id(problem.layout.points)][:, 0]
    xyz = np.vstack([problem.state.xyz_m[is_used], problem.state.photo_xyz_m])
    size = np.linalg.norm(motion_derivatives(xyz) @ combinations, axis=(1, 2))
    points = np.flatnonzero(is_used)
    still = np.flatnonzero(size < 1e-3 * size.max())
    names = [problem.name_of_point(int(points[i])) for i in still if i < len(points)]
    photos = [problem.photos[i - len(points)] for i in still if i >= len(points)]
    parts = []
    if names:
        parts.append(_points(names[:NAMED]))
    if photos:
        parts.append(message("photos", "photos {photos}", photos=photos[:NAMED]))
    return join_with_and(parts) if parts else None, len(still)


def _points(names):
    """Names of points, in words."""
    if len(names) == 1:
        return message("point", "point {point}", point=names[0])
    return message("points", "points {points}", points=names)


def add_inner_constraints(problem, over, combinations, photo=None):
    """Add a datum by inner constraints over points or over one photo.

    Parameters
    ----------
    problem : Problem
    over : ndarray of int, shape (k,), or None
        Points of the constraints; None: all.
    combinations : ndarray, shape (7, d)
        From `null_space`.
    photo : int, optional
        Photo whose motion and rotation are minimized, in place of points.

    Returns
    -------
    Problem
    """
    layout, mask = problem.layout, np.zeros(problem.model.unknowns + 1)
    if photo is None:
        members = slice(None) if over is None else np.asarray(over)
        mask[layout.points[members].ravel()] = 1.0
    else:
        mask[layout.photos[photo]] = 1.0

    d = combinations.shape[1]

    def moves(state):
        ways = combinations
        if d < 7 and state is not problem.state:
            # A rotation about held coordinates is about their current positions, not those at the
            # start.
            ways = null_space(problem, state=state, count=d)
        return directions(layout, state) @ ways

    return replace(problem, model=replace(problem.model, null_space=moves, inner=mask[:-1]))


AXES = "xyz"
SHOWN = 5  # names listed in a sentence
SHARE = 1e-6  # smallest share of a rigid motion that counts as a part of a combination
STILL = 1e-9  # motion of all unknowns over the sum of its parts, below which nothing moves
# smallest singular value of held coordinates, relative; below it they do not fix the frame
WEAK = 1e-6


@dataclass(frozen=True)
class Frame:
    """A survey with its datum.

    Attributes
    ----------
    survey : network.Survey
        Survey to adjust.
    options : dict
        Keyword arguments of network.adjust: datum, over.
    report : DatumReport
    held : ndarray of bool, shape (points, 3)
        Control coordinates that hold the datum.
    tested : ndarray of bool, shape (points, 3)
        Held coordinates that the observations also determine.
    warnings : tuple of Problem
    """

    survey: object
    options: dict
    report: DatumReport
    held: np.ndarray
    tested: np.ndarray
    warnings: tuple = field(default=())


def make_frame(survey, gathered, settings):
    """Choose the datum of a survey with start values.

    Returns
    -------
    Frame

    Raises
    ------
    SolutionError
        If the chosen datum does not remove the datum defect.
    InputError
        If settings.datum_points or settings.fixed_photo name unknown points or photos.
    """
    bare = release_control(survey, gathered)
    problem = assemble(bare)
    # The defect is that of the observations alone, so control is released first.
    free = _free(problem)
    choose = {"control": _control, "minimal": _minimal, "fixed_photo": _photo, "inner": _inner}
    chosen, options, held, names, warnings = choose[settings.datum](
        survey, bare, problem, free, gathered, settings
    )
    known = _known_frame(chosen, bare, gathered, settings, held, options)
    # Declared control determines vertical and scale; coordinates held arbitrarily do not.
    undetermined = _free(assemble(known)) if free.shape[1] else free
    report = DatumReport(
        choice=settings.datum,
        defect=free.shape[1],
        words=defect_in_words(free, problem) if free.shape[1] else "",
        held=tuple(names),
        vertical=not _moves(undetermined, (3, 4)),
        scale=not _moves(undetermined, (6,)),
    )
    if free.shape[1] and not report.scale and settings.datum != "control":
        text = message(
            "scale_of_datum",
            "no observation determines the scale: it comes from what holds the datum",
        )
        warnings = [*warnings, Problem("job.toml", text, None, "adjustment.datum")]
    # A minimal datum without surplus has no redundancy: its coordinates cannot be tested.
    spare = settings.datum != "minimal" or held.sum() > free.shape[1]
    return Frame(chosen, options, report, held, held & spare, tuple(warnings))


def _free(problem):
    """Combinations (7, d) of rigid motions and scale that no observation determines.

    A rotation about a line that contains all points moves no point. Examples are heights at a
    single place, or one point tied to one known point. Such rotations are excluded.
    """
    combinations = null_space(problem)
    if not combinations.shape[1]:
        return combinations
    ways = directions(problem.layout, problem.state)
    # Singular values of the motions: those near zero leave all unknowns in place.
    _, size, turns = np.linalg.svd(ways @ combinations, full_matrices=False)
    # scale: a combination without motion cancels here
    parts = np.linalg.norm(np.abs(ways) @ np.abs(combinations))
    return combinations @ turns[size > STILL * max(parts, 1e-9)].T


def release_control(survey, gathered):
    """Return the survey without weighted or fixed control in its own frame."""
    removed = [
        number
        for number, table in enumerate(survey.observations)
        if isinstance(table, ControlCoordinates) or not table.in_use.any()
    ]
    return replace(survey.without(removed), fixed=gathered.idle)


def _moves(combinations, ways):
    """Whether a combination (7, d) contains a part of one of the given motions."""
    if not combinations.shape[1]:
        return False
    share = np.sum(np.linalg.qr(combinations)[0] ** 2, axis=1)
    return bool((share[list(ways)] > SHARE).any())


def _known_frame(chosen, bare, gathered, settings, held, options):
    """Survey with only the declared part of its datum, without arbitrary choices."""
    declared = np.isfinite(gathered.known.xyz_m) & np.isfinite(gathered.known.sd_m)
    if settings.datum == "control":
        return chosen
    if settings.datum == "fixed_photo":
        return bare
    if settings.datum == "inner":
        held = held.copy()
        over = options.get("over")
        if over is not None and declared[over].all() and len(over) > 2:
            held[over] = True
    return replace(bare, fixed=gathered.idle | (held & declared))


def _control(survey, bare, problem, free, gathered, settings):
    """Datum "control": all control coordinates act with their standard deviations."""
    known = gathered.known
    acting = np.isfinite(known.xyz_m) & np.isfinite(known.sd_m)
    missing = _free(assemble(survey)) if free.shape[1] else free
    if missing.shape[1]:
        raise SolutionError(datum_defect_sentence(missing, assemble(survey)))
    return survey, {}, acting & (known.sd_m == 0), _names_of_coordinates(survey, acting), []


def _minimal(survey, bare, problem, free, gathered, settings):
    """Datum "minimal": as many control coordinates as the defect are held.

    They are chosen far apart, unless settings.datum_points names them.
    """
    d, warnings = free.shape[1], []
    none = np.zeros((len(survey.points), 3), dtype=bool)
    if not d:
        return bare, {}, none, (), [_nothing_left("minimal")]
    rows = _motions(problem, free)
    if settings.datum_points:
        wanted = np.flatnonzero(_chosen_coordinates(survey, settings))
    else:
        declared = np.isfinite(gathered.known.xyz_m) & ~gathered.idle
        candidates = declared if declared.any() else ~gathered.idle
        # Prefer declared control; without it any observed coordinate may be held.
        wanted = _spread(rows, np.flatnonzero(candidates), d)
    held = none.copy()
    held.ravel()[wanted] = True
    # The held coordinates remove the defect if their rows of the motion matrix have full rank.
    rank = _rank(rows[wanted])
    if rank < d:
        raise SolutionError(
            message(
                "held_too_few",
                "{defect_in_words}; the {count} coordinates held ({points}) fix {rank} of {of}: "
                "name others in datum_points, add control or choose datum = inner",
                defect_in_words=defect_in_words(free, problem),
                count=len(wanted),
                points=[*_names_of_coordinates(survey, held)],
                rank=rank,
                of=d,
            )
        )
    if len(wanted) > d:
        text = message(
            "too_many_held",
            "{held} coordinates are held where {needed} are enough: the others can distort "
            "the network",
            held=len(wanted),
            needed=d,
        )
        warnings.append(Problem("job.toml", text, None, "adjustment.datum_points"))
    xyz = np.where(held & np.isfinite(gathered.known.xyz_m), gathered.known.xyz_m, survey.xyz_m)
    chosen = replace(bare, xyz_m=xyz, fixed=bare.fixed | held)
    warnings += _released_control_problems(survey, _exact(gathered) & ~held, "minimal")
    return chosen, {}, held, _names_of_coordinates(survey, held), warnings


def _photo(survey, bare, problem, free, gathered, settings):
    """Datum "fixed_photo": position and rotation of one photo are held."""
    names = () if survey.photos is None else survey.photos.names
    name = settings.fixed_photo or (names[0] if names else None)
    if name not in names:
        raise InputError(
            Problem(
                "job.toml",
                message("not_a_photo", "{name} is not a photo of this survey", name=name),
                None,
                "adjustment.fixed_photo",
            )
        )
    fixed = survey.photos.fixed.copy()
    fixed[names.index(name)] = True
    chosen = replace(bare, photos=replace(survey.photos, fixed=fixed))
    left = _free(assemble(chosen))
    if left.shape[1]:
        raise SolutionError(datum_defect_sentence(left, problem))
    held = np.zeros((len(survey.points), 3), dtype=bool)
    released = _released_control_problems(survey, _exact(gathered), "fixed_photo")
    # Observations determine part of the six parameters. Holding all six would strain the network,
    # so the photo is held by inner constraints.
    if free.shape[1] < 6:
        number = names.index(name)
        return bare, {"datum": "inner", "photo": number}, held, (name,), released
    return chosen, {}, held, (name,), released


def _inner(survey, bare, problem, free, gathered, settings):
    """Datum "inner": the chosen points keep their positions on average, as far as held control
    permits."""
    known, held = gathered.known, _exact(gathered)
    xyz = np.where(np.isfinite(known.xyz_m), known.xyz_m, survey.xyz_m)
    if not free.shape[1]:
        warnings = [_nothing_left("inner"), *_released_control_problems(survey, held, "inner")]
        return bare, {}, np.zeros_like(held), (), warnings
    chosen, fixed = (
        replace(bare, xyz_m=xyz, fixed=bare.fixed | held),
        _names_of_coordinates(survey, held),
    )
    # Exact control may remove part of the defect; inner constraints remove the rest.
    problem = assemble(chosen)
    left = _free(problem)
    if not left.shape[1]:
        return chosen, {}, held, fixed, [_nothing_left("inner")]
    if settings.datum_points:
        over = np.flatnonzero(_chosen_coordinates(survey, settings).any(axis=1))
    else:
        over = np.flatnonzero(np.isfinite(known.xyz_m).all(axis=1) & ~held.all(axis=1))
        # Inner constraints need three points to fix a rotation.
        over = over if len(over) > 2 else np.arange(len(survey.points))
    d = left.shape[1]
    rank = _rank(_motions(problem, left).reshape(-1, 3, d)[over].reshape(-1, d))
    if rank < d:
        raise SolutionError(
            message(
                "inner_too_few",
                "{defect_in_words}; inner constraints over {count} points fix {rank} of {of}: "
                "take more points, not all on one line",
                defect_in_words=defect_in_words(left, problem),
                count=len(over),
                rank=rank,
                of=d,
            )
        )
    names = tuple(survey.points[i] for i in over) if len(over) < len(survey.points) else ("all",)
    return chosen, {"datum": "inner", "over": over}, held, (*fixed, *names), []


def _exact(gathered):
    """Mask (points, 3) of observed control coordinates with standard deviation 0."""
    known = gathered.known
    return np.isfinite(known.xyz_m) & (known.sd_m == 0) & ~gathered.idle


def _released_control_problems(survey, held, choice):
    """Problem rows for exact control that the datum does not hold."""
    if not held.any():
        return []
    text = message(
        "held_released",
        "{points} hold exactly in control.csv (sd 0), and datum = {choice} does not hold them: they"
        " are compared only; choose datum = control or inner to hold them",
        points=list_some(_names_of_coordinates(survey, held), SHOWN),
        choice=choice,
    )
    return [Problem("job.toml", text, None, "adjustment.datum")]


def _nothing_left(choice):
    text = message(
        "nothing_left_to_hold",
        "the observations already determine the frame: datum = {choice} has nothing to fix",
        choice=choice,
    )
    return Problem("job.toml", text, None, "adjustment.datum")


def _motions(problem, free):
    """Change (3 points, d) of coordinates by the free combinations, each scaled to an rms of 1."""
    layout = problem.layout
    # The appended zero row serves fixed coordinates, whose column number is -1.
    ways = np.vstack([directions(layout, problem.state), np.zeros(7)])[layout.points.ravel()] @ free
    size = np.sqrt(np.mean(ways**2, axis=0))
    return ways / np.where(size > 0, size, 1.0)


def _spread(rows, candidates, d):
    """Choose d candidates that hold the free combinations best, by pivoted QR."""
    # Each pivot maximizes the volume spanned by the rows chosen so far.
    _, _, order = scipy.linalg.qr(rows[candidates].T, mode="economic", pivoting=True)
    return np.sort(candidates[order[:d]])


def _rank(rows):
    if not len(rows):
        return 0
    values = np.linalg.svd(rows, compute_uv=False)
    return int(np.sum(values > WEAK * np.sqrt(len(rows))))


def _chosen_coordinates(survey, settings):
    """Mask (points, 3) of the coordinates named in `datum_points`."""
    mask = np.zeros((len(survey.points), 3), dtype=bool)
    missing = []
    for name, axes in settings.datum_points:
        if name in survey.points:
            mask[survey.points.index(name), [AXES.index(axis) for axis in axes]] = True
        else:
            missing.append(
                Problem(
                    "job.toml",
                    message("not_adjusted_point", "{name} is not an adjusted point", name=name),
                    None,
                    "adjustment.datum_points",
                )
            )
    if missing:
        raise InputError(missing)
    return mask


def _names_of_coordinates(survey, mask):
    """Names with axes of the coordinates in a mask (points, 3)."""
    return tuple(
        f"{survey.points[i]}:{''.join(AXES[k] for k in np.flatnonzero(mask[i]))}"
        for i in np.flatnonzero(mask.any(axis=1))
    )
