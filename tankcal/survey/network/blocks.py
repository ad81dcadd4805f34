"""Correlated observations of a survey: what enters the solver, and what their residuals say.

With the covariance Q = L L' of the values of a block, A their derivatives and N the normal matrix,

    R = I - L^-1 A N^-1 A' L^-T,   c = L^-1 e,   t = L^-1 v
    w = c' t / sqrt(c' R c)        MDB = delta0 / sqrt(c' R c)

for a blunder in the direction e; of one value e has a single 1. The redundancy number of a value is
the diagonal of L R L^-1; they add up to the redundancy, but single ones may leave 0 to 1, so that
they do not enter w or MDB. A value that is set aside is compared with what the others and its
correlation with them let expect. Source: Baarda 1968; Teunissen 2006, Testing theory, ch. 4.
"""

from dataclasses import dataclass, replace

import numpy as np
from scipy.special import chdtri, ndtri

from tankcal.adjust import ALPHA, UNCONTROLLED
from tankcal.errors import SolutionError
from tankcal.messages import message
from tankcal.solver.effects import responses
from tankcal.survey.observations import Correlated, Layout

CORRELATED = "correlated"  # source of their groups; their residuals stand under their own tables


@dataclass(frozen=True)
class Members:
    """Values of a block, those between points that are used.

    source, row, component  (k,) see Block       share  (k,) with which each takes part
    covariance              (k, k) as declared   block  Correlated of all of them
    """

    source: np.ndarray
    row: np.ndarray
    component: np.ndarray
    share: np.ndarray
    covariance: np.ndarray
    block: Correlated


def is_in_block(survey, number):
    """(n,) True for the observations of a table that stand in a block of correlated values."""
    found = np.zeros(len(survey.observations[number]), dtype=bool)
    for block in survey.correlated:
        found[block.row[block.source == number]] = True
    return found


def correlated_groups(survey, used, centre, state):
    """Pairs (Correlated, Members) for the blocks of a survey.

    used  (points,) points that take part        state  State, for its sizes

    None for the Correlated of a block that is set aside as a whole: only its residuals matter.
    """
    all_of = _every_unknown(state) if survey.correlated else None
    for block in survey.correlated:
        keep = np.ones(len(block.row), dtype=bool)
        share = np.ones(len(block.row))
        for source in np.unique(block.source):
            one, mine = survey.observations[source], block.source == source
            for name in one.ties:
                keep[mine] &= used[getattr(one, name)[block.row[mine]]]
            if one.use is not None:
                share[mine] = one.use[block.row[mine]]
        if not keep.any():
            continue
        share, source, row, component = (
            part[keep] for part in (share, block.source, block.row, block.component)
        )
        covariance = block.covariance[np.ix_(keep, keep)]
        fields = survey, centre, all_of, source, row, component
        members = Members(source, row, component, share, covariance, _made(*fields, covariance))
        acting = share > 0
        if not acting.any():
            yield None, members
            continue
        root = np.sqrt(share[acting])
        thin = covariance[np.ix_(acting, acting)] / np.outer(root, root)
        parts = (part[acting] for part in (source, row, component))
        yield _made(survey, centre, all_of, *parts, thin), members


def _made(survey, centre, all_of, source, row, component, covariance):
    """The Correlated of some values, those of one table together as they stand."""
    cuts = np.flatnonzero(np.diff(source)) + 1
    parts = []
    for mine in np.split(np.arange(len(source)), cuts):
        one = survey.observations[source[mine[0]]]
        parts.append((replace(one, use=None).taken(row[mine]).relative(centre), component[mine]))
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
    """The Layout in which each unknown, also what is fixed, has a number of its own."""
    sizes = {
        "points": (len(state.xyz_m), 3),
        "photos": (len(state.photo_xyz_m), 6),
        "interior": (len(state.interior),),
        **{of: np.shape(value) for of, value in state.nuisance.items()},
        "system": (len(state.system), 7),
    }
    first, found = 0, {}
    for name, shape in sizes.items():
        count = int(np.prod(shape))
        found[name] = first + np.arange(count).reshape(shape)
        first += count
    nuisance = {of: found.pop(of) for of in state.nuisance}
    return Layout(**found, nuisance=nuisance)


