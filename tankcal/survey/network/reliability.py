"""Reliability of readings, and separability of blunders.

Reliability of each observation: tests of its residual, and blunders that they would miss.

    w = v / (s sqrt(r))              Baarda's test statistic, sd s known; standard normal
    tau = w / sigma0                 Pope's test statistic, variance factor estimated
    MDB = delta0 s / sqrt(r)         smallest blunder detected with the required power
    delta0 sqrt((1 - r) / r)         largest effect of it on an adjusted quantity, in sds of that
    Q J' delta0 / sqrt(r)            effect of it on the coordinates, J whitened row, Q cofactors

with the redundancy number r. An exact observation (sd 0) has no residual. It is tested by the
reaction of its constraint, the limit for s -> 0: w = k / s_k, MDB = delta0 / s_k, with the Lagrange
multiplier k. Source: Baarda 1968, A testing procedure for use in geodetic networks; Pope 1976, The
statistics of residuals; Foerstner 1987.

Reactions of held coordinates: each is tested by the effect of its release.

A held coordinate d is not an unknown. With whitened rows A of the unknowns, C of the held
coordinate, w the misclosures, and D of exact conditions, its release changes the unknowns by X and
the rows by

    R = C + A X,   X the least squares answer to C under D X = -D_held
    change = -R'w / R'R,   sd = 1 / sqrt(R'R),   test statistic = change / sd

This is the limit of the w-test of an observed coordinate whose sd approaches 0; -R'w is the
constraint reaction (Lagrange multiplier). R'R is not formed as a difference, so that it stays
positive. Source: Koch 1999, section 3.2.7; Baarda 1968.

Separability of blunders: other readings that may be wrong in place of a rejected one.

With a rejected observation i restored (residual e, whitened row J, S = 1 + J Q J') and B = J_j Q
J', the residuals of i and of another observation j, and their covariances, are

    v_i = S^-1 e,   R_i = S^-1,   v_j = v - B S^-1 e,   R_j = (1 - J_j Q J_j') + B S^-1 B',
    R_ij = -S^-1 B'

For values in a block of correlated ones, with c the columns of L^-1 that a bias of j enters (see
`blocks`), v_j becomes c' v, R_j becomes c' R c and R_ij becomes R_i. c. An observation i of a block
enters as its difference from the expectation given the other values, which is uncorrelated with
them. A bias of j in the same block changes that expectation, d = -L_i^-1 S e_j. The three
quantities then have a further part: d' v_i; c' R_.i d, its transpose, and d' R_i d; and R_i d.

Without j, observation i is tested by

    T = u' M^-1 u,   u = v_i - R_ij R_j^-1 v_j,   M = R_i - R_ij R_j^-1 R_ji

and j may be the blunder if T is insignificant (0.1 %) and j itself is significant. Image points are
pairs, as in data snooping. Most j are excluded without J_j Q J_j', whose eigenvalues are not
negative and add up to m less the redundancy numbers of j. No eigenvalue of R_j is therefore below l
= sum r - (m - 1), M <= R_i, and by Cauchy and Schwarz

    sqrt T >= sqrt(v_i' S v_i) - sqrt(tr B S^-1 B') |v_j| / l

A held coordinate is released: with its reaction g and square q (see `reactions`), and r = C_i + J
X, they become g - r' S^-1 e and q + r' S^-1 r. Source: Foerstner 1983, Reliability and
discernability of extended Gauss-Markov models.
"""

from dataclasses import dataclass, field, replace
from functools import cached_property, reduce

import numpy as np
import scipy.sparse
from scipy.linalg import solve_triangular
from scipy.special import chdtri, ndtri, stdtrit

from tankcal.adjust import ALPHA, CRITICAL, UNCONTROLLED, noncentrality
from tankcal.solver.effects import (
    cofactors_within,
    constraint_reactions,
    own_leverage,
    own_responses,
    responses,
    sparse_rows,
)
from tankcal.survey.network.blocks import (
    conditional_expectation,
    moves_of,
    observations_in_use,
    observations_of,
    test_values,
)

