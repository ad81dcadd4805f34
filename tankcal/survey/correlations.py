"""Blocks of correlated values of a survey: vectors, and pairs listed in a table."""

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from tankcal.errors import InputError, Problem
from tankcal.messages import message
from tankcal.survey.observations import Block, ControlCoordinates

# smallest eigenvalue accepted of a correlation matrix; below it the values contradict
SMALLEST = 1e-10


def rows_of(correlated, table):
    """Set of the rows of a table that CorrelatedReadings (or None) name."""
    if correlated is None:
        return frozenset()
    is_in_table = np.array([[name == table for name in pair] for pair in correlated.tables])
    return frozenset(correlated.at[is_in_table].tolist())


def blocks_of(measurements, observations):
    """Return the Blocks of correlated values of a survey's observations.

    Parameters
    ----------
    measurements : Measurements
    observations : sequence of Observations

    Returns
    -------
    tuple of Block

    Raises
    ------
    InputError
        If a block of correlations has no positive definite covariance matrix.
    """
    sources, rows, components, sds, places = [], [], [], [], {}
    pairs = []
    for source, observations_of_source in enumerate(observations):
        trace = observations_of_source.trace
        table = "control" if isinstance(observations_of_source, ControlCoordinates) else trace.table
        is_vector = table == "vectors"
        correlated_rows = rows_of(measurements.correlated, table)
        sd = np.reshape(
            observations_of_source.sd, (len(observations_of_source), observations_of_source.rows)
        )
        for row in range(len(observations_of_source)):
            # All components of a vector enter a block; of other tables only the listed rows do.
            if not is_vector and trace.rows[row] not in correlated_rows:
                continue
            axes = (
                observations_of_source.axis[row : row + 1]
                if table == "control"
                else np.arange(observations_of_source.rows)
            )
            for component, axis in enumerate(axes.tolist()):
                places[table, trace.rows[row], axis] = len(sources)
                sources.append(source)
                rows.append(row)
                components.append(component)
                sds.append(sd[row, component])
    pairs += _vector_correlations(measurements, places)
    pairs += _listed_correlations(measurements.correlated, places)
    return _split(np.array(sources), np.array(rows), np.array(components), np.array(sds), pairs)


def _vector_correlations(measurements, places):
    """Yield (place, place, r, (file, row, column)) for the components of each vector."""
    for table in measurements.readings:
        if table.table != "vectors":
            continue
        for i, row in enumerate(table.rows):
            for k, (a, b) in enumerate(((0, 1), (0, 2), (1, 2))):
                if ("vectors", row, a) in places:
                    ends = (places["vectors", row, axis] for axis in (a, b))
                    yield (*ends, table.correlation[i, k], (table.file, row, "r_xy"))


def _listed_correlations(correlated, places):
    """Yield (place, place, r, (file, row, column)) for listed pairs of adjusted values."""
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
    """Split the correlated values into independent Blocks.

    Parameters
    ----------
    sources, rows, components : ndarray of int, shape (n,)
        Table, row and component of each value.
    sds : ndarray, shape (n,)
    pairs : list of tuple
        (place, place, r, (file, row, column)).

    Returns
    -------
    tuple of Block

    Raises
    ------
    InputError
        If a correlation matrix is not positive definite, or a standard deviation is 0.
    """
    if not len(sources):
        return ()
    n = len(sources)
    a, b = (np.array([pair[k] for pair in pairs], dtype=int) for k in (0, 1))
    _, first = np.unique(np.column_stack([sources, rows]), axis=0, return_inverse=True)
    of_row = np.full(first.max() + 1, -1)
    of_row[first[::-1]] = np.arange(n)[::-1]
    # Components of a row stay in one block even without a listed correlation: an observation is
    # adjusted as a whole.
    ties = np.concatenate([a, np.arange(n)]), np.concatenate([b, of_row[first.ravel()]])
    # Connected components of the graph of pairs are mutually uncorrelated.
    graph = coo_array((np.ones(len(ties[0])), ties), shape=(n, n))
    count, label = connected_components(graph, directed=False)
    r = np.eye(n)
    r[a, b] = r[b, a] = [pair[2] for pair in pairs]
    blocks = []
    for block in range(count):
        members = np.flatnonzero(label == block)
        # Sort by source, row and component, the order in which observations list their values.
        members = members[np.lexsort([components[members], rows[members], sources[members]])]
        part = r[np.ix_(members, members)]
        if np.linalg.eigvalsh(part)[0] < SMALLEST or not (sds[members] > 0).all():
            _refuse(len(members), next(pair[3] for pair in pairs if pair[0] in members))
        covariance = part * np.outer(sds[members], sds[members])
        blocks.append(Block(sources[members], rows[members], components[members], covariance))
    return tuple(blocks)


def _refuse(count, place):
    file, row, column = place
    text = message(
        "impossible_correlations",
        "these correlations of {count} values are not possible together: no covariance matrix has"
        " them (its smallest eigenvalue is not positive, or a standard deviation is 0)",
        count=count,
    )
    raise InputError(Problem(file, text, row, column))
