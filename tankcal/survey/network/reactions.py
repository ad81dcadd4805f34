"""Reactions of held coordinates: each is tested by the effect of its release.

A held coordinate d is not an unknown. With whitened rows A of the unknowns, C of the held
coordinate, w the misclosures, and D of exact conditions, its release changes the unknowns by X and
the rows by

    R = C + A X,   X the least squares answer to C under D X = -D_held
    change = -R'w / R'R,   sd = 1 / sqrt(R'R),   test statistic = change / sd

This is the limit of the w-test of an observed coordinate whose sd approaches 0; -R'w is the
constraint reaction (Lagrange multiplier). R'R is not formed as a difference, so that it stays
positive. Source: Koch 1999, section 3.2.7; Baarda 1968.
"""

from dataclasses import dataclass, replace

import numpy as np
import scipy.sparse

from tankcal.adjust import ALPHA, POWER, noncentrality
from tankcal.solver.effects import constraint_reactions, sparse_rows
from tankcal.survey.network.reliability import Residuals

HELD = "held coordinates"  # source of their Residuals; rows are 3 point + axis
UNTESTED = 1e-10  # share of R'R in C'C below which R'R is rounding
CONTRADICTED = 1e-9  # change of a condition by a release that no unknown can follow
AT_ONCE = 4e6  # elements of a dense part processed at a time


@dataclass(frozen=True)
class Reactions:
    """Reactions of k held coordinates.

    Attributes
    ----------
    rows : ndarray of int, shape (k,)
        3 point + axis.
    reaction : ndarray, shape (k,)
        -R'w.
    square : ndarray, shape (k,)
        R'R; 0: not controlled.
    changes : ndarray, shape (unknowns, k)
        X.
    layout : Layout
        With a column for each held coordinate.
    """

    rows: np.ndarray
    reaction: np.ndarray
    square: np.ndarray
    changes: np.ndarray
    layout: object

    @property
    def w(self):
        """Test statistics (k,); 0 for coordinates that are not controlled."""
        size = np.sqrt(np.where(self.square > 0, self.square, 1.0))
        return np.where(self.square > 0, self.reaction / size, 0.0)

    def residuals(self, problem, alpha=ALPHA, power=POWER):
        """Residuals of the held coordinates: residual and sd 0; w, mdb and effect from the
        reactions.

        A released coordinate would change by w mdb / delta0 (see `noncentrality`), with an sd of
        mdb / delta0. Without control, mdb is infinite.

        Parameters
        ----------
        problem : Problem
        alpha, power : float

        Returns
        -------
        Residuals
        """
        columns = np.unique(problem.layout.points)
        moves = np.abs(self.changes[columns[columns >= 0]]).max(axis=0, initial=0.0)
        with np.errstate(divide="ignore"):
            mdb = noncentrality(alpha, power) / np.sqrt(self.square)
        none = np.zeros((len(self.rows), 1))
        return Residuals(
            kind="control coordinate", unit="m", source=HELD, rows=self.rows,
            used=np.ones(len(self.rows), dtype=bool), residual=none, sd=none, redundancy=none,
            w=self.w[:, None], test_statistic=np.abs(self.w), mdb=mdb[:, None],
            external=np.full(none.shape, np.inf), exact=True,
            changes=lambda: (moves[:, None], None),
        )  # fmt: skip


def reactions(problem, solution, fixed):
    """Compute the Reactions of held coordinates.

    Parameters
    ----------
    problem : Problem
    solution : solver solution
    fixed : ndarray of bool, shape (points, 3)
        Held coordinates to test.

    Returns
    -------
    Reactions
    """
    is_used = ~problem.aside
    held = np.flatnonzero(fixed & is_used[:, None] & (problem.layout.points < 0))
    unknowns, k = problem.model.unknowns, len(held)
    points = problem.layout.points.copy()
    # Append a column for each held coordinate, to obtain its derivatives C.
    points.flat[held] = unknowns + np.arange(k)
    layout = replace(problem.layout, points=points)
    a = _rows_of(
        zip(problem.observations, solution.cofactor.jacobians, strict=True), layout, unknowns + k
    )
    a, c = a[:, :unknowns], a[:, unknowns:]
    # Unconstrained answer: X = -N^-1 A' C.
    x = -solution.cofactor.times((a.T @ c).toarray())
    sound = np.ones(k, dtype=bool)
    if problem.exact:
        x, sound = _apply_conditions(problem, solution, layout, x)
    w = np.concatenate([np.zeros(0), *(values.ravel() for values in solution.normalised)])
    reaction, square, step = np.zeros(k), np.zeros(k), max(1, int(AT_ONCE / max(len(w), 1)))
    # R is dense; work in slices to limit memory.
    for first in range(0, k, step):
        part = slice(first, first + step)
        r = c[:, part].toarray() + a @ x[:, part]
        reaction[part], square[part] = -(r.T @ w), np.einsum("nk,nk->k", r, r)
    sound &= square > UNTESTED * np.asarray(c.multiply(c).sum(axis=0)).ravel()
    return Reactions(held, reaction, np.where(sound, square, 0.0), x, layout)


def _rows_of(parts, layout, width):
    """Sparse rows (all, width) of pairs (observations, derivatives (n, m, K)) in a layout."""
    blocks = [sparse_rows(width, observations.columns(layout), jac) for observations, jac in parts]
    return scipy.sparse.vstack([scipy.sparse.csr_array((0, width)), *blocks], format="csr")


def _apply_conditions(problem, solution, layout, x):
    """Return X under the exact conditions, and a mask (k,) of releases that the conditions
    permit."""
    unknowns, parts = problem.model.unknowns, []
    for held in problem.exact:
        conditions_of_group = held.conditions
        jac = np.empty(
            (
                len(conditions_of_group),
                conditions_of_group.rows,
                conditions_of_group.columns(layout).shape[1],
            )
        )
        conditions_of_group.fill(solution.unknowns, np.empty(jac.shape[:2]), jac)
        parts.append((conditions_of_group, jac))
    d = _rows_of(parts, layout, unknowns + x.shape[1])
    d, d_held = d[:, :unknowns], d[:, unknowns:].toarray()
    if not d_held.any():
        return x, np.ones(x.shape[1], dtype=bool)
    x = x - constraint_reactions(solution.cofactor)[2] @ d_held
    # If the conditions cannot be met after a release, the coordinate cannot be released.
    remaining = np.abs(d_held + d @ x).max(axis=0, initial=0.0)
    return x, remaining < CONTRADICTED