EXACTLY = 1e9  # products up to which effects on all points are computed, in about a second
FEW = 1e7  # as EXACTLY, of readings between points, whose largest effects are exact in both ways
HELD = "held coordinates"  # source of their Residuals; rows are 3 point + axis
UNTESTED = 1e-10  # share of R'R in C'C below which R'R is rounding
CONTRADICTED = 1e-9  # change of a condition by a release that no unknown can follow
AT_ONCE = 4e6  # elements of a dense part processed at a time


@dataclass(frozen=True)
class Residuals:
    """Residuals of one group: n observations with m values each.

    Attributes
    ----------
    kind : str
    unit : str
        Unit of residual, sd and mdb.
    source : object
        "image points", the number in Survey.observations, or "known beforehand".
    rows : ndarray of int, shape (n,)
        Row numbers in the source.
    used : ndarray of bool, shape (n,)
        False for rejected observations.
    residual : ndarray, shape (n, m)
        Computed minus observed.
    sd : ndarray, shape (n, m)
        A priori standard deviation of the observation.
    redundancy : ndarray, shape (n, m)
        0 to 1; 1 for rejected observations.
    w : ndarray, shape (n, m)
        Test statistic; for rejected observations that of the difference from the adjusted ones.
    test_statistic : ndarray, shape (n,)
        Statistic of the whole observation: |w|, or the root of the decrease of v'Pv without it,
        scaled to the critical value of w (0.1 %).
    mdb : ndarray, shape (n, m)
        Minimal detectable bias; inf: not controlled; for rejected observations the value if they
        were adjusted, r = 1 / (1 + leverage).
    external : ndarray, shape (n, m)
        Effect of a blunder of size mdb on the adjusted quantities, in their standard deviations.
    effect_m : ndarray, shape (n, m)
        Largest change of a coordinate of any point by a bias of mdb, in the datum of the
        adjustment; 0 for rejected observations. In large surveys (rows times unknowns times reduced
        unknowns above 1e9), for rows about one point: the largest change of that point.
    elsewhere_m : ndarray, shape (n, m), or None
        In that case an upper bound of the change of other points; None: effect_m includes all
        points.
    exact : bool
        True: the group holds exactly (sd 0); residual and redundancy are 0.
    pull : ndarray, shape (n, m), or None
        sd (Pv) of correlated values; None: v over sd.
    changes : callable
        Returns the change of a coordinate per whitened unit error (exact: per unit error) for
        effect_m and elsewhere_m. It is evaluated on demand, as it costs more than all other
        attributes.
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
        """v (Pv), shape (n, m), with sum v'Pv; the expectation of each is its redundancy number."""
        whitened = np.divide(
            self.residual, self.sd, out=np.zeros_like(self.residual), where=self.sd > 0
        )
        return whitened * (whitened if self.pull is None else self.pull)

    @cached_property
    def _effects(self):
        """effect_m and elsewhere_m: bias times change, computed on first access."""
        unit_changes = self.changes()
        with np.errstate(invalid="ignore"):
            biases = self.mdb / np.where(self.sd > 0, self.sd, 1.0)
            return tuple(
                None if change is None else np.where(change > 0, biases * change, 0.0)
                for change in unit_changes
            )

    @property
    def effect_m(self):
        """See the class docstring."""
        return self._effects[0]

    @property
    def elsewhere_m(self):
        """See the class docstring."""
        return self._effects[1]


def tau_limit(alpha, dof):
    """Two-sided critical value of Pope's tau distribution."""
    # tau follows from Student's t with one degree of freedom fewer.
    t = -stdtrit(dof - 1, alpha / 2)
    return float(t * np.sqrt(dof) / np.sqrt(dof - 1 + t * t))


def residuals_of(problem, solution):
    """Residuals of each group of a solved Problem, followed by exact observations.

    Parameters
    ----------
    problem : Problem
    solution : solver solution

    Returns
    -------
    tuple of Residuals
    """
    delta0 = noncentrality()
    tables = [_table(problem, solution, number, delta0) for number in range(problem.ordinary)]
    blocks = [
        table
        for number, members in problem.blocks
        for table in _block_residuals(problem, solution, number, members, delta0)
    ]
    return (*tables, *blocks, *_exact_residuals(problem, solution, delta0))


