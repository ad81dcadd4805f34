"""Correlated observations of a survey: their contribution to the solver, and tests of their
residuals.

With the covariance Q = L L' of the values of a block, A their derivatives and N the normal matrix,

    R = I - L^-1 A N^-1 A' L^-T,   c = L^-1 e,   t = L^-1 v
    w = c' t / sqrt(c' R c)        MDB = delta0 / sqrt(c' R c)

for a blunder in direction e; for a single value, e has one element 1. The redundancy number of a
value is the diagonal of L R L^-1. Redundancy numbers add up to the redundancy, but single ones may
lie outside 0 to 1, so they do not enter w or MDB. A rejected value is compared with its expectation
from the other values and its correlation with them. Source: Baarda 1968; Teunissen 2006, Testing
theory, ch. 4.
"""

from dataclasses import dataclass, replace

import numpy as np
from scipy.special import chdtri, ndtri

from tankcal.adjust import ALPHA, UNCONTROLLED
from tankcal.errors import SolutionError
from tankcal.messages import message
from tankcal.solver.effects import responses
from tankcal.survey.observations import Correlated, Layout

CORRELATED = "correlated"  # source of their groups; their residuals are listed in their own tables


@dataclass(frozen=True)
class Members:
    """Values of a block between adjusted points.

    Attributes
    ----------
    source, row, component : ndarray of int, shape (k,)
        See Block.
    share : ndarray, shape (k,)
        Weight factor of each value.
    covariance : ndarray, shape (k, k)
        As declared.
    block : Correlated
        All k values.
    """

    source: np.ndarray
    row: np.ndarray
    component: np.ndarray
    share: np.ndarray
    covariance: np.ndarray
    block: Correlated


def is_in_block(survey, number):
    """Mask (n,) of the observations of a table that belong to a block of correlated values."""
    mask = np.zeros(len(survey.observations[number]), dtype=bool)
    for block in survey.correlated:
        mask[block.row[block.source == number]] = True
    return mask


def correlated_groups(survey, used, centre, state):
    """Yield (Correlated, Members) for the blocks of a survey.

    The Correlated is None for a block that is rejected as a whole; only its residuals are used.

    Parameters
    ----------
    survey : Survey
    used : ndarray of bool, shape (points,)
        Adjusted points.
    centre : ndarray, shape (3,)
    state : State
        Supplies the numbers of unknowns.
    """
    all_of = _every_unknown(state) if survey.correlated else None
    for block in survey.correlated:
        keep = np.ones(len(block.row), dtype=bool)
        share = np.ones(len(block.row))
        for source in np.unique(block.source):
            table, is_of_source = survey.observations[source], block.source == source
            for name in table.ties:
                keep[is_of_source] &= used[getattr(table, name)[block.row[is_of_source]]]
            if table.use is not None:
                share[is_of_source] = table.use[block.row[is_of_source]]
        if not keep.any():
            continue
        share, source, row, component = (
            part[keep] for part in (share, block.source, block.row, block.component)
        )
        covariance = block.covariance[np.ix_(keep, keep)]
        fields = survey, centre, all_of, source, row, component
        members = Members(
            source, row, component, share, covariance, _correlate(*fields, covariance)
        )
        acting = share > 0
        if not acting.any():
            # The residuals of a rejected block are still compared.
            yield None, members
            continue
        root = np.sqrt(share[acting])
        # A weight factor below 1 enlarges the covariance of the value.
        thin = covariance[np.ix_(acting, acting)] / np.outer(root, root)
        parts = (part[acting] for part in (source, row, component))
        yield _correlate(survey, centre, all_of, *parts, thin), members


def _correlate(survey, centre, all_of, source, row, component, covariance):
    """The Correlated of some values, grouped by table."""
    cuts = np.flatnonzero(np.diff(source)) + 1
    parts = []
    for rows_of_part in np.split(np.arange(len(source)), cuts):
        table = survey.observations[source[rows_of_part[0]]]
        parts.append(
            (
                replace(table, use=None).taken(row[rows_of_part]).relative(centre),
                component[rows_of_part],
            )
        )
    zero = np.zeros((1, len(source)))
    try:
        return Correlated(zero, zero + 1, tuple(parts), covariance, all_of)
    except np.linalg.LinAlgError:
        raise SolutionError(
            message(
                "correlated_covariance_impossible",
                "the correlated observations have an impossible covariance: it is not "
                "positive definite",
            )
        ) from None


