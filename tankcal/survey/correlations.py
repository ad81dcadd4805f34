"""Which values of a survey are correlated, in blocks: vectors, and pairs that a table names."""

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from tankcal.errors import InputError, Problem
from tankcal.messages import message
from tankcal.survey.observations import Block, ControlCoordinates

SMALLEST = 1e-10  # eigenvalue of a correlation matrix: below it the values contradict


def rows_of(correlated, table):
    """Rows of a table that job.CorrelatedReadings (or None) name."""
    if correlated is None:
        return frozenset()
    mine = np.array([[name == table for name in pair] for pair in correlated.tables])
    return frozenset(correlated.at[mine].tolist())


def blocks_of(measurements, observations):
    """The Blocks of correlated values of a survey's observations.

    Raises InputError for correlations that are not possible together.
    """
    sources, rows, components, sds, places = [], [], [], [], {}
    pairs = []
    for source, one in enumerate(observations):
        trace = one.trace
        table = "control" if isinstance(one, ControlCoordinates) else trace.table
        own = table == "vectors"
        named = rows_of(measurements.correlated, table)
        sd = np.reshape(one.sd, (len(one), one.rows))
        for row in range(len(one)):
            if not own and trace.rows[row] not in named:
                continue
            axes = one.axis[row : row + 1] if table == "control" else np.arange(one.rows)
            for component, axis in enumerate(axes.tolist()):
                places[table, trace.rows[row], axis] = len(sources)
                sources.append(source)
                rows.append(row)
                components.append(component)
                sds.append(sd[row, component])
    pairs += _within_vectors(measurements, places)
    pairs += _between(measurements.correlated, places)
    return _split(np.array(sources), np.array(rows), np.array(components), np.array(sds), pairs)


def _within_vectors(measurements, places):
    """(place, place, r, Problem's place) of the components of each vector."""
    for table in measurements.readings:
        if table.table != "vectors":
            continue
        for i, row in enumerate(table.rows):
            for k, (a, b) in enumerate(((0, 1), (0, 2), (1, 2))):
                if ("vectors", row, a) in places:
                    ends = (places["vectors", row, axis] for axis in (a, b))
                    yield (*ends, table.correlation[i, k], (table.file, row, "r_xy"))


def _between(correlated, places):
    """The same of the pairs that a table names; values that are not adjusted are left out."""
    if correlated is None:
        return
    for i, tables in enumerate(correlated.tables):
        ends = [
            places.get((table, int(correlated.at[i, k]), int(correlated.axis[i, k])))
            for k, table in enumerate(tables)
        ]
        if None not in ends:
            yield (*ends, correlated.r[i], (correlated.file, correlated.rows[i], "r"))


def _split(sources, rows, components, sds, pairs):
    """Blocks that hang together by their pairs."""
    if not len(sources):
        return ()
    n = len(sources)
    a, b = (np.array([pair[k] for pair in pairs], dtype=int) for k in (0, 1))
    _, first = np.unique(np.column_stack([sources, rows]), axis=0, return_inverse=True)
    of_row = np.full(first.max() + 1, -1)
    of_row[first[::-1]] = np.arange(n)[::-1]
    ties = np.concatenate([a, np.arange(n)]), np.concatenate([b, of_row[first.ravel()]])
    graph = coo_array((np.ones(len(ties[0])), ties), shape=(n, n))
    count, label = connected_components(graph, directed=False)
    r = np.eye(n)
    r[a, b] = r[b, a] = [pair[2] for pair in pairs]
    found = []
    for one in range(count):
        mine = np.flatnonzero(label == one)
        mine = mine[np.lexsort([components[mine], rows[mine], sources[mine]])]
        part = r[np.ix_(mine, mine)]
        if np.linalg.eigvalsh(part)[0] < SMALLEST or not (sds[mine] > 0).all():
            _refuse(len(mine), next(pair[3] for pair in pairs if pair[0] in mine))
        covariance = part * np.outer(sds[mine], sds[mine])
        found.append(Block(sources[mine], rows[mine], components[mine], covariance))
    return tuple(found)


def _refuse(count, place):
    file, row, column = place
    text = message(
        "impossible_correlations",
        "these correlations of {count} values are not possible together: no covariance matrix has"
        " them (its smallest eigenvalue is not positive, or a standard deviation is 0)",
        count=count,
    )
    raise InputError(Problem(file, text, row, column))
