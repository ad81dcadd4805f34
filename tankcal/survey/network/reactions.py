"""What pulls at coordinates that are held: each one tested by what its release would say.

A held coordinate d is no unknown. With whitened rows A of the unknowns, C of the held coordinate,
w the misclosures, and D of exact conditions, releasing it changes the unknowns by X and the rows by

    R = C + A X,   X the least-squares answer to C under D X = -D_held
    change = -R'w / R'R,   sd = 1 / sqrt(R'R),   test quantity = change / sd

the limit of the w-test of an observed coordinate for its sd going to 0: -R'w is the constraint
reaction (Lagrange multiplier). R'R is never formed as a difference, so that it stays positive.
Source: Koch 1999, section 3.2.7; Baarda 1968.
"""

from dataclasses import dataclass, replace

import numpy as np
import scipy.sparse

from tankcal.adjust import ALPHA, POWER, noncentrality
from tankcal.solver.effects import constraint_reactions, sparse_rows
from tankcal.survey.network.reliability import Residuals

HELD = "held coordinates"  # source of their Residuals; rows are 3 point + axis
UNTESTED = 1e-10  # share of R'R in C'C below which only rounding is left of it
CONTRADICTED = 1e-9  # change of a condition by a release that nothing else can follow
AT_ONCE = 4e6  # numbers of a dense part that is worked on at a time


@dataclass(frozen=True)
class Reactions:
    """Reactions of k held coordinates.

    rows      (k,) 3 point + axis
    reaction  (k,) -R'w, what pulls at each      square  (k,) R'R; 0: nothing controls it
    changes   (unknowns, k) X                    layout  with a column for each held coordinate
    """

    rows: np.ndarray
    reaction: np.ndarray
    square: np.ndarray
    changes: np.ndarray
    layout: object

    @property
    def w(self):
        """(k,) test quantities; 0 where nothing controls a coordinate."""
        size = np.sqrt(np.where(self.square > 0, self.square, 1.0))
        return np.where(self.square > 0, self.reaction / size, 0.0)

    def residuals(self, problem, alpha=ALPHA, power=POWER):
        """Their Residuals: residual and sd 0; w, mdb and effect by the reactions.

        Released, a coordinate would change by w mdb / delta0 (see `noncentrality`), with an sd of
        mdb / delta0. Where nothing controls it, mdb is infinite.
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
    """The Reactions of held coordinates; fixed (points, 3) True for those that are asked for."""
    used = ~problem.aside
    held = np.flatnonzero(fixed & used[:, None] & (problem.layout.points < 0))
    unknowns, k = problem.model.unknowns, len(held)
    points = problem.layout.points.copy()
    points.flat[held] = unknowns + np.arange(k)
    layout = replace(problem.layout, points=points)
    a = _rows_of(
        zip(problem.observations, solution.cofactor.jacobians, strict=True), layout, unknowns + k
    )
    a, c = a[:, :unknowns], a[:, unknowns:]
    x = -solution.cofactor.times((a.T @ c).toarray())
    sound = np.ones(k, dtype=bool)
    if problem.exact:
        x, sound = _conditioned(problem, solution, layout, x)
    w = np.concatenate([np.zeros(0), *(one.ravel() for one in solution.normalised)])
    reaction, square, step = np.zeros(k), np.zeros(k), max(1, int(AT_ONCE / max(len(w), 1)))
    for first in range(0, k, step):
        part = slice(first, first + step)
        r = c[:, part].toarray() + a @ x[:, part]
        reaction[part], square[part] = -(r.T @ w), np.einsum("nk,nk->k", r, r)
    sound &= square > UNTESTED * np.asarray(c.multiply(c).sum(axis=0)).ravel()
    return Reactions(held, reaction, np.where(sound, square, 0.0), x, layout)


def _rows_of(parts, layout, width):
    """Sparse rows (all, width) of pairs (observations, derivatives (n, m, K)) in a layout."""
    found = [sparse_rows(width, one.columns(layout), jac) for one, jac in parts]
    return scipy.sparse.vstack([scipy.sparse.csr_array((0, width)), *found], format="csr")


def _conditioned(problem, solution, layout, x):
    """X with what exact conditions ask for when a coordinate is released, and where they can."""
    unknowns, parts = problem.model.unknowns, []
    for held in problem.exact:
        one = held.conditions
        jac = np.empty((len(one), one.rows, one.columns(layout).shape[1]))
        one.fill(solution.unknowns, np.empty(jac.shape[:2]), jac)
        parts.append((one, jac))
    d = _rows_of(parts, layout, unknowns + x.shape[1])
    d, d_held = d[:, :unknowns], d[:, unknowns:].toarray()
    if not d_held.any():
        return x, np.ones(x.shape[1], dtype=bool)
    x = x - constraint_reactions(solution.cofactor)[2] @ d_held
    left = np.abs(d_held + d @ x).max(axis=0, initial=0.0)
    return x, left < CONTRADICTED
