"""What the residuals say about each observation, and what they would not say.

    w = v / (s sqrt(r))              Baarda's test quantity, sd s known; standard normal
    tau = w / sigma0                 Pope's, variance factor estimated
    MDB = delta0 s / sqrt(r)         smallest blunder found with the power asked for
    delta0 sqrt((1 - r) / r)         its effect on any adjusted quantity, at most, in sds of that
    Q J' delta0 / sqrt(r)            its effect on the coordinates, J whitened row, Q cofactors

with the redundancy number r. What holds exactly (sd 0) has no residual; it is tested by the
reaction of its constraint, the limit of all this for s -> 0: w = k / s_k, MDB = delta0 / s_k, with
the Lagrange multiplier k.
Source: Baarda 1968, A testing procedure for use in geodetic networks; Pope 1976, The statistics of
residuals; Foerstner 1987.
"""

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from scipy.special import chdtri, ndtri, stdtrit

from tankcal.adjust import ALPHA, POWER, UNCONTROLLED, noncentrality
from tankcal.solver.effects import constraint_reactions, own_leverage, own_responses, responses
from tankcal.survey.network.blocks import test_values

EXACTLY = 1e9  # products: up to here effects are worked out for all points, in about 0.2 s


@dataclass(frozen=True)
class Residuals:
    """Residuals of one group of observations: n observations with m values each.

    kind        in words                  unit        of value, residual, sd, mdb
    source      "image points", the number in Survey.observations, or "known beforehand"
    rows        (n,) row numbers there    used        (n,) False where set aside
    residual    (n, m) computed minus observed
    sd          (n, m) of the observation, a priori
    redundancy  (n, m) 0 to 1; 1 for those set aside
    w           (n, m) test quantity; of those set aside: of the difference to what the others say
    test_statistic (n,) of the observation with all its values: |w|, or the root of what v'Pv would
                lose without it, brought to the critical value of w (0.1 %)
    mdb         (n, m) minimal detectable bias; inf where nothing controls the observation; of those
                set aside: what it would be with them, r = 1 / (1 + leverage)
    external    (n, m) effect of a blunder of that size on the adjusted quantities, in their sds
    effect_m    (n, m) largest change of any coordinate of any point by a bias of mdb in this value,
                in the datum of the adjustment; 0 for those set aside. In large surveys (rows times
                unknowns times reduced unknowns above 1e9), of rows about one point: the largest
                change of that point
    elsewhere_m (n, m) bound in that case: no other point changes by more; None: effect_m is that of
                all points
    exact       True: the group holds exactly (sd 0); residual and redundancy are 0
    pull        (n, m) sd (Pv), of correlated values; None: v over sd
    changes     function -> change of a coordinate by a whitened error of one (exact: of one), own
                or of all, and elsewhere or None; for effect_m, which costs more than all the rest
    """

    kind: str
    unit: str
    source: object
    rows: np.ndarray
    used: np.ndarray
    residual: np.ndarray
    sd: np.ndarray
    redundancy: np.ndarray
    w: np.ndarray
    test_statistic: np.ndarray
    mdb: np.ndarray
    external: np.ndarray
    exact: bool = False
    changes: object = field(default=None, repr=False)
    pull: np.ndarray | None = None

    @property
    def part_of_chi2(self):
        """(n, m) v (Pv): they add up to v'Pv, and each is expected to be its redundancy number."""
        whitened = np.divide(
            self.residual, self.sd, out=np.zeros_like(self.residual), where=self.sd > 0
        )
        return whitened * (whitened if self.pull is None else self.pull)

    @cached_property
    def _effects(self):
        """effect_m and elsewhere_m: bias times change, worked out when first asked for."""
        found = self.changes()
        with np.errstate(invalid="ignore"):
            biases = self.mdb / np.where(self.sd > 0, self.sd, 1.0)
            return tuple(
                None if change is None else np.where(change > 0, biases * change, 0.0)
                for change in found
            )

    @property
    def effect_m(self):
        """See above."""
        return self._effects[0]

    @property
    def elsewhere_m(self):
        """See above."""
        return self._effects[1]


def tau_limit(alpha, dof):
    """Two-sided critical value of Pope's tau distribution."""
    t = -stdtrit(dof - 1, alpha / 2)
    return float(t * np.sqrt(dof) / np.sqrt(dof - 1 + t * t))


