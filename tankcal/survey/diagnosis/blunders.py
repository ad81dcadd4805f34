"""Blunders: gross errors detected before the adjustment, other blunders by data snooping.

A distance in millimetres or a station's angles in gon would make the iteration diverge. Readings
far from the start values are therefore rejected first, and data snooping readmits those that agree.
Points that lost their readings to the search are tried once more.

Attribution of outliers: blunders in readings, or valid readings rejected because of an error in
another item that was kept.

Data snooping trusts the majority and whatever is held fixed. Single blunders occur everywhere. If
one item (a point with known coordinates, a photo, an instrument) lost far more readings than all
others, that item is reported:

    P(k or more of n | p) < 0.001 / number of items,   p = (K + 1) / (N + 2)

with k of its n values rejected and K of the N values of all other items.
"""

import itertools
from collections import defaultdict
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import betainc

from tankcal.errors import Problem, SolutionError
from tankcal.messages import join_with_or, list_some, message
from tankcal.survey.diagnosis.diagnoses import (
    find_swapped_points,
    image_point_label,
    mirrored_fits,
    mirrored_photo,
)
from tankcal.survey.network import adjust, snoop
from tankcal.survey.network.assembly import assemble
from tankcal.survey.network.blocks import CORRELATED
from tankcal.survey.network.reliability import alternatives
from tankcal.survey.network.snooping import kept_rows, set_use, start_from_adjusted
from tankcal.survey.network.survey import IMAGES
from tankcal.survey.observations import Directions, Distances
from tankcal.survey.start.photographs import bearings, intersect_rays, sights_of

LEVEL = 0.001
MANY = 0.12  # share of rejected values above which single blunders are improbable
SOME = 0.02  # share above which held quantities are tested
LISTED = 4
TESTED = 60  # rejected readings examined for alternatives


@dataclass(frozen=True)
class SearchResult:
    """An adjusted survey after the search for blunders.

    Attributes
    ----------
    adjusted : network.Adjusted
    removed : tuple of network.snooping.Removed
        Rejected observations.
    rounds : int
        Number of adjustments.
    needed : tuple of network.snooping.Removed
        Suspected observations that were kept because unknowns depend on them.
    warnings : tuple of Problem
    """

    adjusted: object
    removed: tuple
    rounds: int
    needed: tuple = ()
    warnings: tuple = ()


def search_blunders(survey, options, gross=None):
    """Search a survey for blunders.

    If the search does not converge, all observations are adjusted and a warning is added.

    Parameters
    ----------
    survey : network.Survey
    options : dict
        Keyword arguments of network.adjust.
    gross : dict, optional
        {source: (n,) True} readings rejected at the start; None: no search.

    Returns
    -------
    SearchResult
    """
    if gross is None:
        return SearchResult(adjust(survey, **options), (), 1)
    try:
        cleaned = _search_without(survey, options, gross) if gross else snoop(survey, **options)
    except SolutionError as error:
        adjusted = adjust(survey, **options)
        text = message(
            "search_failed",
            "the search for blunders failed ({error}): nothing was rejected, blunders may be in"
            " the result",
            error=error.args[0],
        )
        return SearchResult(
            adjusted, (), 1, (), (Problem("job.toml", text, None, "adjustment.snooping"),)
        )
    again = _readmit(cleaned, gross)
    if again is not None:
        try:
            # The start values are good now, so a robust start is not needed.
            second = snoop(again, robust=False, **options)
        except SolutionError:
            second = cleaned
        # Accept the second search only if it recovers points.
        if second.adjusted.problem.aside.sum() < cleaned.adjusted.problem.aside.sum():
            rounds = cleaned.rounds + second.rounds
            return SearchResult(second.adjusted, second.removed, rounds, second.needed)
    return SearchResult(cleaned.adjusted, cleaned.removed, cleaned.rounds, cleaned.needed)


def _renumber(block, gross):
    """Renumber the rows of a Block after readings outside the block left the tables."""
    row = block.row.copy()
    for source, removed in gross.items():
        is_of_source = block.source == source
        # Each row moves up by the number of removed rows before it.
        row[is_of_source] -= np.cumsum(removed)[row[is_of_source]]
    return replace(block, row=row)


