"""Conditions between the reduced unknowns that hold exactly: c(x) = 0, of no weight whatever.

With columns scaled (D) and C D = R' Q1', [Q1 Q2] orthogonal, every step stays in the null space,

    dx = D Q2 y,   (Q2' D S D Q2) y = -Q2' D g,   Q_xx = D Q2 (Q2' D S D Q2)^-1 Q2' D

and after each step the nearest point (in scaled unknowns) at which c = 0 is sought by Newton's
method. What pulls at the conditions, C'k = -g, tests them: k = R^-T.. has the cofactor matrix
R^-1 (S11 - S12 S22^-1 S21) R^-T. No S needs to be regular but the one in the null space, so that
conditions may give the datum. Source: Koch 1999, Parameter Estimation and Hypothesis Testing,
section 3.2.7; Golub & Van Loan 2013, section 6.2.
"""

import numpy as np
import scipy.linalg

from tankcal.errors import SolutionError

DEPENDENT = 1e-9  # pivot of a row, all rows of length one: below it the row follows from others
CONTRADICTION = 1e-6  # m or rad, what a dependent row may be off: more than typed digits allow
CLOSED = 1e-9  # step that closes the conditions, in what it changes in the rows
ROUNDED = 1e-9  # m or rad, of conditions that are off by rounding where steps no longer shrink
ROUNDS = 25
NAMES_SHOWN = 6


class Conditions:
    """The exact conditions of a Model: m rows between nr reduced unknowns."""

    def __init__(self, model):
        self.model, self.groups, self.reduced = model, model.exact, model.reduced
        for group in self.groups:
            if (group.columns >= model.reduced).any():
                raise ValueError("an exact condition touches an eliminated block")
        self.rows = sum(len(group.columns) * group.rows for group in self.groups)

    def __bool__(self):
        return self.rows > 0

    def evaluate(self, state):
        """Misclosures (m,) and derivatives (m, nr)."""
        c, derivatives, first = np.zeros(self.rows), np.zeros((self.rows, self.reduced + 1)), 0
        for group in self.groups:
            n, m = len(group.columns), group.rows
            w, jac = np.zeros((n, m)), np.zeros((n, m, group.columns.shape[1]))
            group.fill(state, w, jac)
            mine = slice(first, first + n * m)
            place = np.broadcast_to(group.columns[:, None, :], jac.shape).reshape(n * m, -1)
            np.add.at(derivatives[mine], (np.arange(n * m)[:, None], place), jac.reshape(n * m, -1))
            c[mine], first = w.ravel(), first + n * m
        return c, derivatives[:, :-1]

    def tangent(self, state, scale):
        """The Tangent at a state; scale (nr,) of the columns."""
        return Tangent(self.evaluate(state)[1] * scale)

    def closed(self, state, scale, strict=False):
        """The nearest state at which the conditions hold; None, or an error, when there is none."""
        before = np.inf
        for _ in range(ROUNDS):
            c, derivatives = self.evaluate(state)
            if not np.isfinite(c).all() or not np.isfinite(derivatives).all():
                return None
            tangent = Tangent(derivatives * scale)
            step = tangent.closing(c)
            whole = np.zeros(self.model.unknowns)
            whole[: self.reduced] = scale * step
            state = self.model.moved(state, self.model.in_datum(state, whole))
            size = np.linalg.norm(step)
            off = np.abs(c[tangent.independent]).max(initial=0.0)
            if size < CLOSED or (size > before / 2 and off < ROUNDED):
                self._refuse_contradiction(tangent, state)
                return state
            before = size
        if strict:
            raise SolutionError(self._in_words(self.evaluate(state)[0], range(self.rows)))
        return None

    def _refuse_contradiction(self, tangent, state):
        c = self.evaluate(state)[0]
        if np.abs(c).max() > CONTRADICTION:
            involved = [*tangent.companions(int(np.argmax(np.abs(c))))]
            raise SolutionError(self._in_words(c, involved))

    def _in_words(self, c, rows):
        off = np.abs(c)
        rows = sorted(rows, key=lambda row: -off[row])[:NAMES_SHOWN]
        names = ", ".join(self.model.name_of_exact(row) for row in rows)
        return (
            f"values held exactly contradict one another, by {off.max():.2g} m or rad: {names}; "
            "give one of them a standard deviation or leave it out"
        )


class Tangent:
    """What conditions with derivatives (m, nr), columns scaled, leave free at a state.

    rank         number of independent conditions     independent  (rank,) which ones
    touched      (nr,) True: an unknown that occurs in one
    """

    def __init__(self, derivatives):
        lengths = np.linalg.norm(derivatives, axis=1)
        self.lengths = np.where(lengths > 0, lengths, 1.0)
        self._rows = derivatives / self.lengths[:, None]
        self.touched = derivatives.any(axis=0)
        packed, order, tau, _, _ = scipy.linalg.lapack.dgeqp3(self._rows.T)
        pivots = np.abs(np.diag(packed))
        self.rank = int(np.count_nonzero(pivots > DEPENDENT))
        self.independent = order[: self.rank] - 1
        self.r = np.triu(packed[: self.rank, : self.rank])
        self._packed, self._tau = np.asfortranarray(packed[:, : self.rank]), tau[: self.rank]

    def _turned(self, matrix, transposed):
        """Q' matrix, or Q matrix; matrix (nr,) or (nr, k)."""
        if not self.rank:
            return matrix
        flat = matrix.ndim == 1
        columns = np.array(matrix[:, None] if flat else matrix, order="F")
        size = max(64 * columns.shape[1], 1)
        out, _, info = scipy.linalg.lapack.dormqr(
            "L", "T" if transposed else "N", self._packed, self._tau, columns, size
        )
        if info:
            raise ValueError(f"dormqr: {info}")
        return out[:, 0] if flat else out

    def split(self, matrix):
        """Parts Q1' M and Q2' M of a matrix (nr,) or (nr, k)."""
        turned = self._turned(matrix, True)
        return turned[: self.rank], turned[self.rank :]

    def in_null_space(self, matrix):
        """Q2' M: the part in the null space of a matrix (nr,) or (nr, k)."""
        return self.split(matrix)[1]

    def from_null_space(self, inner, outer=None):
        """Q2 inner (+ Q1 outer): (nr,) or (nr, k) from the part in the null space."""
        above = np.zeros((self.rank, *inner.shape[1:])) if outer is None else outer
        return self._turned(np.concatenate([above, inner]), False)

    def square(self, s):
        """Q2' S Q2 of a symmetric matrix (nr, nr), and Q1' S Q of its other part (rank, nr)."""
        turned = self._turned(self._turned(s, True).T, True)
        return turned[self.rank :, self.rank :], turned[: self.rank]

    def closing(self, c):
        """The shortest step (nr,), scaled, that closes misclosures (m,) of independent rows."""
        right = (c / self.lengths)[self.independent]
        y = scipy.linalg.solve_triangular(self.r, -right, trans=1) if self.rank else right
        return self.from_null_space(np.zeros(self._rows.shape[1] - self.rank), y)

    def companions(self, row):
        """Rows with which a dependent row is tied up."""
        share = np.linalg.lstsq(self._rows[self.independent].T, self._rows[row], rcond=None)[0]
        return [row, *self.independent[np.abs(share) > 1e-3].tolist()]
