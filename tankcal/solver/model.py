"""What a problem hands to the solver, and what the solver keeps of it."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Group:
    """Observations of one kind, n of them with m rows each; every row is one whitened equation.

    columns  (n, K) unknown of each derivative, -1 where that one is fixed
    rows     m
    fill     fill(state, w, jac) writes misclosures (computed minus observed, over the sd) into
             w (n, m) and derivatives into jac (n, m, K); a jac of length 0 is left out
    """

    columns: np.ndarray
    rows: int
    fill: Callable


@dataclass(frozen=True)
class Model:
    """A least-squares problem: minimise the sum of squares of all rows.

    reduced     number of unknowns of the reduced system; they come first
    blocks      number of eliminated blocks of three unknowns; they come last
    groups      tuple of Group; no row touches two eliminated blocks
    moved       moved(state, step) -> state, step (reduced + 3 blocks,)
    null_space  null_space(state) -> (unknowns, d) directions in which nothing is observed (a datum
                to be chosen), or None when the observations give the datum
    name_of     name_of(column) -> what the user calls that unknown
    in_words    in_words(directions) -> the unknowns that take part in directions (unknowns, d), all
                columns of length one, in words; None: their names
    inner       (unknowns,) 1 where an unknown takes part in the inner constraints that choose the
                datum of the free directions, else 0
    exact       tuple of Group: rows that are zero exactly, between reduced unknowns only
    name_of_exact  name_of_exact(row) -> what the user calls that row, all rows of `exact` counted
    """

    reduced: int
    blocks: int
    groups: tuple
    moved: Callable
    null_space: Callable = None
    name_of: Callable = str
    in_words: Callable = None
    inner: np.ndarray = None
    exact: tuple = ()
    name_of_exact: Callable = str

    def in_datum(self, state, step):
        """A step (unknowns,) without what the inner constraints forbid; there may be none."""
        if self.null_space is None:
            return step
        null_space = self.null_space(state)
        datum_basis = null_space * self.inner[:, None]
        return step - null_space @ np.linalg.solve(datum_basis.T @ null_space, datum_basis.T @ step)

    @property
    def unknowns(self):
        """Number of unknowns."""
        return self.reduced + 3 * self.blocks


@dataclass
class Normals:
    """Normal equations while they are built and eliminated (see tankcal.solver.loops).

    v (nb, 6), b (nb, 3), wide (t + 1, 3), t (nr + 1, nr + 1), g (nr + 1,)
    """

    v: np.ndarray
    b: np.ndarray
    wide: np.ndarray
    t: np.ndarray
    g: np.ndarray

    @classmethod
    def zero(cls, plan):
        """Nothing added yet."""
        return cls(
            np.zeros((plan.blocks, 6)),
            np.zeros((plan.blocks, 3)),
            np.zeros((len(plan.columns) + 1, 3)),
            np.zeros((plan.reduced + 1, plan.reduced + 1)),
            np.zeros(plan.reduced + 1),
        )

    def clear(self):
        """Start again without asking for memory."""
        for array in (self.v, self.b, self.wide, self.t, self.g):
            array.fill(0.0)