@dataclass(frozen=True)
class ValueTests:
    """What is said of the k values of a block; see network.reliability.Residuals."""

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
    """The values of a block that take part in the adjustment, k of all; L L' their covariance.

    own    (k,) places in the block            t  (k,) L^-1 v
    back   (k, k) L^-1                         a  (k, K) L^-1 A, and the column of each unknown (K,)
    moves  (unknowns + 1, k) change of the unknowns by errors of one of t; a row of zeros at the end
    covariance  (k, k)
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
        """(k, k) R: covariance of the residuals t."""
        return np.eye(len(self.t)) - self.a @ self.moves[self.columns]


def observations_in_use(problem, solution, number, members, v):
    """The Acting of a block; number of its group or None, v (all,) its residuals."""
    own = np.flatnonzero(members.share > 0)
    if number is None:
        none = np.zeros((0, 0))
        columns = np.zeros(0, dtype=int)
        return Acting(
            own, np.zeros(0), none, none, columns, np.zeros((problem.model.unknowns + 1, 0)), none
        )
    group, a = problem.observations[number], solution.cofactor.jacobians[number][0]
    columns = problem.model.groups[number].columns
    back = group.whitened(np.eye(len(own)))
    moves = moves_of(solution, columns, a)
    return Acting(own, back @ v[own], back, a, columns[0], moves, group.covariance)


def moves_of(solution, columns, jac):
    """Change (unknowns + 1, m) of the unknowns by an error of one of rows jac (m, K)."""
    found = np.hstack([part for _, part in responses(solution.cofactor, columns, jac[None])])
    return np.vstack([found, np.zeros((1, found.shape[1]))])


def conditional_expectation(members, part, mine, v, jac):
    """What the others and the correlation with them let expect of values that are set aside.

    mine  (q,) places in the block      v, jac  (all,), (all, K) of the block's values

    Returns the difference off (q,) to that and its derivatives (q, K), its covariance (q, q) as far
    as the unknowns do not enter it, and the shares (q, k) of the others.
    """
    q, own = members.covariance, part.own
    scale = np.sqrt(members.share[own])
    between = q[np.ix_(own, mine)] / scale[:, None]
    share = np.linalg.solve(part.covariance, between).T if len(own) else between.T
    off, away = v[mine] - share @ v[own], jac[mine] - share @ jac[own]
    return off, away, q[np.ix_(mine, mine)] - share @ between, share


def test_values(problem, solution, number, members, delta0):
    """The ValueTests of the values of a block; the test statistic of a value is its observation's.

    number  of its group in the problem; None: all of it is set aside
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
    inner = back.T @ spread @ back
    size = np.sum(back**2, axis=0)
    free, right = np.diag(inner), back.T @ part.t
    sound = free > UNCONTROLLED * size
    root = np.sqrt(np.where(sound, free, 1.0))
    w[own] = np.where(sound, right / root, 0.0) / np.sqrt(members.share[own])
    mdb[own] = np.where(sound, delta0 / root, np.inf)
    external[own] = np.where(sound, delta0 * np.sqrt(np.maximum(size - free, 0.0)) / root, np.inf)
    if len(own):
        redundancy[own] = np.diag(np.linalg.cholesky(part.covariance) @ spread @ back)
    change[own] = np.abs(part.moves[points] @ back).max(axis=0, initial=0.0)
    for mine in observations_of(members):
        if members.share[mine[0]] > 0:
            place = np.searchsorted(own, mine)
            test = _together(right[place], inner[np.ix_(place, place)], size[place])
            statistic[mine] = test / np.sqrt(members.share[mine[0]])
        else:
            off, away, unexplained, _ = conditional_expectation(members, part, mine, v, jac)
            total = unexplained + away @ moves_of(solution, columns, away)[columns[0]]
            sds = np.sqrt(np.diag(total))
            w[mine], mdb[mine] = off / sds, delta0 * sds
            inverse = np.linalg.inv(total)
            statistic[mine] = _together(inverse @ off, inverse, np.diag(inverse))
    sd = np.sqrt(np.diag(q))
    pull = np.zeros(k)
    pull[own] = right * sd[own]
    return ValueTests(v, sd, redundancy, w, mdb, external, change * sd, statistic, pull)


def observations_of(members):
    """Places of the values of each observation."""
    key = np.column_stack([members.source, members.row])
    _, which = np.unique(key, axis=0, return_inverse=True)
    return [np.flatnonzero(which.ravel() == i) for i in range(which.max() + 1)]


def _together(right, inner, size):
    """Test quantity of q values at once, brought to the critical value of one (0.1 %)."""
    values, ways = np.linalg.eigh(inner / np.sqrt(np.outer(size, size)))
    sound = values > UNCONTROLLED
    if not sound.any():
        return 0.0
    along = ways[:, sound].T @ (right / np.sqrt(size))
    square = float(np.sum(along**2 / values[sound]))
    return np.sqrt(square) * -ndtri(ALPHA / 2) / np.sqrt(chdtri(int(sound.sum()), ALPHA))
