"""Blunders: gross ones seen before the adjustment, others set aside by the search.

A distance in millimetres or a station's angles in gon would drive the iteration away. Readings that
are far from what the start values say begin set aside; the search for blunders takes them back when
they agree after all. Points that lost their readings to the search are given another chance.
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
from tankcal.survey.network.snooping import kept_of, set_use, start_from_adjusted
from tankcal.survey.observations import Directions, Distances
from tankcal.survey.start.photographs import sights_of
from tankcal.survey.start.resection import bearings, intersect_rays


@dataclass(frozen=True)
class Searched:
    """An adjusted survey after the search for blunders.

    adjusted  network.Adjusted       removed   tuple of network.snooping.Removed
    rounds    adjustments            needed    tuple of network.snooping.Removed that were kept
    warnings  tuple of Problem
    """

    adjusted: object
    removed: tuple
    rounds: int
    needed: tuple = ()
    warnings: tuple = ()


def search_blunders(survey, options, gross=None):
    """The Searched of a survey; when the search finds no end, everything is adjusted and told.

    gross  {source: (n,) True} readings that begin set aside, or None: no search at all
    """
    if gross is None:
        return Searched(adjust(survey, **options), (), 1)
    try:
        found = _without(survey, options, gross) if gross else snoop(survey, **options)
    except SolutionError as error:
        adjusted = adjust(survey, **options)
        text = message(
            "search_failed",
            "the search for blunders failed ({error}): nothing was rejected, blunders may be in"
            " the result",
            error=error.args[0],
        )
        return Searched(
            adjusted, (), 1, (), (Problem("job.toml", text, None, "adjustment.snooping"),)
        )
    again = _readmitted(found, gross)
    if again is not None:
        try:
            second = snoop(again, robust=False, **options)
        except SolutionError:
            second = found
        if second.adjusted.problem.aside.sum() < found.adjusted.problem.aside.sum():
            rounds = found.rounds + second.rounds
            return Searched(second.adjusted, second.removed, rounds, second.needed)
    return Searched(found.adjusted, found.removed, found.rounds, found.needed)


def _counted_anew(block, gross):
    """A Block after readings were taken out of the tables; none of its own is among them."""
    row = block.row.copy()
    for source, gone in gross.items():
        mine = block.source == source
        row[mine] -= np.cumsum(gone)[row[mine]]
    return replace(block, row=row)


def _without(survey, options, gross):
    """network.Cleaned of a survey: first without some readings, then with these set aside."""
    images = survey.image_points
    thin = replace(  # without their traces: the scatter of repeated readings does not count here
        survey,
        image_points=None if images is None else replace(images, trace=None),
        observations=tuple(
            replace(one.taken(~gross[number]) if number in gross else one, trace=None)
            for number, one in enumerate(survey.observations)
        ),
        correlated=tuple(_counted_anew(one, gross) for one in survey.correlated),
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
    whole = snoop(
        set_use(start_from_adjusted(survey, first.adjusted), uses), robust=False, **options
    )
    return replace(whole, rounds=first.rounds + whole.rounds)


def _readmitted(found, gross):
    """The survey with all readings of points that the search left with too few; None: no such."""
    lost = found.adjusted.problem.aside
    if not lost.any():
        return None
    survey, uses = found.survey, {}
    images = survey.image_points
    if images is not None and images.use is not None:
        uses["image points"] = np.where(lost[images.point], 1.0, images.use)
    for number, one in enumerate(survey.observations):
        if one.use is not None and one.ties:
            back = np.any([lost[getattr(one, name)] for name in one.ties], axis=0)
            back &= ~gross.get(number, np.zeros(len(one), dtype=bool))
            uses[number] = np.where(back, 1.0, one.use)
    return set_use(survey, uses)


FAR = 0.25  # relative, of a distance
ASKEW_RAD = 0.1  # of an angle
AS_OTHERS = 10.0  # times the median misclosure of all readings of a kind
MOST = 0.4  # share of a kind beyond which the start values are wrong, not the readings
WORSE = 10.0  # times the median photo's misclosure, above which a photo is looked at
WORST_MM = 0.2
START_M = 0.1  # sd of a place before the adjustment


def gross_readings(survey):
    """{source: (n,) True} for readings that are grossly off the start values of a survey.

    Raises SolutionError for photos that are mirrored.
    """
    problem, found = assemble(survey), {}
    for one, source, rows in zip(
        problem.observations, problem.sources, problem.rows_of, strict=True
    ):
        if source in ("known beforehand", CORRELATED) or not len(one):
            continue
        w = np.empty((len(one), one.rows))
        one.fill(problem.state, w, np.empty((0, one.rows, 0)))
        off = w / one.weight
        if source == "image points":
            _refuse_mirrored(survey, np.linalg.norm(off, axis=1), rows)
            continue
        off = _about_their_sets(one, off) if isinstance(one, Directions) else np.abs(off)
        limit = np.maximum(_limit(one, problem.state), AS_OTHERS * np.median(off[:, 0]))
        gross = off[:, 0] > limit
        if gross.any() and gross.mean() < MOST:
            found[source] = np.zeros(len(survey.observations[source]), dtype=bool)
            found[source][rows[gross]] = True
            found[source] &= ~kept_of(survey.observations[source], survey.kept)
    return found


def swapped_at_start(survey, known):
    """Problem rows for fixed control points whose rays meet where x and y are exchanged.

    Weighted ones are left to the adjustment, which can set them aside.
    """
    sights, points = sights_of(survey), len(survey.points)
    if not sights:
        return []
    owner = np.concatenate([sight.point for sight in sights])
    photo = np.repeat(np.arange(len(sights)), [len(sight.point) for sight in sights])
    ours = np.isfinite(known.xyz_m).all(axis=1)[owner]
    rays = bearings(np.vstack([sight.ideal for sight in sights])[ours])
    rays = np.einsum("nji,nj->ni", survey.photos.rotation[photo[ours]], rays)
    met, _ = intersect_rays(survey.photos.xyz_m[photo[ours]], rays, owner[ours], points)
    held = (known.sd_m[:, :2] == 0).all(axis=1)
    number = {name: i for i, name in enumerate(survey.points)}
    row = {name: row for name, row in known.row.items() if held[number[name]]}
    return find_swapped_points(survey.points, met, replace(known, row=row), START_M)


def _limit(one, state):
    """(n,) or number: what a misclosure must exceed to be gross."""
    if isinstance(one, Distances):
        return FAR * one.computed(state, False)[0][:, 0]
    return ASKEW_RAD if one.unit == "rad" else np.inf


def _about_their_sets(one, misclosure):
    """Misclosures (n, 1) of directions, about the median of each set."""
    off = np.zeros_like(misclosure)
    for number in np.unique(one.set):
        mine = one.set == number
        turned = np.exp(1j * misclosure[mine])
        middle = np.angle(np.median(turned.real) + 1j * np.median(turned.imag))
        off[mine] = np.abs(np.angle(turned * np.exp(-1j * middle)))
    return off


def _refuse_mirrored(survey, off_mm, rows):
    """Raise when photos fit far worse than others, and well once they are mirrored."""
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
    if not len(doubtful) or len(doubtful) > MOST * n:
        return
    sights = sights_of(replace(survey, image_points=replace(images, use=None)))
    found = [
        mirrored_photo(survey.photos.names[i])
        for i in doubtful
        if mirrored_fits(survey.xyz_m[sights[i].point], sights[i].ideal)
    ]
    if found:
        raise SolutionError("\n".join(map(str, found)))
