"""What else would explain a blunder: readings that agree as badly when the one set aside is back.

With a set-aside observation i back (residual e, whitened row J) the sum of squares grows by

    T_i = e' S^-1 e,   S = 1 + J Q J'

and the test quantities of all others become, with B = J_j Q J',

    w_j = (v - B S^-1 e) / sqrt(r + B S^-1 B')

Were j the blunder instead, the sum of squares would be larger by T_i - w_j^2 only: where that is
small, the survey cannot tell the two apart. Source: Foerstner 1983, Reliability and discernability
of extended Gauss-Markov models.
"""

import numpy as np

from tankcal.gauss_markov.effects import responses
from tankcal.network.cleaning import CRITICAL
from tankcal.network.reliability import UNCONTROLLED

APART = 10.8  # chi-square, 1 degree of freedom, 0.1 %


def alternatives(adjusted, source, row):
    """[(source, row)] of readings that may be the blunder in place of one that was set aside.

    The likeliest first. Empty where the survey tells them apart.
    """
    problem, solution = adjusted.problem, adjusted.solution
    of_source = [k for k, one in enumerate(problem.sources) if one == source]
    number = next((k for k in of_source if row in problem.rows_of[k]), None)
    if number is None:
        return []  # its points are no longer adjusted
    mine = np.flatnonzero(problem.rows_of[number] == row)
    whole = problem.observations[number].taken(mine)
    whole = whole.using(np.ones(1))
    e = np.empty((1, whole.rows))
    jac = np.empty((1, whole.rows, problem.model.groups[number].columns.shape[1]))
    whole.fill(solution.state, e, jac)
    columns = problem.model.groups[number].columns[mine]
    moves = np.hstack([part for _, part in responses(solution, columns, jac)])
    moves = np.vstack([moves, np.zeros((1, moves.shape[1]))])
    s = np.eye(whole.rows) + jac[0] @ moves[columns[0]]
    back = np.linalg.solve(s, e[0])
    limit, found = max(float(e[0] @ back) - APART, CRITICAL**2), []
    for k, table in enumerate(adjusted.residuals[: len(problem.sources)]):
        if table.source == "known beforehand":
            continue
        b = np.einsum("nmk,nkd->nmd", solution.jacobians[k], moves[problem.model.groups[k].columns])
        v = table.residual / table.sd - b @ back
        r = table.redundancy + np.einsum("nmd,de,nme->nm", b, np.linalg.inv(s), b)
        square = np.where(r > UNCONTROLLED, v**2 / np.maximum(r, UNCONTROLLED), 0.0).max(axis=1)
        for i in np.flatnonzero(table.used & (square > limit)):
            found.append((square[i], table.source, int(table.rows[i])))
    return [one[1:] for one in sorted(found, key=lambda one: -one[0])]
