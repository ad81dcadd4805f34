"""Columns of points that belong either to the wall or to a fitting, and their uncertainty.

The table lies midway between the wall with such a column and the wall without it. Half of the
difference is the standard uncertainty, as for a quantity with two equally probable values. U is
about twice this half and covers both.
"""

import numpy as np

from tankcal.geometry.shell import UNDECIDED
from tankcal.messages import list_some, message
from tankcal.tank.body import Factor

ALIKE = 1 / 3  # correlation of two columns, for a share of wall uniform from 0 to 1


def undecided_halves(shell, accepted, groups):
    """Half of the deviation of points in undecided columns from the wall without them.

    Parameters
    ----------
    shell : Shell
    accepted : ndarray of int, shape (m,)
        Points on the wall, or in such columns.
    groups : sequence of Group
        Groups of indices into `accepted`.

    Returns
    -------
    ndarray, shape (m, columns)
        In the order of the groups' members, m.
    """
    order = accepted[np.concatenate([group.members for group in groups])]
    columns = np.arange(shell.column.max(initial=-1) + 1)
    return 0.5 * shell.residual_m[order, None] * np.equal.outer(shell.column[order], columns)


def factors_of_undecided(halves):
    """`Factor`s of the uncertainty due to undecided columns; () without any.

    Parameters
    ----------
    halves : ndarray, shape (f, columns)
        Half of the change of the features due to each column.

    Returns
    -------
    tuple of Factor

    Notes
    -----
    Column i belongs to the wall with an unknown probability p. For p uniform from 0 to 1 its
    variance is 1/4. The covariance of two columns is the variance of p, 1/12. Therefore many seams
    or many pipes of a tank do not average out.

    Examples
    --------
    >>> factor, = factors_of_undecided(np.array([[3.0, 3.0]]))
    >>> round(float(np.sum(factor.columns**2)), 9)  # 9 + 9, and twice 9 / 3
    24.0
    """
    if not np.any(halves):
        return ()
    # One part per column and one common part give equal correlations `ALIKE`.
    separate, common = (
        np.sqrt(1 - ALIKE) * halves,
        np.sqrt(ALIKE) * halves.sum(axis=1, keepdims=True),
    )
    return (Factor("undecided", np.hstack([separate, common])),)


def tell_undecided(names, shell, most):
    """Text of a warning that names the points in undecided columns, in a tuple; () without any.

    Parameters
    ----------
    names : sequence of str, length n
        Names of the points.
    shell : Shell
    most : int
        Largest number of names in the text.

    Returns
    -------
    tuple
    """
    undecided = np.flatnonzero(shell.reason == UNDECIDED)
    if not len(undecided):
        return ()
    return (
        message(
            "undecided_columns",
            "{count} points one above another, up to {deep_mm:.0f} mm off the wall, may be a seam "
            "of it, or a pipe or bracket before it ({points}): the table lies halfway, and U has "
            "the difference; take out the points of fittings, or keep all with snooping = false",
            count=len(undecided),
            deep_mm=1000 * np.abs(shell.residual_m[undecided]).max(),
            points=list_some([names[i] for i in undecided], most),
        ),
    )
