"""Repeated readings one by one, of which the network of a plan has the mean alone.

A mean has the weight of its readings together, each with its share p of it (1/n of n alike):

    r_i = 1 - p (1 - r)         redundancy number of one of them, r that of the mean
    s_i = s / sqrt(p)           its standard deviation, s that of the mean

and an error e of one of them is an error p e of the mean. Readings of directions are in sets, and
each set has an orientation of its own. What the n sets of a set-up differ by takes part of it,

    r_i = 1 - (1 - r) / n - (1 - 1/n) q

q the share of the direction in the weight of its set; the mean of the orientations is that of the
plan. Derivation: means and differences of equally weighted sets are orthogonal, so leverages add.
"""

from collections import defaultdict
from dataclasses import dataclass

import numpy as np

from tankcal.planning.model import TAPED
from tankcal.survey.observations import ImageCoordinates

SIGHTED = ("directions", "zenith_angles", "slope_distances")


@dataclass(frozen=True)
class SingleReadings:
    """k readings, or lots of readings that are alike, of the n rows of a table of observations.

    of     (k,) row that each belongs to      share  (k,) of its weight in that of the row
    count  (k,) readings that are alike
    turn   (k,) share of its weight in the row that the orientation of its own set takes away
    """

    of: np.ndarray
    share: np.ndarray
    count: np.ndarray
    turn: np.ndarray

    def redundancy(self, of_rows):
        """(k, m) redundancy numbers of the readings, from those of the rows (n, m)."""
        return 1.0 - self.share[:, None] * (1.0 - of_rows[self.of]) - self.turn[:, None]

    def root(self):
        """(k, 1) the factor on weights, and on what a whitened error of one does, of the rows."""
        return np.sqrt(self.share)[:, None]


def single_readings(plan, observations, trace, rows):
    """The SingleReadings of some observations of a Plan.

    trace  surveys' Trace of their table        rows  (n,) numbers there
    """
    rows = rows.tolist()
    if trace.table in TAPED:
        return _of_ties(plan, observations, trace, rows)
    times = {}
    if trace.table in SIGHTED:
        times = {one.name: one.sets for one in plan.setups}
    elif observations.kind == ImageCoordinates.kind:
        times = {one.name: one.readings for one in plan.photos}
    count = np.array([times.get(trace.ids[i][0], 1) for i in rows])
    turn = np.zeros(len(rows))
    if trace.table == "directions":
        turn = (1.0 - 1.0 / count) * _share_of_set(observations)
    return SingleReadings(np.arange(len(rows)), 1.0 / count, count, turn)


def _share_of_set(directions):
    """(n,) share of each direction in the weight of its set."""
    weight = directions.using(np.ones(len(directions))).weight[:, 0] ** 2
    return weight / np.bincount(directions.set, weight)[directions.set]


def _of_ties(plan, observations, trace, rows):
    """Ties of one line may differ in their sds: each is a lot of readings that are alike."""
    lots = defaultdict(list)
    for one in plan.ties:
        if one.table == trace.table and one.sd_m > 0:
            line = _line(one.table, (one.start, one.end), one.instrument, one.kind == "horizontal")
            lots[line].append((one.sd_m**-2, one.readings))
    flat, of, share, count = getattr(observations, "horizontal", False), [], [], []
    for number, i in enumerate(rows):
        mine = lots[_line(trace.table, trace.ids[i], trace.group[i], flat)]
        weight, times = np.array(mine).T
        of += [number] * len(mine)
        share += (weight / (weight @ times)).tolist()
        count += times.astype(int).tolist()
    return SingleReadings(np.array(of), np.array(share), np.array(count), np.zeros(len(of)))


def _line(table, ends, instrument, flat):
    """What readings of one line have in common; a tape is read either way."""
    if table != "distances":
        return tuple(ends)
    return frozenset(ends), instrument or "", bool(flat)
