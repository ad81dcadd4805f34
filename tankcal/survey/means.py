"""Repeated readings become one: weighted means, and whether their scatter is what was declared.

With weights p = 1/s2 of the readings of one value:   mean = sum(p l) / sum(p),   s2 = 1 / sum(p),
chi2 = sum(p (l - mean)2) with one degree of freedom fewer than readings. The adjustment of the
means gives the same unknowns and covariance as that of all readings. Source: Koch 1999, section 3.
"""

from dataclasses import dataclass, replace

import numpy as np
from scipy.special import chdtri

from tankcal.errors import Problem
from tankcal.messages import message

LEVEL = 0.001  # of the tests of scatter, for all readings of a file together


@dataclass(frozen=True)
class Averages:
    """Means of n different values, in the order of their first readings.

    value, sd  (n, m)             first  (n,) number of the first reading
    repeats    (n,)               chi2   (n, m) scatter of the readings, in their sds
    group      (readings,) number of the value that each belongs to
    away       (readings, m) reading minus mean, in sds of the reading
    share      (readings, m) of its weight in that of all readings of the value
    """

    value: np.ndarray
    sd: np.ndarray
    first: np.ndarray
    repeats: np.ndarray
    chi2: np.ndarray
    group: np.ndarray
    away: np.ndarray
    share: np.ndarray


def average_readings(label, value, sd, *, angle=False):
    """The Averages of readings that have the same label.

    label      (n,) whole numbers       value, sd  (n,) or (n, m)
    angle      True: a full turn (rad) is no difference

    Readings that are fixed (sd 0) stay as they are, each on its own.
    """
    n = len(label)
    value, sd = (np.asarray(a, dtype=float).reshape(n, -1 if n else 1) for a in (value, sd))
    fixed = (sd == 0).any(axis=1)
    label = np.where(fixed, np.max(label, initial=0) + 1 + np.arange(n), label)
    _, first, group, repeats = np.unique(
        label, return_index=True, return_inverse=True, return_counts=True
    )
    order = np.argsort(first)
    rank = np.empty_like(order)
    rank[order] = np.arange(len(order))
    first, group, repeats = first[order], rank[group], repeats[order]
    away = value - value[first][group]
    if angle:
        away -= 2 * np.pi * np.round(away / (2 * np.pi))
    weight = 1.0 / np.where(sd > 0, sd, 1.0) ** 2
    total, mean, chi2 = (np.zeros((len(first), value.shape[1])) for _ in range(3))
    np.add.at(total, group, weight)
    np.add.at(mean, group, weight * away)
    mean /= total
    off = np.sqrt(weight) * (away - mean[group])
    np.add.at(chi2, group, off**2)
    mean_sd = np.where((repeats == 1)[:, None], sd[first], 1.0 / np.sqrt(total))
    share = weight / total[group]
    return Averages(value[first] + mean, mean_sd, first, repeats, chi2, group, off, share)


def contradictory_labels(label, averages):
    """Labels (readings,) with which values that one reading alone contradicts are not averaged.

    They scatter more than they may, and not so once the worst is gone: each then goes into the
    adjustment on its own, where the search for blunders finds the worst.
    """
    dof = averages.repeats - 1
    limit, without = (
        chdtri(np.maximum(dof - i, 1), LEVEL / max(np.count_nonzero(dof), 1))[:, None]
        for i in (0, 1)
    )
    single = np.minimum(averages.share, 0.999)
    left = averages.chi2[averages.group] - averages.away**2 / (1 - single)
    agree = (left <= without[averages.group]).all(axis=1)
    torn = (averages.chi2 > limit).any(axis=1) & (dof > 0)
    torn &= np.bincount(averages.group, weights=agree, minlength=len(dof)) > 0
    if not torn.any():
        return label
    own = np.max(label, initial=0) + 1 + np.arange(len(label))
    return np.where(torn[averages.group], own, label)


def average_repeated(one, label, warnings, *, name_of=None, apart=False):
    """Observations of which those of the same value are one, their weighted mean.

    Parameters
    ----------
    one : Observations
        Readings one by one, with their Trace.
    label : ndarray of int, shape (n,)
        The same number for readings of the same value.
    warnings : list of Problem
        To which warnings of scatter are added.
    name_of : callable
        What a value is called in them, of its names and element in the Trace; None: its names.
    apart : bool
        True: values that one reading alone contradicts are not averaged.

    Returns
    -------
    Observations
        In the order of their first readings; the Trace has their number and scatter.
    """
    if not len(one):
        return one
    angle = one.unit == "rad"
    means = average_readings(label, one.value, one.sd, angle=angle)
    warnings += _scatter_warnings(means, one.trace, name_of or _joined)
    torn = contradictory_labels(label, means) if apart else label
    if torn is not label:
        means = average_readings(torn, one.value, one.sd, angle=angle)
    first = one.taken(means.first)
    value, sd = (np.reshape(of, np.shape(first.value)) for of in (means.value, means.sd))
    trace = replace(first.trace, repeats=means.repeats, scatter=means.chi2.sum(axis=1))
    return replace(first, value=value, sd=sd, trace=trace)


def _joined(ids, element):
    return "-".join(ids)


def _scatter_warnings(averages, trace, name_of):
    """Problem rows for repeated readings that scatter other than their sds say.

    averages  Averages       trace  Trace of the readings       name_of  see average_repeated

    Each value is tested, at a level that errs for one file in a thousand; and all values together.
    """
    dof = (averages.repeats - 1)[:, None] * np.ones(averages.chi2.shape[1], dtype=int)
    tested = int(np.count_nonzero(dof))
    if not tested:
        return []
    limit = chdtri(np.maximum(dof, 1), LEVEL / tested)
    ratio = np.where(dof > 0, averages.chi2 / limit, 0.0).max(axis=1)
    found = []
    for i in np.argsort(-ratio)[:5]:
        if ratio[i] > 1:
            share, first = np.sqrt((averages.chi2[i] / dof[i]).max()), averages.first[i]
            text = message(
                "readings_scatter",
                "the {count} readings of {what} scatter {times:.1f} times as much as their standard"
                " deviations say",
                count=averages.repeats[i],
                what=name_of(trace.ids[first], trace.element[first]),
                times=share,
            )
            found.append(Problem(trace.file, text, trace.rows[first]))
    return found + _of_all(averages.chi2.sum(), int(dof.sum()), trace.file, bool(found))


def _of_all(chi2, dof, file, told):
    share = np.sqrt(chi2 / dof)
    high, low = chdtri(dof, [LEVEL / 2, 1 - LEVEL / 2])
    if low <= chi2 <= high or (told and chi2 > high):
        return []
    text = message(
        "all_readings_scatter",
        "all repeated readings together scatter {times:.2f} times as much as their standard"
        " deviations say ({dof} degrees of freedom)",
        times=share,
        dof=dof,
    )
    return [Problem(file, text)]