def _block_residuals(problem, solution, number, members, delta0):
    """Yield Residuals of the values of a block of correlated observations, by table.

    Values outside the block are omitted, even if another value of their observation is in it.
    """
    tests = test_values(problem, solution, number, members, delta0)
    parts = dict(zip(np.unique(members.source), _first_parts(members), strict=True))
    for source, first_part in parts.items():
        is_of_source = np.flatnonzero(members.source == source)
        rows, place = np.unique(members.row[is_of_source], return_inverse=True)
        shape = len(rows), first_part.rows

        def filled(values, place=place, is_of_source=is_of_source, shape=shape, empty=0.0):
            table = np.full(shape, empty)
            column = members.component[is_of_source] if shape[1] > 1 else 0
            table[place, column] = values[is_of_source]
            return table

        used, test = np.zeros(shape[0], dtype=bool), np.zeros(shape[0])
        used[place], test[place] = (
            members.share[is_of_source] > 0,
            tests.test_statistic[is_of_source],
        )
        change = filled(tests.change)
        yield Residuals(
            kind=first_part.kind, unit=first_part.unit, source=source, rows=rows, used=used,
            residual=filled(tests.residual), sd=filled(tests.sd),
            redundancy=filled(tests.redundancy), w=filled(tests.w), test_statistic=test,
            mdb=filled(tests.mdb), external=filled(tests.external),
            changes=lambda change=change: (change, None), pull=filled(tests.pull),
        )  # fmt: skip


def _first_parts(members):
    """The observations of each source of a block, in the order of the sources."""
    sources = [members.source[first] for first in np.flatnonzero(
        np.append(True, np.diff(members.source) != 0))]  # fmt: skip
    parts = {}
    for source, (part, _) in zip(sources, members.block.parts, strict=True):
        parts.setdefault(source, part)
    return [parts[source] for source in sorted(parts)]


def _table(problem, solution, number, delta0):
    """The Residuals of a group."""
    group = problem.observations[number]
    use = np.ones(len(group)) if group.use is None else np.asarray(group.use, dtype=float)
    unweighted = group if group.use is None else group.using(np.ones(len(group)))
    columns = problem.model.groups[number].columns
    v = np.empty((len(group), group.rows))
    jac = np.empty((*v.shape, columns.shape[1]))
    unweighted.fill(solution.unknowns, v, jac)
    leverage, aside = solution.cofactor.leverage(number, jac), use == 0
    # Rejected rows are outside the range of the adjusted ones, so the datum adds to their leverage.
    leverage[aside] += solution.cofactor.leverage_of_datum(columns[aside], jac[aside])
    share = use[:, None]
    # Redundancy number: one minus leverage, with the weight factor of the row.
    r = 1.0 - share * leverage
    # Rejected: the variance of the observation and that of its prediction add.
    variance = np.where(share > 0, r, 1.0 + leverage)
    controlled = variance > UNCONTROLLED
    with np.errstate(divide="ignore", invalid="ignore"):
        w = np.where(controlled, v / np.sqrt(variance), 0.0)
        mdb = np.where(
            controlled, delta0 * np.where(share > 0, 1 / variance, variance) ** 0.5, np.inf
        )
        # External reliability delta0 sqrt((1 - r) / r).
        hidden = np.where(controlled, delta0 * np.sqrt(np.maximum(1 - r, 0) / r), np.inf)
    sd, test = 1.0 / unweighted.weight, np.abs(w).max(axis=1)
    if group.rows == 2:
        test = _both(solution, number, v, jac, share, leverage, variance, test)
    return Residuals(
        kind=group.kind, unit=group.unit, source=problem.sources[number],
        rows=problem.rows_of[number], used=use > 0, residual=v * sd, sd=sd, redundancy=r, w=w,
        test_statistic=test, mdb=mdb * sd, external=hidden,
        changes=lambda: _changes(problem, solution, number, share),
    )  # fmt: skip