def residuals_of(problem, solution, alpha=ALPHA, power=POWER):
    """A tuple of Residuals, one for each group of a solved Problem, then what holds exactly."""
    delta0 = noncentrality(alpha, power)
    tables = [_table(problem, solution, number, delta0) for number in range(problem.ordinary)]
    blocks = [
        table
        for number, members in problem.blocks
        for table in _of_block(problem, solution, number, members, delta0)
    ]
    return (*tables, *blocks, *_of_exact(problem, solution, delta0))


def _of_block(problem, solution, number, members, delta0):
    """Residuals of the values of a block of correlated observations, by the tables they are of.

    A value of an observation that is not in the block, though another one is, does not occur.
    """
    found = test_values(problem, solution, number, members, delta0)
    parts = dict(zip(np.unique(members.source), _first_parts(members), strict=True))
    for source, one in parts.items():
        mine = np.flatnonzero(members.source == source)
        rows, place = np.unique(members.row[mine], return_inverse=True)
        shape = len(rows), one.rows

        def filled(values, place=place, mine=mine, shape=shape, empty=0.0):
            table = np.full(shape, empty)
            column = members.component[mine] if shape[1] > 1 else 0
            table[place, column] = values[mine]
            return table

        used, test = np.zeros(shape[0], dtype=bool), np.zeros(shape[0])
        used[place], test[place] = members.share[mine] > 0, found.test_statistic[mine]
        change = filled(found.change)
        yield Residuals(
            kind=one.kind, unit=one.unit, source=source, rows=rows, used=used,
            residual=filled(found.residual), sd=filled(found.sd),
            redundancy=filled(found.redundancy), w=filled(found.w), test_statistic=test,
            mdb=filled(found.mdb), external=filled(found.external),
            changes=lambda change=change: (change, None), pull=filled(found.pull),
        )  # fmt: skip


def _first_parts(members):
    """The observations of each source of a block, in the order of the sources."""
    sources = [members.source[first] for first in np.flatnonzero(
        np.append(True, np.diff(members.source) != 0))]  # fmt: skip
    parts = {}
    for source, (one, _) in zip(sources, members.block.parts, strict=True):
        parts.setdefault(source, one)
    return [parts[source] for source in sorted(parts)]


def _table(problem, solution, number, delta0):
    """The Residuals of a group."""
    one = problem.observations[number]
    use = np.ones(len(one)) if one.use is None else np.asarray(one.use, dtype=float)
    whole = one if one.use is None else one.using(np.ones(len(one)))
    columns = problem.model.groups[number].columns
    v = np.empty((len(one), one.rows))
    jac = np.empty((*v.shape, columns.shape[1]))
    whole.fill(solution.unknowns, v, jac)
    leverage, aside = solution.cofactor.leverage(number, jac), use == 0
    leverage[aside] += solution.cofactor.leverage_of_datum(columns[aside], jac[aside])
    share = use[:, None]
    r = 1.0 - share * leverage
    variance = np.where(share > 0, r, 1.0 + leverage)
    controlled = variance > UNCONTROLLED
    with np.errstate(divide="ignore", invalid="ignore"):
        w = np.where(controlled, v / np.sqrt(variance), 0.0)
        mdb = np.where(
            controlled, delta0 * np.where(share > 0, 1 / variance, variance) ** 0.5, np.inf
        )
        hidden = np.where(controlled, delta0 * np.sqrt(np.maximum(1 - r, 0) / r), np.inf)
    sd, test = 1.0 / whole.weight, np.abs(w).max(axis=1)
    if one.rows == 2:
        test = _both(solution, number, v, jac, share, leverage, variance, test)
    return Residuals(
        kind=one.kind, unit=one.unit, source=problem.sources[number], rows=problem.rows_of[number],
        used=use > 0, residual=v * sd, sd=sd, redundancy=r, w=w, test_statistic=test, mdb=mdb * sd,
        external=hidden, changes=lambda: _changes(problem, solution, number, share),
    )  # fmt: skip


