"""Exact conditions c(x) = 0 between the reduced unknowns; they have no weight.

With scaled columns (D) and C D = R' Q1', [Q1 Q2] orthogonal, every step stays in the null space of
the conditions:

    dx = D Q2 y,   (Q2' D S D Q2) y = -Q2' D g,   Q_xx = D Q2 (Q2' D S D Q2)^-1 Q2' D

After each step, Newton's method finds the nearest point, in scaled unknowns, with c = 0. The
reactions k with C'k = -g test the conditions. Their cofactor matrix is R^-1 (S11 - S12 S22^-1 S21)
R^-T. Only the part of S in the null space must be regular, so that conditions may define the datum.

Source: Koch 1999, Parameter Estimation and Hypothesis Testing, section 3.2.7; Golub & Van Loan
2013, section 6.2.
"""

import numpy as np
import scipy.linalg

from tankcal.errors import SolutionError

DEPENDENT = 1e-9  # pivot of a row of length one; below it the row depends on other rows
CONTRADICTION = 1e-6  # m or rad, largest misclosure of a dependent row; exceeds rounding of input
CLOSED = 1e-9  # norm of the closing step at convergence, in scaled unknowns
ROUNDED = 1e-9  # m or rad, misclosure accepted as rounding once the steps no longer shrink
ROUNDS = 25  # Newton iterations; convergence is quadratic
NAMES_SHOWN = 6  # conditions named in an error message


class Conditions:
    """Exact conditions of a Model: m rows between nr reduced unknowns.

    Parameters
    ----------
    model : Model
        The model.

    Raises
    ------
    ValueError
        If a condition contains an unknown of an eliminated block.
    """

    def __init__(self, model):
        self.model, self.groups, self.reduced = model, model.exact, model.reduced
        for group in self.groups:
            if (group.columns >= model.reduced).any():
                raise ValueError("an exact condition touches an eliminated block")
        self.rows = sum(len(group.columns) * group.rows for group in self.groups)

    def __bool__(self):
        return self.rows > 0

    def evaluate(self, state):
        """Misclosures (m,) and derivatives (m, nr) at a state."""
        c, derivatives, first = np.zeros(self.rows), np.zeros((self.rows, self.reduced + 1)), 0
        for group in self.groups:
            n, m = len(group.columns), group.rows
            w, jac = np.zeros((n, m)), np.zeros((n, m, group.columns.shape[1]))
            group.fill(state, w, jac)
            part = slice(first, first + n * m)
            place = np.broadcast_to(group.columns[:, None, :], jac.shape).reshape(n * m, -1)
            np.add.at(derivatives[part], (np.arange(n * m)[:, None], place), jac.reshape(n * m, -1))
            c[part], first = w.ravel(), first + n * m
        # The last column collects the derivatives by fixed unknowns.
        return c, derivatives[:, :-1]

    def tangent(self, state, scale):
        """Tangent of the conditions at a state, for the scale (nr,) of the columns."""
        return Tangent(self.evaluate(state)[1] * scale)

    def closed(self, state, scale, strict=False):
        """Find the nearest state at which the conditions hold.

        Parameters
        ----------
        state : object
            Start of the search.
        scale : ndarray, shape (nr,)
            Scale factors of the columns.
        strict : bool, optional
            If True, raise an error instead of returning None.

        Returns
        -------
        object or None
            The state, or None without convergence.

        Raises
        ------
        SolutionError
            If the conditions contradict each other.
        """
        previous_size = np.inf
        for _ in range(ROUNDS):
            c, derivatives = self.evaluate(state)
            if not np.isfinite(c).all() or not np.isfinite(derivatives).all():
                return None
            tangent = Tangent(derivatives * scale)
            step = tangent.closing(c)
            whole = np.zeros(self.model.unknowns)
            whole[: self.reduced] = scale * step
            # The step may leave the datum of a free network; in_datum removes that part.
            state = self.model.moved(state, self.model.in_datum(state, whole))
            size = np.linalg.norm(step)
            misclosure = np.abs(c[tangent.independent]).max(initial=0.0)
            # Converged, or stalled at the level of rounding.
            if size < CLOSED or (size > previous_size / 2 and misclosure < ROUNDED):
                self._refuse_contradiction(tangent, state)
                return state
            previous_size = size
        if strict:
            raise SolutionError(
                self._describe_contradiction(self.evaluate(state)[0], range(self.rows))
            )
        return None

    def _refuse_contradiction(self, tangent, state):
        """Raise SolutionError if a dependent condition does not hold at the state."""
        c = self.evaluate(state)[0]
        if np.abs(c).max() > CONTRADICTION:
            involved = [*tangent.companions(int(np.argmax(np.abs(c))))]
            raise SolutionError(self._describe_contradiction(c, involved))

    def _describe_contradiction(self, c, rows):
        """Message on contradicting conditions, the largest misclosures first."""
        gaps = np.abs(c)
        rows = sorted(rows, key=lambda row: -gaps[row])[:NAMES_SHOWN]
        names = ", ".join(self.model.name_of_exact(row) for row in rows)
        return (
            f"values held exactly contradict one another, by {gaps.max():.2g} m or rad: {names}; "
            "give one of them a standard deviation or leave it out"
        )