def _changes(problem, solution, number, share):
    """Largest change (n, m) of a coordinate per whitened unit error; a bound for other points or
    None.

    The bound: a row moves the reduced unknowns by at most sqrt(b S^-1 b'), b its reduced part, in
    the norm of S. A point follows by at most that times its standard deviation from these unknowns.
    """
    group, columns = (
        problem.observations[number],
        problem.model.groups[number].columns,
    )
    jac = np.empty((len(group), group.rows, columns.shape[1]))
    unweighted = group if group.use is None else group.using(np.ones(len(group)))
    unweighted.fill(solution.unknowns, np.empty(jac.shape[:2]), jac)
    points = np.unique(problem.layout.points)
    points = points[points >= 0]
    cofactor, is_single_point = solution.cofactor, group.ties == ("point",)
    products = problem.model.unknowns * max(problem.model.reduced, 1)
    bound, changes = None, np.zeros(jac.shape[:2])
    inexact = np.ones(jac.shape[:2], dtype=bool)
    most_products = EXACTLY if is_single_point else FEW
    if jac.shape[0] * jac.shape[1] * products > most_products and (
        is_single_point or cofactor.datum is None
    ):
        # Change of the own point, exactly; the bound covers all other points.
        changes = np.abs(own_responses(cofactor, number, jac)).max(axis=2)
        reduced = cofactor.leverage(number, jac)
        sd = np.einsum("nii->ni", cofactor.block_cofactors)
        if cofactor.datum is None:
            reduced = reduced - own_leverage(cofactor, number, jac)
            inverse = cofactor.inverse_roots
            sd = sd - np.einsum("nji,nji->ni", inverse, inverse)
        rest = points[points < problem.model.reduced]
        of_rest = cofactor.reduced_blocks(rest[:, None])[:, 0, 0]
        largest = np.sqrt(max(sd.max(initial=0.0), of_rest.max(initial=0.0)))
        bound = largest * np.sqrt(np.maximum(reduced, 0.0))
        if is_single_point:
            return share * changes, share * bound
        # Of readings between points, few can move another point more than their eliminated point.
        has_block = (columns >= problem.model.reduced).any(axis=1)
        inexact = (bound >= changes) | ~has_block[:, None]
    rows, values = inexact.nonzero()
    for part, response in responses(cofactor, columns[rows], jac[rows, values][:, None]):
        changes[rows[part], values[part]] = np.abs(response[points]).max(axis=0, initial=0.0)
    return share * changes, None


def _exact_residuals(problem, solution, delta0):
    """Yield Residuals of exact observations; of several conditions of an observation the last
    counts."""
    if not problem.exact:
        return
    k, sd, changes = constraint_reactions(solution.cofactor)
    points = np.unique(problem.layout.points)
    moves = np.abs(changes[points[points >= 0]]).max(axis=0, initial=0.0)
    # A condition may be a function of the observation; the lever converts it to the observed unit.
    levers = [held.conditions.lever(solution.unknowns).ravel() for held in problem.exact]
    levers = np.concatenate(levers)
    moves, k, sd = moves * levers, k * levers, sd * levers
    tested, first = sd > 0, 0
    with np.errstate(divide="ignore", invalid="ignore"):
        # w = k / s_k, MDB = delta0 / s_k with the Lagrange multiplier k.
        w = np.where(tested, k / sd, 0.0)
        mdb = np.where(tested, delta0 / sd, np.inf)
    for held in problem.exact:
        group, rows = held.observations, held.conditions.rows
        slots = slice(first, first + len(held.row_of) * rows)
        first = slots.stop
        shape = len(group), group.rows
        parts = []
        for values in (w, mdb, moves):
            part = np.zeros(shape)
            if shape[1] == rows:
                part[held.row_of] = values[slots].reshape(-1, rows)
            else:  # a whole rotation: one observation with three conditions
                part[:] = values[slots].reshape(shape)
            parts.append(part)
        none = np.zeros(shape)
        yield Residuals(
            kind=group.kind, unit=group.unit, source=held.source, rows=held.rows,
            used=np.ones(shape[0], dtype=bool), residual=none, sd=none, redundancy=none,
            w=parts[0], test_statistic=np.abs(parts[0]).max(axis=1), mdb=parts[1],
            external=np.full(shape, np.inf), exact=True,
            changes=lambda moves=parts[2]: (moves, None),
        )  # fmt: skip