def _every_unknown(state):
    """The Layout in which each unknown, fixed or not, has its own number."""
    sizes = {
        "points": (len(state.xyz_m), 3),
        "photos": (len(state.photo_xyz_m), 6),
        "interior": (len(state.interior),),
        **{name_of_nuisance: np.shape(value) for name_of_nuisance, value in state.nuisance.items()},
        "system": (len(state.system), 7),
    }
    first, numbers = 0, {}
    for name, shape in sizes.items():
        count = int(np.prod(shape))
        numbers[name] = first + np.arange(count).reshape(shape)
        first += count
    nuisance = {
        name_of_nuisance: numbers.pop(name_of_nuisance) for name_of_nuisance in state.nuisance
    }
    return Layout(**numbers, nuisance=nuisance)


@dataclass(frozen=True)
class ValueTests:
    """Test results of the k values of a block; see network.reliability.Residuals."""

    residual: np.ndarray
    sd: np.ndarray
    redundancy: np.ndarray
    w: np.ndarray
    mdb: np.ndarray
    external: np.ndarray
    change: np.ndarray
    test_statistic: np.ndarray
    pull: np.ndarray


@dataclass(frozen=True)
class Acting:
    """The k adjusted values of a block with covariance L L'.

    Attributes
    ----------
    own : ndarray of int, shape (k,)
        Positions in the block.
    t : ndarray, shape (k,)
        L^-1 v.
    back : ndarray, shape (k, k)
        L^-1.
    a : ndarray, shape (k, K)
        L^-1 A.
    columns : ndarray of int, shape (K,)
        Columns of the unknowns.
    moves : ndarray, shape (unknowns + 1, k)
        Change of the unknowns by unit errors of t, with a final row of zeros.
    covariance : ndarray, shape (k, k)
    """

    own: np.ndarray
    t: np.ndarray
    back: np.ndarray
    a: np.ndarray
    columns: np.ndarray
    moves: np.ndarray
    covariance: np.ndarray

    @property
    def spread(self):
        """Covariance R (k, k) of the residuals t."""
        return np.eye(len(self.t)) - self.a @ self.moves[self.columns]


def observations_in_use(problem, solution, number, members, v):
    """The Acting of a block.

    Parameters
    ----------
    problem : Problem
    solution : solver solution
    number : int or None
        Number of its group.
    members : Members
    v : ndarray
        Residuals of all values of the block.
    """
    places = np.flatnonzero(members.share > 0)
    if number is None:
        # A rejected block contributes nothing, so all arrays are empty.
        none = np.zeros((0, 0))
        columns = np.zeros(0, dtype=int)
        return Acting(
            places,
            np.zeros(0),
            none,
            none,
            columns,
            np.zeros((problem.model.unknowns + 1, 0)),
            none,
        )
    group, a = problem.observations[number], solution.cofactor.jacobians[number][0]
    columns = problem.model.groups[number].columns
    back = group.whitened(np.eye(len(places)))
    moves = moves_of(solution, columns, a)
    return Acting(places, back @ v[places], back, a, columns[0], moves, group.covariance)


def moves_of(solution, columns, jac):
    """Change (unknowns + 1, m) of the unknowns by unit errors of rows jac (m, K)."""
    changes = np.hstack([part for _, part in responses(solution.cofactor, columns, jac[None])])
    return np.vstack([changes, np.zeros((1, changes.shape[1]))])


def conditional_expectation(members, part, rejected, v, jac):
    """Compare rejected values with their expectation from the other values of the block.

    Parameters
    ----------
    members : Members
    part : Acting
    rejected : ndarray of int, shape (q,)
        Positions of the rejected values in the block.
    v, jac : ndarray
        Residuals (all,) and derivatives (all, K) of the block's values.

    Returns
    -------
    off : ndarray, shape (q,)
        Difference from the expectation.
    away : ndarray, shape (q, K)
        Derivatives of the difference.
    unexplained : ndarray, shape (q, q)
        Its covariance without the contribution of the unknowns.
    share : ndarray, shape (q, k)
        Weights of the other values.
    """
    q, own = members.covariance, part.own
    # Weight factors below 1 scale the covariance of the adjusted values.
    scale = np.sqrt(members.share[own])
    between = q[np.ix_(own, rejected)] / scale[:, None]
    # Conditional expectation of a normal distribution: Q_12 Q_22^-1 times the other residuals.
    share = np.linalg.solve(part.covariance, between).T if len(own) else between.T
    off, away = v[rejected] - share @ v[own], jac[rejected] - share @ jac[own]
    return off, away, q[np.ix_(rejected, rejected)] - share @ between, share