def _changes(problem, solution, number, share):
    """Largest change (n, m) of a coordinate by a whitened error of one; a bound elsewhere or None.

    Elsewhere: a row moves the reduced unknowns by no more than sqrt(b S^-1 b'), b its part there,
    in the norm of S, and a point follows these by no more than that times its sd from them.
    """
    one, columns = problem.observations[number], problem.model.groups[number].columns
    jac = np.empty((len(one), one.rows, columns.shape[1]))
    whole = one if one.use is None else one.using(np.ones(len(one)))
    whole.fill(solution.unknowns, np.empty(jac.shape[:2]), jac)
    points = np.unique(problem.layout.points)
    points = points[points >= 0]
    own, products = one.ties == ("point",), problem.model.unknowns * max(problem.model.reduced, 1)
    if not own or jac.shape[0] * jac.shape[1] * products <= EXACTLY:
        found = np.zeros(jac.shape[0] * jac.shape[1])
        for part, response in responses(solution.cofactor, columns, jac):
            found[part] = np.abs(response[points]).max(axis=0, initial=0.0)
        return share * found.reshape(jac.shape[:2]), None
    nearest = np.abs(own_responses(solution.cofactor, number, jac)).max(axis=2)
    reduced = solution.cofactor.leverage(number, jac)
    sd = np.einsum("nii->ni", solution.cofactor.block_cofactors)
    if solution.cofactor.datum is None:
        reduced = reduced - own_leverage(solution.cofactor, number, jac)
        inverse = solution.cofactor.inverse_roots
        sd = sd - np.einsum("nji,nji->ni", inverse, inverse)
    rest = points[points < problem.model.reduced]
    of_rest = solution.cofactor.reduced_blocks(rest[:, None])[:, 0, 0]
    largest = np.sqrt(max(sd.max(initial=0.0), of_rest.max(initial=0.0)))
    return share * nearest, share * largest * np.sqrt(np.maximum(reduced, 0.0))


def _of_exact(problem, solution, delta0):
    """Residuals of the observations that hold exactly; several rows of one: the last one counts."""
    if not problem.exact:
        return
    k, sd, changes = constraint_reactions(solution.cofactor)
    points = np.unique(problem.layout.points)
    moves = np.abs(changes[points[points >= 0]]).max(axis=0, initial=0.0)
    levers = [held.conditions.lever(solution.unknowns).ravel() for held in problem.exact]
    levers = np.concatenate(levers)
    moves, k, sd = moves * levers, k * levers, sd * levers
    tested, first = sd > 0, 0
    with np.errstate(divide="ignore", invalid="ignore"):
        w = np.where(tested, k / sd, 0.0)
        mdb = np.where(tested, delta0 / sd, np.inf)
    for held in problem.exact:
        one, rows = held.observations, held.conditions.rows
        mine = slice(first, first + len(held.row_of) * rows)
        first = mine.stop
        shape = len(one), one.rows
        parts = []
        for values in (w, mdb, moves):
            part = np.zeros(shape)
            if shape[1] == rows:
                part[held.row_of] = values[mine].reshape(-1, rows)
            else:  # a whole rotation: three rows of one
                part[:] = values[mine].reshape(shape)
            parts.append(part)
        none = np.zeros(shape)
        yield Residuals(
            kind=one.kind, unit=one.unit, source=held.source, rows=held.rows,
            used=np.ones(shape[0], dtype=bool), residual=none, sd=none, redundancy=none,
            w=parts[0], test_statistic=np.abs(parts[0]).max(axis=1), mdb=parts[1],
            external=np.full(shape, np.inf), exact=True,
            changes=lambda moves=parts[2]: (moves, None),
        )  # fmt: skip


def _both(solution, group, v, jac, share, leverage, variance, single):
    """Test quantity (n,) of two values together, from their residuals' covariance.

    single  (n,) the quantity where only one direction is controlled
    """
    sum_of_both = solution.cofactor.leverage(group, jac.sum(axis=1, keepdims=True))[:, 0]
    between = 0.5 * (sum_of_both - leverage.sum(axis=1))
    between = np.where(share[:, 0] > 0, -share[:, 0] * between, between)
    a, d = variance.T
    determinant = a * d - between**2
    square = d * v[:, 0] ** 2 + a * v[:, 1] ** 2 - 2 * between * v[:, 0] * v[:, 1]
    sound = determinant > UNCONTROLLED * np.maximum(a * d, UNCONTROLLED)
    square = np.maximum(square, 0.0) / np.where(sound, determinant, 1.0)
    one, two = -ndtri(ALPHA / 2), np.sqrt(chdtri(2, ALPHA))
    return np.where(sound, np.sqrt(square) * one / two, single)