def _both(solution, group, v, jac, share, leverage, variance, single):
    """Joint test statistic (n,) of two values, from the covariance of their residuals.

    Parameters
    ----------
    solution : solver solution
    group : int
    v, jac, share, leverage, variance : ndarray
        Residuals, whitened derivatives, weight factors, leverages and residual variances.
    single : ndarray, shape (n,)
        Statistic where only one direction is controlled.
    """
    sum_of_both = solution.cofactor.leverage(group, jac.sum(axis=1, keepdims=True))[:, 0]
    # Polarization: (a + b)'Q(a + b) - a'Qa - b'Qb = 2 a'Qb.
    between = 0.5 * (sum_of_both - leverage.sum(axis=1))
    between = np.where(share[:, 0] > 0, -share[:, 0] * between, between)
    a, d = variance.T
    determinant = a * d - between**2
    # Quadratic form v' R^-1 v of a 2 x 2 matrix, before division by the determinant.
    square = d * v[:, 0] ** 2 + a * v[:, 1] ** 2 - 2 * between * v[:, 0] * v[:, 1]
    sound = determinant > UNCONTROLLED * np.maximum(a * d, UNCONTROLLED)
    square = np.maximum(square, 0.0) / np.where(sound, determinant, 1.0)
    limit_of_one, limit_of_two = -ndtri(ALPHA / 2), np.sqrt(chdtri(2, ALPHA))
    return np.where(sound, np.sqrt(square) * limit_of_one / limit_of_two, single)


# ---- reactions of held coordinates: each is tested by the effect of its release


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

    def residuals(self, problem):
        """Residuals of the held coordinates: residual and sd 0; w, mdb and effect from the
        reactions.

        A released coordinate would change by w mdb / delta0 (see `noncentrality`), with an sd of
        mdb / delta0. Without control, mdb is infinite.

        Parameters
        ----------
        problem : Problem

        Returns
        -------
        Residuals
        """
        columns = np.unique(problem.layout.points)
        moves = np.abs(self.changes[columns[columns >= 0]]).max(axis=0, initial=0.0)
        with np.errstate(divide="ignore"):
            mdb = noncentrality() / np.sqrt(self.square)
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


# Critical values of T, by the number of values tested.
LIMITS = (0.0, CRITICAL**2, *(float(chdtri(count, ALPHA)) for count in range(2, 7)))
WORTH = 0.5 * CRITICAL**2  # w^2 of a value above which its observation is examined
LOOKED_AT = 200  # observations of a group examined, the worst first
FIRM = 0.05  # smallest eigenvalue of R_j for which the bound of T is used


def alternatives(adjusted, source, row, held=None):
    """Find readings that may be the blunder in place of a rejected one.

    Parameters
    ----------
    adjusted : Adjusted
    source : object
    row : int
        Source and row of the rejected reading.
    held : Reactions, optional
        Held coordinates, which may also be wrong; None: not tested.

    Returns
    -------
    list of (source, row)
        The most likely first; empty if the blunder is identified.
    """
    problem, solution = adjusted.problem, adjusted.solution
    aside = _aside(problem, solution, source, row)
    if aside is None:
        return []  # its points are no longer adjusted
    candidates = []
    for k, table in enumerate(adjusted.residuals[: problem.ordinary]):
        if table.source == "known beforehand":
            continue
        columns = problem.model.groups[k].columns
        b = solution.cofactor.jacobians[k] @ np.take(aside.moves, columns, axis=0)
        for i, v, cofactors, b_i in _near(solution, table, k, b, aside):
            tests = _tests(v, cofactors, -aside.inverse @ b_i.T, aside)
            if tests is not None:
                candidates.append((*tests, table.source, int(table.rows[i])))
    for k, members in problem.blocks:
        candidates += _correlated_moves(problem, solution, k, members, aside)
    candidates = [(significance, *which) for significance, instead, *which in candidates if instead]
    if held is not None and len(held.rows):
        place = aside.one.columns(held.layout)[0] - problem.model.unknowns
        c = np.zeros((len(aside.e), len(held.rows)))
        # Derivatives of the rejected reading by the held coordinates.
        c[:, place[place >= 0]] = aside.jac[:, place >= 0]
        changes = np.vstack([held.changes, np.zeros((1, len(held.rows)))])
        candidates += _release_moves(
            held, c + aside.jac @ changes[aside.columns], aside.inverse, aside.e
        )
    return [one[1:] for one in sorted(candidates, key=lambda one: -one[0])]


