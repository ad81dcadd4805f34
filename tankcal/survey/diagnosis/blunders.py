"""Blunders set aside; points that lost their readings to the search are given another chance."""

from dataclasses import dataclass, replace

import numpy as np

from tankcal.errors import Problem, SolutionError
from tankcal.messages import message
from tankcal.survey.network import adjust, snoop
from tankcal.survey.network.snooping import started, with_use


@dataclass(frozen=True)
class Searched:
    """An adjusted survey after the search for blunders.

    adjusted  network.Adjusted       removed   tuple of network.cleaning.Removed
    rounds    adjustments            needed    tuple of network.cleaning.Removed that were kept
    warnings  tuple of Problem
    """

    adjusted: object
    removed: tuple
    rounds: int
    needed: tuple = ()
    warnings: tuple = ()


def searched(survey, options, gross=None):
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
            "the search for blunders failed ({error}): nothing was set aside, blunders may be in"
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
        if _lost(second.adjusted).sum() < _lost(found.adjusted).sum():
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
    thin = replace(
        survey,
        repeated={},
        observations=tuple(
            one.taken(~gross[number]) if number in gross else one
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
    whole = snoop(with_use(started(survey, first.adjusted), uses), robust=False, **options)
    return replace(whole, rounds=first.rounds + whole.rounds)


def _lost(adjusted):
    """(points,) True for points that do not take part."""
    return np.array([bool(why) for why in adjusted.problem.set_aside], dtype=bool)


def _readmitted(found, gross):
    """The survey with all readings of points that the search left with too few; None: no such."""
    lost = _lost(found.adjusted)
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
    return with_use(survey, uses)
