"""Hypotheses that explain a suspicious row: select the simplest sufficient one.

Null hypotheses: the rows are smooth after all (a polynomial, or the series of a lying cylinder at
its end), or the area of the cross section jumps (a joint, an edge of deadwood). The curves through
the rows on both sides of a jump then meet between its two rows. Alternatives: one volume is wrong,
two neighbouring volumes are swapped, some rows are shifted together, or two volumes are wrong.

An alternative is accepted if it leaves only rounding about a cubic (or lower degree) while no
hypothesis with fewer parameters does. If rows are too far apart for that, it must leave at most a
sixth of the residuals of the best null hypothesis.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

WIDTHS = 17, 11  # numbers of rows examined together; the second if no simple hypothesis fits
PLAIN = 4  # number of parameters of a cubic
MOST_IN_FEW = 4  # largest number of parameters for few rows: a line and one wrong row
BETTER_FACTOR = 6.0
LEAST_SIZE = 2.5  # smallest error of a volume that rounding does not explain, quanta
POINTS_BETWEEN, TOUCH = 9, 0.02  # points between two rows; smallest relative gap of touching curves
_LEAST_FREE = 1e-6  # smallest share of a block that the curve does not absorb
PRICE = 3.0  # penalty of a parameter, in twice the log likelihood; about the log of the rows


@dataclass(frozen=True)
class Hypothesis:
    """An explanation of a few rows.

    Attributes
    ----------
    kind : str
        "smooth", "joint", "row", "swap", "block", "shift" or "pair".
    parameters : int
        Number of parameters.
    rss : float
        Sum of squares of the residuals, quanta.
    excess : float
        Largest residual over its limit by rounding; above 1: more than rounding.
    rows : tuple
        (first, last) rows concerned; last None: all rows from first.
    sizes : tuple of float
        Errors of the rows, quanta.
    """

    kind: str
    parameters: int
    rss: float
    excess: float
    rows: tuple = ()
    sizes: tuple = ()

    @property
    def is_null(self):
        """Whether no volume is wrong by this hypothesis."""
        return self.kind in ("smooth", "joint")

    @property
    def is_significant(self):
        """Whether it is a null hypothesis, or its size exceeds the effect of two rounded digits."""
        return not self.sizes or max(abs(size) for size in self.sizes) >= LEAST_SIZE


@dataclass(frozen=True)
class Curve:
    """Least-squares curve of values (n,) with a basis (n, p); residuals are weighted.

    noise: largest rounding error of a row of weight 1.
    """

    basis: np.ndarray
    values: np.ndarray
    weight: np.ndarray
    noise: float

    @property
    def parameters(self):
        """Number of parameters."""
        return self.basis.shape[1]

    @cached_property
    def _qr(self):
        return np.linalg.qr(self.basis * self.weight[:, None])

    @cached_property
    def residual_maker(self):
        """Matrix (n, n) from weighted values to residuals."""
        q = self._qr[0]
        return np.eye(len(self.values)) - q @ q.T

    @cached_property
    def residuals(self):
        """Weighted residuals (n,)."""
        return self.residual_maker @ (self.values * self.weight)

    @cached_property
    def rss(self):
        """Sum of squares of the weighted residuals."""
        return float(self.residuals @ self.residuals)

    @cached_property
    def excess(self):
        """Largest residual over its limit by rounding; 0 if the curve fits any values."""
        if len(self.values) <= self.parameters:
            return 0.0
        return _excess(self.residuals, self.residual_maker, self.noise)

    def at(self, basis):
        """Values (m,) and their largest errors by rounding (m,) at rows (m, p) of the basis."""
        q, r = self._qr
        # weights of the observed values in the predicted values
        weights = q @ np.linalg.solve(r.T, basis.T)
        return (self.values * self.weight) @ weights, self.noise * np.abs(weights).sum(axis=0)


def _excess(residuals, maker, noise):
    """Largest residual over its limit by rounding."""
    allowed = noise * np.abs(maker).sum(axis=1)
    return float((np.abs(residuals) / np.maximum(allowed, 1e-9 * noise)).max())


def explain(rows, row):
    """Return the accepted `Hypothesis` about a suspicious row."""
    hypothesis = _explain(rows, row, WIDTHS[0])
    if hypothesis.is_null and hypothesis.excess > 1:
        closer = _explain(rows, row, WIDTHS[1])
        is_plain = closer.excess <= 1 and closer.parameters <= MOST_IN_FEW
        return closer if is_plain else hypothesis
    return hypothesis


def _explain(rows, row, width):
    """Select a `Hypothesis` about a row from a window of `width` rows."""
    members = rows.window(row, width)
    x = rows.height[members] - rows.height[row]
    scale = np.abs(x).max() if len(x) > 1 else 1.0
    x, y = x / scale, rows.volume[members] - rows.volume[row]
    weight = rows.weight[members]
    curves = [Curve(basis, y, weight, rows.noise) for basis in _bases(rows, members, x)]
    hypotheses = [Hypothesis("smooth", c.parameters, c.rss, c.excess) for c in curves]
    hypotheses += _joints(Curve(x, y, weight, rows.noise), members)
    for curve in curves:
        if len(x) - curve.parameters >= 4:
            hypotheses += _blocks(curve, members, _ends(rows, members))
            hypotheses += _swaps(curve, members)
    return _select_hypothesis(hypotheses, curves, members, rows.noise)


def _bases(rows, members, x):
    """Polynomials of degree 1 to 5, and the series of a lying cylinder at the ends of the table."""
    bases = [x[:, None] ** np.arange(degree + 1) for degree in range(1, 6) if len(x) >= degree + 3]
    valid = np.flatnonzero(rows.is_valid)
    # The volume of a lying cylinder grows with the power 1.5 of the height above its end.
    powers = np.array([0, 1.5, 2, 2.5, 3, 3.5])
    for is_end, away in (
        (members[0] == valid[0], x - x[0]),
        (members[-1] == valid[-1], x[-1] - x),
    ):
        if is_end and len(x) >= 9:
            bases += [(away[:, None] / away.max()) ** powers[:count] for count in (4, 6)]
    return bases


def _ends(rows, members):
    """Whether the members begin, and end, at an end of the table or at a joint."""
    begins = members[0] in (0, *rows.joints)
    return begins, members[-1] + 1 in (len(rows.height), *rows.joints)


def _blocks(curve, members, ends):
    """Hypotheses of one row, or of neighbouring rows, with a common error.

    At an end of the table or a joint, "all but the first" is replaced by a wrong first row. The
    last row only is not a shift of the rows that follow.
    """
    count = len(members)
    first, end = np.triu_indices(count + 1, 1)
    is_all_but_first = (first == 1) & (end == count)
    keep = (first == 0) & (end == 1) if ends[0] else (first >= 1)
    keep |= (first >= 1) & ~is_all_but_first
    first, end = first[keep], end[keep]
    number = np.arange(count)[:, None]
    blocks = ((number >= first) & (number < end)) * curve.weight[:, None]
    maker, residuals = curve.residual_maker, curve.residuals
    # A block adds one column to the basis: its size and the rss follow without another fit.
    moved = maker @ blocks
    norm = np.einsum("nk,nk->k", blocks, moved)
    # relative, as a row with a rounded height has a small weight
    keep = norm > _LEAST_FREE * np.einsum("nk,nk->k", blocks, blocks)
    first, end, moved, norm = first[keep], end[keep], moved[:, keep], norm[keep]
    size = residuals @ blocks[:, keep] / norm
    rss = np.maximum(curve.rss - size**2 * norm, 0.0)
    parameters = curve.parameters
    hypotheses = []
    for k in np.argsort(rss)[:12]:
        remaining = residuals - size[k] * moved[:, k]
        # residual maker of the basis with the block
        maker_left = maker - np.outer(moved[:, k], moved[:, k]) / norm[k]
        excess = _excess(remaining, maker_left, curve.noise) if parameters <= PLAIN else np.inf
        low, high = int(members[first[k]]), int(members[end[k] - 1])
        is_open = end[k] == count
        if end[k] - first[k] == 1 and (ends[1] or not is_open):
            kind, price = "row", 2
        else:
            kind, price = ("shift", 2) if is_open else ("block", 3)
        where = (low, None) if kind == "shift" else (low, high)
        hypotheses.append(
            Hypothesis(kind, parameters + price, float(rss[k]), excess, where, (float(size[k]),))
        )
    return hypotheses


def _swaps(curve, members):
    """Hypotheses of two neighbouring volumes swapped."""
    hypotheses = []
    maker = curve.residual_maker
    for first in range(len(members) - 1):
        values = curve.values.copy()
        values[[first, first + 1]] = values[[first + 1, first]]
        remaining = maker @ (values * curve.weight)
        parameters = curve.parameters
        excess = _excess(remaining, maker, curve.noise) if parameters <= PLAIN else np.inf
        where = (int(members[first]), int(members[first + 1]))
        rss = float(remaining @ remaining)
        hypotheses.append(Hypothesis("swap", parameters + 1, rss, excess, where))
    return hypotheses


def _joints(all_rows, members):
    """Hypotheses of two rising curves that meet between two rows.

    They cross at a joint of courses; at the edge of a cone they only touch.
    """
    hypotheses, x = [], all_rows.basis
    bottom = 0 if members[0] == 0 else 1  # bottoms have varied shapes; two rows are enough
    for cut in range(2, len(x) - 1):
        between = np.linspace(x[cut - 1], x[cut], POINTS_BETWEEN)
        left = _side(all_rows, slice(0, cut), between, bottom)
        right = _side(all_rows, slice(cut, None), between, 1)
        for low, low_values, low_allowed in left:
            for high, high_values, high_allowed in right:
                gap = high_values - low_values
                allowed = np.maximum(low_allowed + high_allowed, TOUCH * np.abs(gap).max())
                is_meeting = gap.min() <= 0 <= gap.max() or np.any(np.abs(gap) <= allowed)
                parameters = low.parameters + high.parameters
                if is_meeting and len(x) >= parameters + 2:
                    excess = max(low.excess, high.excess)
                    where = (int(members[cut]), None)
                    hypotheses.append(
                        Hypothesis("joint", parameters, low.rss + high.rss, excess, where)
                    )
    return hypotheses


def _side(all_rows, part, between, spare):
    """Curves of degree 1 to 3: (curve, values between two rows, their errors by rounding).

    Only curves that do not fall there, with `spare` more rows than parameters.
    """
    curves, x = [], all_rows.basis[part]
    for degree in (1, 2, 3):
        if len(x) > degree + spare:
            powers = np.arange(degree + 1)
            basis, values = x[:, None] ** powers, all_rows.values[part]
            curve = Curve(basis, values, all_rows.weight[part], all_rows.noise)
            values, allowed = curve.at(between[:, None] ** powers)
            if values[-1] - values[0] >= -(allowed[0] + allowed[-1]):
                curves.append((curve, values, allowed))
    return curves


def _pairs(curve, members):
    """Best hypothesis of two wrong rows with independent errors."""
    maker, residuals = curve.residual_maker, curve.residuals
    first, second = np.triu_indices(len(members), 1)
    a, b, c = maker[first, first], maker[first, second], maker[second, second]
    determinant = a * c - b**2
    keep = determinant > 1e-6
    first, second, a, b, c = (v[keep] for v in (first, second, a, b, c))
    determinant = determinant[keep]
    if len(first) == 0:
        return []
    size_1 = (c * residuals[first] - b * residuals[second]) / determinant
    size_2 = (a * residuals[second] - b * residuals[first]) / determinant
    rss = curve.rss - size_1 * residuals[first] - size_2 * residuals[second]
    k = int(np.argmin(rss))
    where = (int(members[first[k]]), int(members[second[k]]))
    sizes = (
        float(size_1[k] / curve.weight[first[k]]),
        float(size_2[k] / curve.weight[second[k]]),
    )
    parameters = curve.parameters + 4
    return [Hypothesis("pair", parameters, max(float(rss[k]), 0.0), np.inf, where, sizes)]


def _select_hypothesis(hypotheses, curves, members, noise):
    """Select the simplest hypothesis within rounding, or else the hypothesis of least cost.

    Null hypotheses are preferred to alternatives, and these to two wrong rows.
    """
    count = len(members)

    def cost(hypothesis):
        """Twice the negative log likelihood, with a penalty for each parameter."""
        return count * np.log(hypothesis.rss / count + noise**2 / 3) + PRICE * hypothesis.parameters

    hypotheses = [hypothesis for hypothesis in hypotheses if hypothesis.is_significant]
    possible = [s for s in hypotheses if s.excess <= 1 + 1e-6]
    if possible:
        return min(possible, key=lambda s: (s.parameters, not s.is_null, s.rss))
    null = min(
        (s for s in hypotheses if s.is_null), key=cost, default=Hypothesis("smooth", 0, 0, 0)
    )
    alternatives = [s for s in hypotheses if not s.is_null]
    margin = 2 * count * np.log(BETTER_FACTOR)
    best = min(alternatives, key=cost, default=null)
    if cost(best) + margin < cost(null):
        return best
    pairs = [
        hypothesis
        for curve in curves
        if curve.parameters <= PLAIN and count - curve.parameters >= 6
        for hypothesis in _pairs(curve, members)
    ]
    best = min(pairs, key=cost, default=null)
    return best if cost(best) + margin < cost(null) else null
