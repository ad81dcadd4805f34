"""Heights from levelling and slopes, by least absolute deviations.

Slopes become height differences with the horizontal length of their line. Iteratively reweighted
least squares minimizes the sum of absolute misfits (Schlossmacher 1973), so that a blunder is
outvoted where a height is controlled.
"""

import numpy as np
from scipy.sparse import coo_array, csr_array, diags_array
from scipy.sparse.csgraph import connected_components
from scipy.sparse.linalg import spsolve

from tankcal.survey.observations import HeightDifferences
from tankcal.survey.start.plan import look_up

ROUNDS = 25
NOISE_M = 1e-4  # misfits below this count as equal


def add_heights(survey, plan, xyz_m, free):
    """Add all z that follow from height differences and slopes.

    Parameters
    ----------
    survey : network.Survey
    plan : Plan
    xyz_m : ndarray, shape (points, 3)
    free : bool
        Whether a network without known z may start with its first point at z = 0.

    Returns
    -------
    ndarray, shape (points, 3)
    """
    start, end, rise = _differences(survey, plan, xyz_m)
    z = xyz_m[:, 2].copy()
    if not len(start):
        return xyz_m
    n = len(z)
    # Only a connected component with a known z has a height datum.
    graph = coo_array((np.ones(len(start)), (start, end)), shape=(n, n))
    label = connected_components(graph, directed=False)[1]
    has_datum = np.zeros(n, dtype=bool)
    has_datum[label[np.isfinite(z)]] = True
    tied = np.unique(np.concatenate([start, end]))
    if free and not np.isfinite(z).any():
        largest = np.bincount(label[tied]).argmax()
        z[tied[label[tied] == largest][0]] = 0.0
        has_datum[largest] = True
    unknown = tied[has_datum[label[tied]] & ~np.isfinite(z[tied])]
    if len(unknown):
        rows = has_datum[label[start]]
        z[unknown] = _balance_heights(z, unknown, start[rows], end[rows], rise[rows])
    return np.column_stack([xyz_m[:, :2], z])


def _differences(survey, plan, xyz_m):
    """Points start, end (n,), and z of end minus z of start (n,), m."""
    pair = plan.pairs(plan.low, plan.high)
    flat = look_up(*plan.lengths(xyz_m[:, 2]), pair)
    known = np.linalg.norm(xyz_m[plan.high, :2] - xyz_m[plan.low, :2], axis=1)
    # Coordinates give the length of the line more reliably than a single distance.
    flat = np.where(np.isfinite(known), known, flat)
    by_slope = flat * np.tan(plan.slope) + plan.lift + plan.bend * flat**2
    good = np.isfinite(by_slope)
    parts = [(plan.low[good], plan.high[good], by_slope[good])]
    for item in survey.observations:
        if isinstance(item, HeightDifferences):
            accepted = item.in_use
            parts.append((item.start[accepted], item.end[accepted], item.value[accepted]))
    start, end, rise = (np.concatenate(column) for column in zip(*parts, strict=True))
    return start, end, rise


def _balance_heights(z, unknown, start, end, rise):
    """Heights (k,) of unknown points with the least sum of absolute misfits."""
    place = np.full(len(z), -1)
    place[unknown] = np.arange(len(unknown))
    open_ended = (place[start] >= 0) | (place[end] >= 0)
    start, end, rise = start[open_ended], end[open_ended], rise[open_ended]
    rows = np.arange(len(start))
    up, down = place[end] >= 0, place[start] >= 0
    a = coo_array(
        (
            np.concatenate([np.ones(up.sum()), -np.ones(down.sum())]),
            (
                np.concatenate([rows[up], rows[down]]),
                np.concatenate([place[end[up]], place[start[down]]]),
            ),
        ),
        shape=(len(start), len(unknown)),
    ).tocsr()
    right = rise - np.where(up, 0.0, z[end]) + np.where(down, 0.0, z[start])
    weight = np.ones(len(start))
    for _ in range(ROUNDS):
        heavy = a.T @ diags_array(weight)
        heights = np.atleast_1d(spsolve(csr_array(heavy @ a).tocsc(), heavy @ right))
        # Weight 1 / |misfit| turns the sum of squares into the sum of absolute values.
        weight = 1 / np.maximum(np.abs(a @ heights - right), NOISE_M)
    return heights