@dataclass(frozen=True)
class _Aside:
    """A rejected observation with m values, whitened.

    Attributes
    ----------
    e : ndarray, shape (m,)
        Difference from its expectation.
    jac : ndarray, shape (m, K)
        Derivatives.
    columns : ndarray of int, shape (K,)
        Columns of the unknowns.
    moves : ndarray, shape (unknowns + 1, m)
        Q J', with a final row of zeros.
    inverse : ndarray, shape (m, m)
        S^-1.
    one : Observations
    members : Members or None
        Block of the observation.
    follows : ndarray, shape (m, k), or None
        -L_i^-1 S, change of e by biases of the adjusted values of the block.
    """

    e: np.ndarray
    jac: np.ndarray
    columns: np.ndarray
    moves: np.ndarray
    inverse: np.ndarray
    one: object
    members: object = None
    follows: np.ndarray | None = None

    @property
    def back(self):
        return self.inverse @ self.e


def _aside(problem, solution, source, row):
    """The _Aside of a row of a source, or None."""
    for number in range(len(problem.sources)):
        if problem.sources[number] == source and row in problem.rows_of[number]:
            indices = np.flatnonzero(problem.rows_of[number] == row)
            one = problem.observations[number].taken(indices).using(np.ones(1))
            columns = problem.model.groups[number].columns[indices]
            e, jac = np.empty((1, one.rows)), np.empty((1, one.rows, columns.shape[1]))
            one.fill(solution.unknowns, e, jac)
            return _make_aside(solution, e[0], jac[0], columns, one)
    for number, members in problem.blocks:
        indices = np.flatnonzero((members.source == source) & (members.row == row))
        if not len(indices):
            continue
        v, jac = members.block.linearised(solution.unknowns)
        part = observations_in_use(problem, solution, number, members, v)
        off, away, unexplained, share = conditional_expectation(members, part, indices, v, jac)
        # Whiten the difference, so that its covariance without the unknowns is I.
        root = np.linalg.cholesky(unexplained)
        e, jac, share = (solve_triangular(root, one, lower=True) for one in (off, away, share))
        columns = members.block.columns(problem.layout)
        return _make_aside(solution, e, jac, columns, members.block, members, -share)
    return None


def _make_aside(solution, e, jac, columns, *more):
    """The _Aside with Q J' and S^-1."""
    moves = moves_of(solution, columns, jac)
    # S = I + J Q J' is the covariance of the whitened difference.
    inverse = np.linalg.inv(np.eye(len(e)) + jac @ moves[columns[0]])
    return _Aside(e, jac, columns[0], moves, inverse, *more)


def _correlated_moves(problem, solution, number, members, aside):
    """Yield (T of j, whether i agrees without it, source, row) of observations j of a block."""
    if number is None:
        return
    v, _ = members.block.linearised(solution.unknowns)
    part = observations_in_use(problem, solution, number, members, v)
    b = part.a @ aside.moves[part.columns]
    t = part.t - b @ aside.back
    spread = part.spread + b @ aside.inverse @ b.T
    to_aside = -aside.inverse @ b.T
    shift = aside.follows if members is aside.members else np.zeros((len(aside.e), len(part.own)))
    for rows_of_observation in observations_of(members):
        if not members.share[rows_of_observation[0]] > 0:
            continue
        place = np.searchsorted(part.own, rows_of_observation)
        size = np.sqrt(np.sum(part.back[:, place] ** 2, axis=0) + np.sum(shift[:, place] ** 2, 0))
        # Normalize each bias, so that thresholds on eigenvalues are comparable.
        c, d = part.back[:, place] / size, shift[:, place] / size
        cross = to_aside @ c + aside.inverse @ d
        right = c.T @ t + d.T @ aside.back
        cofactors = c.T @ spread @ c + d.T @ to_aside @ c + (to_aside @ c).T @ d
        tests = _tests(right, cofactors + d.T @ aside.inverse @ d, cross, aside)
        if tests is not None:
            yield (
                *tests,
                int(members.source[rows_of_observation[0]]),
                int(members.row[rows_of_observation[0]]),
            )


