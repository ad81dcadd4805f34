"""Columns of points that may be of the wall or of a fitting: how they count, and what is told.

The table lies halfway between the wall with such a column and the wall without it, and half of the
difference is its standard uncertainty: that is what a quantity has that is one of two values, each
as likely. It covers both, for U is about the whole half.
"""

import numpy as np

from tankcal.geometry.shell import UNDECIDED
from tankcal.messages import list_some, message
from tankcal.tank.body import Factor

ALIKE = 1 / 3  # correlation of two columns: the share that is wall may be any from 0 to 1


def undecided_halves(shell, accepted, groups):
    """Half of what points in undecided columns depart by from the wall without them.

    Parameters
    ----------
    shell : Shell
    accepted : ndarray of int, shape (m,)
        Points on the wall, or on such columns.
    groups : sequence of Group
        With indices into `accepted`.

    Returns
    -------
    ndarray, shape (m, columns)
        In the order of the groups' members, m.
    """
    order = accepted[np.concatenate([group.members for group in groups])]
    columns = np.arange(shell.column.max(initial=-1) + 1)
    return 0.5 * shell.residual_m[order, None] * np.equal.outer(shell.column[order], columns)


def factors_of_undecided(halves):
    """`Factor`s of what undecided columns leave uncertain; () without any.

    Parameters
    ----------
    halves : ndarray, shape (f, columns)
        Half of what each changes of features.

    Returns
    -------
    tuple of Factor

    Notes
    -----
    Column i is wall with a probability p that nobody knows: of a p that may as well be any from 0
    to 1 its variance is 1/4, and the covariance of two is that of p, 1/12. So neither many seams
    nor many pipes of one tank average out.

    Examples
    --------
    >>> factor, = factors_of_undecided(np.array([[3.0, 3.0]]))
    >>> round(float(np.sum(factor.columns**2)), 9)  # 9 + 9, and twice 9 / 3
    24.0
    """
    if not np.any(halves):
        return ()
    own, common = np.sqrt(1 - ALIKE) * halves, np.sqrt(ALIKE) * halves.sum(axis=1, keepdims=True)
    return (Factor("undecided", np.hstack([own, common]), type="B"),)


def tell_undecided(names, shell, most):
    """(text,) of a warning that names the points; () without any.

    names  (n,) of the points; most  that are named
    """
    found = np.flatnonzero(shell.reason == UNDECIDED)
    if not len(found):
        return ()
    return (
        message(
            "undecided_columns",
            "{count} points one above another, up to {deep_mm:.0f} mm off the wall, may be a seam "
            "of it, or a pipe or bracket before it ({points}): the table lies halfway, and U has "
            "the difference; take out the points of fittings, or keep all with snooping = false",
            count=len(found),
            deep_mm=1000 * np.abs(shell.residual_m[found]).max(),
            points=list_some([names[i] for i in found], most),
        ),
    )
