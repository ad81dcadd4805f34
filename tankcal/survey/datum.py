"""What holds the frame of a survey: the choice of a datum, and what it is worth."""

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
SHOWN = 5  # names in a sentence
SHARE = 1e-6  # of a way of moving in a combination, below which it is not in it
STILL = 1e-9  # motion of all unknowns over the sum of its parts, below which nothing moves
WEAK = 1e-6  # smallest pivot of held coordinates over the largest, below which they hold too little


@dataclass(frozen=True)
class Frame:
    """A survey with its datum.

    survey    to be adjusted          options   of network.adjust: datum, over
    report    DatumReport             held      (points, 3) True: control that holds the datum
    tested    (points, 3) True: those of `held` that readings, too, speak of
    warnings  tuple of Problem
    """

    survey: object
    options: dict
    report: DatumReport
    held: np.ndarray
    tested: np.ndarray
    warnings: tuple = field(default=())


def make_frame(survey, gathered, settings):
    """The Frame of a survey with start values; raises SolutionError when the datum is missing."""
    bare = release_control(survey, gathered)
    problem = assemble(bare)
    free = _free(problem)
    choose = {"control": _control, "minimal": _minimal, "fixed_photo": _photo, "inner": _inner}
    chosen, options, held, names, warnings = choose[settings.datum](
        survey, bare, problem, free, gathered, settings
    )
    known = _known_frame(chosen, bare, gathered, settings, held, options)
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
    spare = settings.datum != "minimal" or held.sum() > free.shape[1]
    return Frame(chosen, options, report, held, held & spare, tuple(warnings))


def _free(problem):
    """Ways (7, d) in which something can move that nothing observes.

    A rotation about a line on which everything lies (heights alone, all at one place; one point
    that hangs on one known point) moves nothing: it is none of them.
    """
    found = null_space(problem)
    if not found.shape[1]:
        return found
    ways = directions(problem.layout, problem.state)
    _, size, turns = np.linalg.svd(ways @ found, full_matrices=False)
    parts = np.linalg.norm(np.abs(ways) @ np.abs(found))  # what moves nothing is a sum that cancels
    return found @ turns[size > STILL * max(parts, 1e-9)].T


def release_control(survey, gathered):
    """The survey without control in its own frame, weighted or fixed."""
    gone = [
        number
        for number, one in enumerate(survey.observations)
        if isinstance(one, ControlCoordinates) or not one.in_use.any()
    ]
    return replace(survey.without(gone), fixed=gathered.idle)


def _moves(combinations, ways):
    """Whether some combination (7, d) has a part of one of the ways."""
    if not combinations.shape[1]:
        return False
    share = np.sum(np.linalg.qr(combinations)[0] ** 2, axis=1)
    return bool((share[list(ways)] > SHARE).any())


def _known_frame(chosen, bare, gathered, settings, held, options):
    """The survey with that part of its datum which somebody knows: declared, not only assumed."""
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
    """All control coordinates act as they were given."""
    known = gathered.known
    acting = np.isfinite(known.xyz_m) & np.isfinite(known.sd_m)
    missing = _free(assemble(survey)) if free.shape[1] else free
    if missing.shape[1]:
        raise SolutionError(datum_defect_sentence(missing, assemble(survey)))
    return survey, {}, acting & (known.sd_m == 0), _named(survey, acting), []