def _near(solution, table, number, b, aside):
    """Yield observations that are significant with i restored: position, v_j, R_j, B."""
    inverse, back = aside.inverse, aside.back
    # one product of all rows takes a third of the time of many small ones
    flat = b.reshape(-1, b.shape[-1])
    v = table.residual / table.sd - (flat @ back).reshape(b.shape[:2])
    # Diagonal of B S^-1 B': increase of the redundancy of j when i is restored.
    shared = np.einsum("rd,rd->r", flat @ inverse, flat).reshape(b.shape[:2])
    r = table.redundancy + shared
    squares = np.where(r > UNCONTROLLED, v**2 / np.maximum(r, UNCONTROLLED), 0.0)
    square = reduce(np.maximum, squares.T)  # of few values each: faster than a maximum by rows
    near = np.flatnonzero(table.used & (square > WORTH))
    near = near[(b[near] != 0).any(axis=(1, 2))]
    near = near[np.argsort(-square[near], kind="stable")][:LOOKED_AT]
    # The bound is cheap; exact covariances are computed for the remaining observations only.
    near = near[_may_explain(v[near], table.redundancy[near], shared[near].sum(axis=1), aside)]
    if not len(near):
        return
    for j, cofactors in zip(near, cofactors_within(solution.cofactor, number, near), strict=True):
        yield j, v[j], np.eye(len(cofactors)) - cofactors + b[j] @ inverse @ b[j].T, b[j]


def _may_explain(v, redundancy, shared, aside):
    """Mask (n,) of observations without which T may be small, by its lower bound.

    Parameters
    ----------
    v, redundancy : ndarray, shape (n, m)
    shared : ndarray, shape (n,)
        tr B S^-1 B'.
    aside : _Aside
    """
    least = redundancy.sum(axis=1) - (redundancy.shape[1] - 1)
    # If j shares at most half of the remaining redundancy of i, all values of i stay controlled.
    has_bound = (least >= FIRM) & (2 * shared <= least)
    if np.linalg.eigvalsh(aside.inverse)[0] <= 2 * UNCONTROLLED:
        has_bound[:] = False
    moved = np.sqrt(shared) * np.linalg.norm(v, axis=1) / np.where(has_bound, least, 1.0)
    return ~has_bound | (moved >= np.sqrt(aside.e @ aside.back) - np.sqrt(LIMITS[len(aside.e)]))


def _tests(v, cofactors, cross, aside):
    """T of j with i restored, and whether i agrees without j; None if j is not significant."""
    statistic, values = _square(v, cofactors)
    if statistic <= LIMITS[values]:
        return None
    # The pseudo-inverse omits directions of j without redundancy.
    by_j = cross @ np.linalg.pinv(cofactors, rcond=UNCONTROLLED, hermitian=True)
    instead, values = _square(aside.back - by_j @ v, aside.inverse - by_j @ cross.T)
    return statistic, instead <= LIMITS[values]


def _square(v, cofactors):
    """v' R^-1 v and the number of its values, without uncontrolled directions."""
    size, ways = np.linalg.eigh(cofactors)
    # Eigenvectors with an eigenvalue near 0 are combinations without redundancy.
    controlled = size > UNCONTROLLED
    part = ways[:, controlled].T @ v
    return float(np.sum(part**2 / size[controlled])), int(controlled.sum())


def _release_moves(held, r, inverse, e):
    """(T, source, row) of held coordinates whose release makes reading i agree.

    Parameters
    ----------
    held : Reactions
    r : ndarray, shape (m, k)
        Change of the rows of i by each release.
    inverse : ndarray, shape (m, m)
        S^-1.
    e : ndarray, shape (m,)
    """
    before = held.w**2
    square = held.square + np.einsum("mk,mn,nk->k", r, inverse, r)
    reaction = held.reaction - r.T @ inverse @ e
    significance = np.where(held.square > 0, reaction**2 / np.where(square > 0, square, 1.0), 0.0)
    instead = e @ inverse @ e + before - significance
    near = np.flatnonzero((significance > CRITICAL**2) & (instead <= LIMITS[len(e)]))
    return [(significance[i], HELD, int(held.rows[i])) for i in near]
