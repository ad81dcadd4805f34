"""The independent coordinates that a table is simulated with, each of them in units of its u.

A source of one column is a coordinate with the distribution of its input. The columns of a source
that were found together (points, form) have a common scale: whatever one volume says of them is
|c| T with T of Student's t for their degrees of freedom, the same as one coordinate of size |c|
(multivariate t, JCGM 101:2008 6.4.9); the form, whose variance is what residuals show beyond their
noise, is an `UnsureNormal`. Normal sources that were computed are pooled in the same way.

Correlated inputs are x = L e with R = L L': each e has the shape of its own input. Normal ones are
jointly normal then (6.4.8); of others the covariances hold, and the shape of the first.
"""

from dataclasses import dataclass

import numpy as np

from tankcal.gum.distributions import UnsureNormal, standard


@dataclass(frozen=True)
class Coordinates:
    """distributions (n,); slopes (volumes, n) m3; place {name of a declared input: its number}."""

    distributions: tuple
    slopes: np.ndarray
    place: dict


def coordinates(sources):
    """`Coordinates` of sources whose columns have one row for each volume."""
    distributions, slopes, place = [], [], {}
    normal_squares = 0.0
    for source in sources:
        own = source.columns_m3.T
        if source.parts:
            distributions += [_distribution(part) for part in source.parts]
            slopes += list(own)
            continue
        if not _has_own(source):
            squares = np.sum(own**2, axis=0)
            if np.isinf(source.dof):
                normal_squares = normal_squares + squares
                continue
            own = [np.sqrt(squares)]
        elif len(own) == 1:
            place[source.kind] = len(distributions)
        distributions += [_distribution(source)] * len(own)
        slopes += list(own)
    if np.any(normal_squares):
        distributions.append(standard(1.0))
        slopes.append(np.sqrt(normal_squares))
    rows = len(sources[0].columns_m3) if sources else 0
    stacked = np.stack(slopes, axis=1) if slopes else np.empty((rows, 0))
    return Coordinates(tuple(distributions), stacked, place)


def _has_own(source):
    """Whether its columns stand for themselves: a declared input, or one that is not normal."""
    return source.u is not None or source.distribution not in ("normal", "t")


def _distribution(source):
    """Of readings Student's t (JCGM 101:2008 6.4.9), normal for infinitely many."""
    if source.dof < source.contrasts < np.inf:
        return UnsureNormal(1.0, source.contrasts, dof=source.dof)
    return standard(1.0, source.distribution, dof=source.dof, u_is=source.u_is)
