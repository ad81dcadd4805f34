"""Datum of a survey: its choice, and the coordinates that hold the frame."""

from dataclasses import dataclass, field, replace

import numpy as np
import scipy.linalg

from tankcal.errors import InputError, Problem, SolutionError
from tankcal.messages import list_some, message
from tankcal.survey.network.assembly import assemble
from tankcal.survey.network.datum import (
    datum_defect_sentence,
    defect_in_words,
    directions,
    null_space,
)
from tankcal.survey.observations import ControlCoordinates
from tankcal.survey.results import DatumReport

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