def test_values(problem, solution, number, members, delta0):
    """Test the values of a block; the test statistic refers to whole observations.

    Parameters
    ----------
    problem : Problem
    solution : solver solution
    number : int or None
        Number of the group in the problem; None: the whole block is rejected.
    members : Members
    delta0 : float
        Noncentrality.

    Returns
    -------
    ValueTests
    """
    v, jac = members.block.linearised(solution.unknowns)
    columns = members.block.columns(problem.layout)
    part = observations_in_use(problem, solution, number, members, v)
    q, own, back, spread = members.covariance, part.own, part.back, part.spread
    points = np.unique(problem.layout.points)
    points = points[points >= 0]
    k = len(v)
    w, mdb, external = np.zeros(k), np.full(k, np.inf), np.full(k, np.inf)
    redundancy, change, statistic = np.ones(k), np.zeros(k), np.zeros(k)
    # c' R c of each value is on the diagonal, c' t in `right`.
    inner = back.T @ spread @ back
    size = np.sum(back**2, axis=0)
    free, right = np.diag(inner), back.T @ part.t
    sound = free > UNCONTROLLED * size
    root = np.sqrt(np.where(sound, free, 1.0))
    w[own] = np.where(sound, right / root, 0.0) / np.sqrt(members.share[own])
    # MDB = delta0 / sqrt(c' R c); without redundancy it is infinite.
    mdb[own] = np.where(sound, delta0 / root, np.inf)
    external[own] = np.where(sound, delta0 * np.sqrt(np.maximum(size - free, 0.0)) / root, np.inf)
    if len(own):
        redundancy[own] = np.diag(np.linalg.cholesky(part.covariance) @ spread @ back)
    change[own] = np.abs(part.moves[points] @ back).max(axis=0, initial=0.0)
    for rows_of_observation in observations_of(members):
        if members.share[rows_of_observation[0]] > 0:
            place = np.searchsorted(own, rows_of_observation)
            test = _together(right[place], inner[np.ix_(place, place)], size[place])
            statistic[rows_of_observation] = test / np.sqrt(members.share[rows_of_observation[0]])
        else:
            off, away, unexplained, _ = conditional_expectation(
                members, part, rows_of_observation, v, jac
            )
            # Covariance of the difference: values themselves, plus the adjusted unknowns.
            total = unexplained + away @ moves_of(solution, columns, away)[columns[0]]
            sds = np.sqrt(np.diag(total))
            w[rows_of_observation], mdb[rows_of_observation] = off / sds, delta0 * sds
            inverse = np.linalg.inv(total)
            statistic[rows_of_observation] = _together(inverse @ off, inverse, np.diag(inverse))
    sd = np.sqrt(np.diag(q))
    pull = np.zeros(k)
    pull[own] = right * sd[own]
    return ValueTests(v, sd, redundancy, w, mdb, external, change * sd, statistic, pull)


def observations_of(members):
    """Positions of the values of each observation."""
    key = np.column_stack([members.source, members.row])
    _, which = np.unique(key, axis=0, return_inverse=True)
    return [np.flatnonzero(which.ravel() == i) for i in range(which.max() + 1)]


def _together(right, inner, size):
    """Joint test statistic of q values, scaled to the critical value of a single one (0.1 %)."""
    values, ways = np.linalg.eigh(inner / np.sqrt(np.outer(size, size)))
    # Directions without redundancy cannot be tested.
    sound = values > UNCONTROLLED
    if not sound.any():
        return 0.0
    along = ways[:, sound].T @ (right / np.sqrt(size))
    square = float(np.sum(along**2 / values[sound]))
    return np.sqrt(square) * -ndtri(ALPHA / 2) / np.sqrt(chdtri(int(sound.sum()), ALPHA))
