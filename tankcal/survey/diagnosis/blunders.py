"""Blunders: gross errors detected before the adjustment, other blunders by data snooping.

A distance in millimetres or a station's angles in gon would make the iteration diverge. Readings
far from the start values are therefore rejected first, and data snooping readmits those that agree.
Points that lost their readings to the search are tried once more.
"""

import itertools
from dataclasses import dataclass, replace

import numpy as np

from tankcal.errors import Problem, SolutionError
from tankcal.messages import message
from tankcal.survey.diagnosis.diagnoses import find_swapped_points, mirrored_fits, mirrored_photo
from tankcal.survey.network import adjust, snoop
from tankcal.survey.network.assembly import assemble
from tankcal.survey.network.blocks import CORRELATED
from tankcal.survey.network.snooping import kept_rows, set_use, start_from_adjusted
from tankcal.survey.observations import Directions, Distances
from tankcal.survey.start.photographs import sights_of
from tankcal.survey.start.resection import bearings, intersect_rays


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

    Parameters
    ----------
    survey : network.Survey

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