def _search_without(survey, options, gross):
    """Search a survey twice: first without some readings, then with these readings rejected.

    Parameters
    ----------
    survey : network.Survey
    options : dict
    gross : dict
        {source: (n,) True} readings to leave out.

    Returns
    -------
    network.CleanedSurvey
    """
    images = survey.image_points
    thin = replace(  # without traces: the scatter of repeated readings does not count here
        survey,
        image_points=None if images is None else replace(images, trace=None),
        observations=tuple(
            replace(one.taken(~gross[number]) if number in gross else one, trace=None)
            for number, one in enumerate(survey.observations)
        ),
        correlated=tuple(_renumber(one, gross) for one in survey.correlated),
    )
    first = snoop(thin, **options)
    uses = {}
    for number, one in enumerate(first.survey.observations):
        kept = ~gross.get(number, np.zeros(len(survey.observations[number]), dtype=bool))
        uses[number] = np.zeros(len(kept))
        uses[number][kept] = 1.0 if one.use is None else one.use
    images = first.survey.image_points
    if images is not None and images.use is not None:
        uses["image points"] = images.use
    # Start from the first solution, in which the readings left out are tested as rejected ones.
    cleaned = snoop(
        set_use(start_from_adjusted(survey, first.adjusted), uses), robust=False, **options
    )
    return replace(cleaned, rounds=first.rounds + cleaned.rounds)


def _readmit(cleaned, gross):
    """Restore all readings of points that lost too many to the search; None: no such point."""
    lost_points = cleaned.adjusted.problem.aside
    if not lost_points.any():
        return None
    survey, uses = cleaned.survey, {}
    images = survey.image_points
    if images is not None and images.use is not None:
        uses["image points"] = np.where(lost_points[images.point], 1.0, images.use)
    for number, table in enumerate(survey.observations):
        if table.use is not None and table.ties:
            back = np.any([lost_points[getattr(table, name)] for name in table.ties], axis=0)
            # Grossly wrong readings stay out.
            back &= ~gross.get(number, np.zeros(len(table), dtype=bool))
            uses[number] = np.where(back, 1.0, table.use)
    return set_use(survey, uses)


FAR = 0.25  # relative error of a gross distance
ASKEW_RAD = 0.1  # error of a gross angle
AS_OTHERS = 10.0  # ratio to the median misclosure of the kind, below which a reading is not gross
MOST = 0.4  # share of a kind above which the start values are wrong, not the readings
WORSE = 10.0  # ratio to the median misclosure of photos, above which a photo is examined
WORST_MM = 0.2  # smallest misclosure of an examined photo
START_M = 0.1  # standard deviation of a position before the adjustment


def gross_readings(survey):
    """Find readings far from the start values.

    Returns
    -------
    dict
        {source: (n,) True for gross readings}.

    Raises
    ------
    SolutionError
        If photos are mirrored.
    """
    problem, gross_rows = assemble(survey), {}
    for group, source, rows in zip(
        problem.observations, problem.sources, problem.rows_of, strict=True
    ):
        if source in ("known beforehand", CORRELATED) or not len(group):
            continue
        w = np.empty((len(group), group.rows))
        group.fill(problem.state, w, np.empty((0, group.rows, 0)))
        off = w / group.weight
        if source == "image points":
            _refuse_mirrored(survey, np.linalg.norm(off, axis=1), rows)
            continue
        off = _centre_on_sets(group, off) if isinstance(group, Directions) else np.abs(off)
        # All readings of a kind may be off because the start values are poor.
        limit = np.maximum(_limit(group, problem.state), AS_OTHERS * np.median(off[:, 0]))
        gross = off[:, 0] > limit
        if gross.any() and gross.mean() < MOST:
            gross_rows[source] = np.zeros(len(survey.observations[source]), dtype=bool)
            gross_rows[source][rows[gross]] = True
            gross_rows[source] &= ~kept_rows(survey.observations[source], survey.kept)
    return gross_rows