def _minimal(survey, bare, problem, free, gathered, settings):
    """As many control coordinates as the defect are held, far apart unless they are named."""
    d, warnings = free.shape[1], []
    none = np.zeros((len(survey.points), 3), dtype=bool)
    if not d:
        return bare, {}, none, (), [_nothing_left("minimal")]
    rows = _motions(problem, free)
    if settings.datum_points:
        wanted = np.flatnonzero(_wanted(survey, settings))
    else:
        declared = np.isfinite(gathered.known.xyz_m) & ~gathered.idle
        candidates = declared if declared.any() else ~gathered.idle
        wanted = _spread(rows, np.flatnonzero(candidates), d)
    held = none.copy()
    held.ravel()[wanted] = True
    rank = _rank(rows[wanted])
    if rank < d:
        raise SolutionError(
            message(
                "held_too_few",
                "{defect_in_words}; the {count} coordinates held ({points}) fix {rank} of {of}: "
                "name others in datum_points, add control or choose datum = inner",
                defect_in_words=defect_in_words(free, problem),
                count=len(wanted),
                points=[*_named(survey, held)],
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
    warnings += _released(survey, _exact(gathered) & ~held, "minimal")
    return chosen, {}, held, _named(survey, held), warnings


def _photo(survey, bare, problem, free, gathered, settings):
    """One photo keeps its place and its directions."""
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
    released = _released(survey, _exact(gathered), "fixed_photo")
    if free.shape[1] < 6:  # observations determine the rest: holding that, too, would strain them
        number = names.index(name)
        return bare, {"datum": "inner", "photo": number}, held, (name,), released
    return chosen, {}, held, (name,), released


def _inner(survey, bare, problem, free, gathered, settings):
    """Chosen points keep their places on the whole, as far as held control leaves them free."""
    known, held = gathered.known, _exact(gathered)
    xyz = np.where(np.isfinite(known.xyz_m), known.xyz_m, survey.xyz_m)
    if not free.shape[1]:
        warnings = [_nothing_left("inner"), *_released(survey, held, "inner")]
        return bare, {}, np.zeros_like(held), (), warnings
    chosen, fixed = replace(bare, xyz_m=xyz, fixed=bare.fixed | held), _named(survey, held)
    problem = assemble(chosen)
    left = _free(problem)
    if not left.shape[1]:
        return chosen, {}, held, fixed, [_nothing_left("inner")]
    if settings.datum_points:
        over = np.flatnonzero(_wanted(survey, settings).any(axis=1))
    else:
        over = np.flatnonzero(np.isfinite(known.xyz_m).all(axis=1) & ~held.all(axis=1))
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
    """(points, 3) True for control coordinates that hold exactly and that something observes."""
    known = gathered.known
    return np.isfinite(known.xyz_m) & (known.sd_m == 0) & ~gathered.idle


def _released(survey, held, choice):
    """Problem rows that tell of control that holds exactly, and that a datum does not hold."""
    if not held.any():
        return []
    text = message(
        "held_released",
        "{points} hold exactly in control.csv (sd 0), and datum = {choice} does not hold them: they"
        " are compared only; choose datum = control or inner to hold them",
        points=list_some(_named(survey, held), SHOWN),
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
    """Change (3 points, d) of all coordinates by what is free, each way scaled to size one."""
    layout = problem.layout
    ways = np.vstack([directions(layout, problem.state), np.zeros(7)])[layout.points.ravel()] @ free
    size = np.sqrt(np.mean(ways**2, axis=0))
    return ways / np.where(size > 0, size, 1.0)


def _spread(rows, candidates, d):
    """d of the candidates that hold the free ways best: largest volume, one after the other."""
    _, _, order = scipy.linalg.qr(rows[candidates].T, mode="economic", pivoting=True)
    return np.sort(candidates[order[:d]])


def _rank(rows):
    if not len(rows):
        return 0
    values = np.linalg.svd(rows, compute_uv=False)
    return int(np.sum(values > WEAK * np.sqrt(len(rows))))


def _wanted(survey, settings):
    """(points, 3) the coordinates that `datum_points` names."""
    found = np.zeros((len(survey.points), 3), dtype=bool)
    missing = []
    for name, axes in settings.datum_points:
        if name in survey.points:
            found[survey.points.index(name), [AXES.index(axis) for axis in axes]] = True
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
    return found


def _named(survey, mask):
    """Names with axes of the coordinates of a mask (points, 3)."""
    return tuple(
        f"{survey.points[i]}:{''.join(AXES[k] for k in np.flatnonzero(mask[i]))}"
        for i in np.flatnonzero(mask.any(axis=1))
    )