class Tangent:
    """Tangent space of conditions with derivatives (m, nr) in scaled columns.

    Parameters
    ----------
    derivatives : ndarray, shape (m, nr)
        Derivatives of the conditions.

    Attributes
    ----------
    rank : int
        Number of independent conditions.
    independent : ndarray of int, shape (rank,)
        Indices of the independent conditions.
    touched : ndarray of bool, shape (nr,)
        True for an unknown that occurs in a condition.
    lengths : ndarray, shape (m,)
        Lengths of the rows before scaling to length one.
    r : ndarray, shape (rank, rank)
        R of the QR factorisation.
    """

    def __init__(self, derivatives):
        lengths = np.linalg.norm(derivatives, axis=1)
        self.lengths = np.where(lengths > 0, lengths, 1.0)
        self._rows = derivatives / self.lengths[:, None]
        self.touched = derivatives.any(axis=0)
        # QR with column pivoting of the transposed rows: the pivots separate independent from
        # dependent conditions.
        packed, order, tau, _, _ = scipy.linalg.lapack.dgeqp3(self._rows.T)
        pivots = np.abs(np.diag(packed))
        self.rank = int(np.count_nonzero(pivots > DEPENDENT))
        self.independent = order[: self.rank] - 1
        self.r = np.triu(packed[: self.rank, : self.rank])
        self._packed, self._tau = np.asfortranarray(packed[:, : self.rank]), tau[: self.rank]

    def _multiply_by_q(self, matrix, transposed):
        """Multiply a matrix (nr,) or (nr, k) by Q' (transposed) or by Q."""
        if not self.rank:
            return matrix
        flat = matrix.ndim == 1
        columns = np.array(matrix[:, None] if flat else matrix, order="F")
        # Workspace for the blocked algorithm of LAPACK.
        size = max(64 * columns.shape[1], 1)
        out, _, info = scipy.linalg.lapack.dormqr(
            "L", "T" if transposed else "N", self._packed, self._tau, columns, size
        )
        if info:
            raise ValueError(f"dormqr: {info}")
        return out[:, 0] if flat else out

    def split(self, matrix):
        """Parts Q1' M and Q2' M of a matrix (nr,) or (nr, k)."""
        product = self._multiply_by_q(matrix, True)
        return product[: self.rank], product[self.rank :]

    def in_null_space(self, matrix):
        """Component Q2' M in the null space of a matrix (nr,) or (nr, k)."""
        return self.split(matrix)[1]

    def from_null_space(self, inner, outer=None):
        """Combine Q2 inner + Q1 outer, shape (nr,) or (nr, k); without `outer`, Q2 inner."""
        first_part = np.zeros((self.rank, *inner.shape[1:])) if outer is None else outer
        return self._multiply_by_q(np.concatenate([first_part, inner]), False)

    def square(self, s):
        """Q2' S Q2 of a symmetric matrix S (nr, nr), and Q1' S Q (rank, nr)."""
        product = self._multiply_by_q(self._multiply_by_q(s, True).T, True)
        return product[self.rank :, self.rank :], product[: self.rank]

    def closing(self, c):
        """Shortest step (nr,), scaled, that closes the misclosures (m,) of independent rows."""
        right = (c / self.lengths)[self.independent]
        # R' y = -c, with the step Q1 y; the shortest step has no component in the null space.
        y = scipy.linalg.solve_triangular(self.r, -right, trans=1) if self.rank else right
        return self.from_null_space(np.zeros(self._rows.shape[1] - self.rank), y)

    def companions(self, row):
        """Indices of a dependent row and of the independent rows on which it depends."""
        # The row is a combination of independent rows; rows with a coefficient above 1e-3 count.
        shares = np.linalg.lstsq(self._rows[self.independent].T, self._rows[row], rcond=None)[0]
        return [row, *self.independent[np.abs(shares) > 1e-3].tolist()]