def find_swapped_control(survey, known):
    """Problem rows for fixed control points whose rays meet where x and y are exchanged.

    Weighted points are left to the adjustment, which can reject them.
    """
    sights, points = sights_of(survey), len(survey.points)
    if not sights:
        return []
    owner = np.concatenate([sight.point for sight in sights])
    photo = np.repeat(np.arange(len(sights)), [len(sight.point) for sight in sights])
    is_control = np.isfinite(known.xyz_m).all(axis=1)[owner]
    rays = bearings(np.vstack([sight.ideal for sight in sights])[is_control])
    # Rotate the rays to the frame of the survey and intersect those of each point.
    rays = np.einsum("nji,nj->ni", survey.photos.rotation[photo[is_control]], rays)
    intersections, _ = intersect_rays(
        survey.photos.xyz_m[photo[is_control]], rays, owner[is_control], points
    )
    held = (known.sd_m[:, :2] == 0).all(axis=1)
    number = {name: i for i, name in enumerate(survey.points)}
    row = {name: row for name, row in known.row.items() if held[number[name]]}
    return find_swapped_points(survey.points, intersections, replace(known, row=row), START_M)


def _limit(observations, state):
    """Smallest gross misclosure, a number or (n,)."""
    if isinstance(observations, Distances):
        return FAR * observations.computed(state, False)[0][:, 0]
    return ASKEW_RAD if observations.unit == "rad" else np.inf


def _centre_on_sets(directions, misclosure):
    """Misclosures (n, 1) of directions relative to the median of their set."""
    off = np.zeros_like(misclosure)
    for number in np.unique(directions.set):
        is_of_set = directions.set == number
        turned = np.exp(1j * misclosure[is_of_set])
        # The orientation of the set is still unknown: its median misclosure removes it.
        middle = np.angle(np.median(turned.real) + 1j * np.median(turned.imag))
        off[is_of_set] = np.abs(np.angle(turned * np.exp(-1j * middle)))
    return off


def _refuse_mirrored(survey, off_mm, rows):
    """Raise SolutionError if photos fit far worse than others, and well after mirroring."""
    images = survey.image_points
    photo, n = images.photo[rows], len(survey.photos.names)
    order = np.argsort(photo, kind="stable")
    cuts = np.searchsorted(photo[order], np.arange(n + 1))
    error = np.array(
        [
            np.median(off_mm[order[a:b]]) if b > a else 0.0
            for a, b in itertools.pairwise(cuts.tolist())
        ]
    )
    doubtful = np.flatnonzero(error > max(WORSE * np.median(error), WORST_MM))
    # If many photos misfit, the start values are wrong.
    if not len(doubtful) or len(doubtful) > MOST * n:
        return
    sights = sights_of(replace(survey, image_points=replace(images, use=None)))
    mirrored = [
        mirrored_photo(survey.photos.names[i])
        for i in doubtful
        if mirrored_fits(survey.xyz_m[sights[i].point], sights[i].ideal)
    ]
    if mirrored:
        raise SolutionError("\n".join(map(str, mirrored)))


# ---- attribution of outliers


def find_one_sided_losses(readings, known):
    """Problem rows on items that lost far more of their values than all others.

    Returns
    -------
    list of Problem
    """
    used = readings.where(~readings.check & (readings.columns["file"] != "cameras.toml"))
    total, gone = len(used), int(used.removed.sum())
    if not gone:
        return []
    things = defaultdict(lambda: [0, 0])
    rows = (used.columns[name].tolist() for name in ("kind", "file", "ids", "removed"))
    for *identity, removed in zip(*rows, strict=True):
        for thing in _dependencies(*identity, known):
            things[thing][0] += 1
            things[thing][1] += removed
    suspects = []
    for (file, name), (n, k) in things.items():
        # Laplace estimate of the rate of rejection of everything else.
        p = (gone - k + 1) / (total - n + 2)
        # betainc(k, n - k + 1, p) is the binomial probability of k or more rejections.
        if k > 2 and n < total and betainc(k, n - k + 1, p) < LEVEL / len(things):
            text = _far_more(name, k, n) if file == "control.csv" else _much_of_photo(name, k, n)
            row = known.row.get(name) if file == "control.csv" else None
            suspects.append((k / n, Problem(file, text, row)))
    suspects.sort(key=lambda pair: -pair[0])
    return [
        *_lost_control(used),
        *(identity for _, identity in suspects[:LISTED]),
        *_many(gone, total),
    ]


def _dependencies(kind, file, ids, known):
    """Yield (file, name) of the items on which a value depends."""
    if kind == "image coordinate":
        yield file, ids[0]
    for name in dict.fromkeys(ids):
        if name in known.row and not kind.startswith("control coordinate"):
            yield "control.csv", name


def _far_more(name, k, n):
    """Sentence about a control point with many rejected readings."""
    return message(
        "point_lost_much",
        "{gone} of the {count} values measured to point {point} were rejected, far more than of"
        " other points: its coordinates may be wrong, not the readings",
        gone=k,
        count=n,
        point=name,
    )


def _much_of_photo(name, k, n):
    """Sentence about a photo with many rejected points."""
    return message(
        "photo_lost_much",
        "{gone} of the {count} values of photo {photo} were rejected, far more than of "
        "others: check the whole photo",
        gone=k,
        count=n,
        photo=name,
    )


def _lost_control(readings):
    """Problem rows of rejected known coordinates."""
    rejected = [
        reading
        for reading in readings.where(readings.removed)
        if reading.kind.startswith("control coordinate") and np.isfinite(reading.residual)
    ]
    return [
        Problem(
            reading.file, _lost_coordinate_sentence(reading), reading.row, f"{reading.element}_m"
        )
        for reading in rejected[: 2 * LISTED]
    ]


def _lost_coordinate_sentence(reading):
    """Sentence about a rejected known coordinate."""
    return message(
        "control_set_aside",
        "{axis} of {point} was rejected: given as {value_m:.4f} (sd {sd_m:.4f}), but the "
        "readings give {here_m:.4f}",
        axis=reading.element,
        point=reading.ids[0],
        value_m=reading.value,
        sd_m=reading.sd,
        here_m=reading.value + reading.residual,
    )


def _many(gone, total):
    """Problem rows if more values were rejected than single blunders explain."""
    if gone < 3 or gone <= MANY * total:
        return []
    text = message(
        "many_set_aside",
        "{gone} of {total} values ({percent:.0f} %) were rejected: more than single blunders "
        "explain; first check what is held fixed, the scales and the standard deviations",
        gone=gone,
        total=total,
        percent=100 * gone / total,
    )
    return [Problem("job.toml", text, None, "adjustment.snooping")]


def find_undecided_outliers(adjusted, removed, held, held_trace):
    """Problem rows of rejected readings for which another reading may be wrong instead.

    Parameters
    ----------
    adjusted : network.Adjusted
    removed : sequence of network.snooping.Removed
        The worst first.
    held : network.reactions.Reactions
        Reactions of held coordinates.
    held_trace : Trace

    Returns
    -------
    list of Problem
    """
    problems = []
    for rejected in removed[:TESTED]:
        others = alternatives(adjusted, rejected.source, rejected.row, held)
        if others:
            names = [
                _reading_in_words(adjusted, held_trace, *alternative) for alternative in others
            ]
            text = message(
                "undecided",
                "{reading} was rejected, but the error may equally be in {others}: the "
                "readings cannot decide",
                reading=_reading_in_words(adjusted, held_trace, rejected.source, rejected.row),
                others=_either(names),
            )
            trace = adjusted.survey.table(rejected.source).trace
            problems.append(Problem(trace.file, text, trace.rows[rejected.row]))
    if len(problems) > LISTED:
        text = message(
            "more_undecided",
            "the same is true of {more} more readings that were rejected",
            more=len(problems) - LISTED,
        )
        # Further cases are counted in one line.
        problems[LISTED:] = [Problem("job.toml", text, None, "adjustment.snooping")]
    return problems


def _either(names):
    """A list of alternatives, in words."""
    if len(names) > LISTED:
        return message("one_of", "one of {names}", names=list_some(names, LISTED))
    return join_with_or(names)


def _reading_in_words(adjusted, held_trace, source, row):
    """A reading in words."""
    observations = adjusted.survey.table(source)
    trace = held_trace if observations is None else observations.trace
    ids = trace.ids[row]
    if source == IMAGES:
        return image_point_label(*ids)
    kind = "control coordinate" if observations is None else observations.kind
    table_name = trace.table.replace("_", " ") or kind.removesuffix(" of a further system")
    name, kind = (
        " ".join(filter(None, ["-".join(ids), trace.element[row][0]])),
        table_name.removesuffix("s"),
    )
    if trace.rows[row] is None:
        return message("reading", "{kind} {name}", kind=kind, name=name)
    row = trace.rows[row]
    return message("reading_in_row", "{kind} {name} (row {row})", kind=kind, name=name, row=row)


def count_set_aside(survey):
    """Number of values that an adjusted survey rejects."""
    return sum(table.rows * int(np.sum(~table.in_use)) for table in survey.tables.values())
