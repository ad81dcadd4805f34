"""Positions from distances only: shortest paths complete the distance matrix, scaling solves it.

Classical scaling of the matrix of shortest paths gives a start for damped Gauss-Newton on the
measured distances. Source: Torgerson 1952; Shang et al. 2003 (MDS-MAP).
"""

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components, shortest_path

from tankcal.adjust import Damping, gauss_newton

MOST = 400  # points of a network of distances
TRIES = 12
STEPS = 80
UNFOLDING = 10
MISFIT = 0.01  # relative misfit that most distances must meet
LOOSE = 1e-5  # relative singular value of a motion that no distance determines
FLAT = 1e-2  # relative thickness below which neighbours lie on a line or in a plane


def lay_out_networks(low, high, length, dims, rng):
    """Yield points (k,) and places (k, dims) of each rigid network of distances.

    The places have a frame of their own and may be mirrored. Points whose neighbours lie on a line
    (in a plane) could be reflected and are omitted.

    Parameters
    ----------
    low, high : ndarray of int, shape (n,)
        Points of each distance.
    length : ndarray, shape (n,)
        Distances, m.
    dims : int
        2 or 3.
    rng : numpy.random.Generator
    """
    points, ends = np.unique(np.concatenate([low, high]), return_inverse=True)
    a, b = ends[: len(low)], ends[len(low) :]
    graph = coo_array((length, (a, b)), shape=(len(points),) * 2)
    count, label = connected_components(graph, directed=False)
    for network in range(count):
        nodes = np.flatnonzero(label == network)
        if not dims < len(nodes) <= MOST:
            continue
        nodes = _well_tied(nodes, a, b, dims)
        rows = np.isin(a, nodes) & np.isin(b, nodes)
        if len(nodes) <= dims:
            continue
        place = np.full(len(points), -1)
        place[nodes] = np.arange(len(nodes))
        places = _place_network(place[a[rows]], place[b[rows]], length[rows], len(nodes), dims, rng)
        if places is not None:
            firm = _firm(places, place[a[rows]], place[b[rows]], dims)
            yield points[nodes[firm]], places[firm]


def _well_tied(nodes, a, b, dims):
    """Nodes with at least `dims` distances to one another."""
    while True:
        inside = np.isin(a, nodes) & np.isin(b, nodes)
        count = np.bincount(np.concatenate([a[inside], b[inside]]), minlength=nodes.max() + 1)
        remaining = nodes[count[nodes] >= dims]
        # Removing a node may weaken its neighbours, so repeat.
        if len(remaining) == len(nodes) or not len(remaining):
            return remaining
        nodes = remaining


def _place_network(a, b, length, n, dims, rng):
    """Places (n, dims) that fit the distances, or None."""
    graph = coo_array((length, (a, b)), shape=(n, n)).tocsr()
    ways = shortest_path(graph, directed=False)
    if not np.isfinite(ways).all():
        return None
    middle = np.eye(n) - 1 / n
    # Double centring turns squared distances into scalar products; their eigenvectors are the
    # places.
    values, vectors = np.linalg.eigh(-0.5 * middle @ ways**2 @ middle)
    start = vectors[:, -dims:] * np.sqrt(np.maximum(values[-dims:], 0.0))
    for trial in range(TRIES):
        shake = 0.0 if not trial else 0.3 * np.median(length)
        xyz = _fit_places(start + shake * rng.normal(size=start.shape), a, b, length)
        xyz = _unfold(xyz, a, b, length)
        off = np.abs(np.linalg.norm(xyz[a] - xyz[b], axis=1) - length)
        # 80 % of the distances must fit: blunders may remain.
        keep = np.sort(off / length)[min(len(off) - 1, int(0.8 * len(off)))]
        if keep < MISFIT:
            return xyz if _rigid(xyz, a, b) else None
    return None


def _unfold(xyz, a, b, length):
    """Move points on the wrong side to the position that fits their neighbours."""
    for _ in range(UNFOLDING):
        off = np.abs(np.linalg.norm(xyz[a] - xyz[b], axis=1) - length) / length
        worst = np.array([np.median(off[(a == i) | (b == i)]) for i in range(len(xyz))])
        node = int(np.argmax(worst))
        if worst[node] < MISFIT:
            break
        near = np.concatenate([b[a == node], a[b == node]])
        away = np.concatenate([length[a == node], length[b == node]])
        middle = xyz[near].mean(axis=0)
        # Differences of the circle equations are linear in the position.
        rows = 2 * (xyz[near] - middle)
        right = np.sum((xyz[near] - middle) ** 2, axis=1) - away**2
        moved = xyz.copy()
        moved[node] = middle + np.linalg.lstsq(rows, right - right.mean(), rcond=None)[0]
        moved = _fit_places(moved, a, b, length)
        new = np.abs(np.linalg.norm(moved[a] - moved[b], axis=1) - length) / length
        if not new.sum() < off.sum():
            break
        xyz = moved
    return xyz


def _distances(xyz, a, b):
    """Distances (n,) between places, above zero for the derivatives."""
    return np.maximum(np.linalg.norm(xyz[a] - xyz[b], axis=1), 1e-12)


def _rows(xyz, a, b):
    """Derivatives (n, points dims) of distances, and the distances (n,)."""
    d, s = xyz[a] - xyz[b], _distances(xyz, a, b)
    jac = np.zeros((len(a), *xyz.shape))
    rows = np.arange(len(a))
    jac[rows, a] = d / s[:, None]
    jac[rows, b] = -d / s[:, None]
    return jac.reshape(len(a), -1), s


def _fit_places(xyz, a, b, length):
    """Places after damped Gauss-Newton steps with Cauchy weights beyond the median misfit."""

    def scale_of(off):
        return max(3 * float(np.median(np.abs(off))), 1e-9 * float(length.max()))

    def step_at(xyz, damping):
        jac, distance = _rows(xyz, a, b)
        off = distance - length
        weight = 1 / (1 + (off / scale_of(off)) ** 2)
        normal = (jac * weight[:, None]).T @ jac
        gradient = jac.T @ (weight * off)
        return -np.linalg.solve(normal + damping * np.eye(len(normal)), gradient)

    def is_better(candidate, xyz):
        off, new = (_distances(places, a, b) - length for places in (xyz, candidate))
        # Both costs refer to one scale; otherwise a larger scale would seem to reduce the cost.
        scale = scale_of(off)
        old_cost, new_cost = (float(np.sum(np.log1p((v / scale) ** 2))) for v in (off, new))
        return new_cost < old_cost

    return gauss_newton(
        step_at,
        xyz,
        move=lambda xyz, step: xyz + step.reshape(xyz.shape),
        is_better=is_better,
        is_small=lambda step: np.abs(step).max() < 1e-9 * length.max(),
        most_steps=STEPS,
        damping=Damping(relax=5.0, most=1e6),
    )


def _rigid(xyz, a, b):
    """Whether the distances determine the shape of the network."""
    n, dims = xyz.shape
    singular = np.linalg.svd(_rows(xyz, a, b)[0], compute_uv=False)
    # All coordinates except the rigid motions, dims (dims + 1) / 2.
    rank = n * dims - dims * (dims + 1) // 2
    return len(singular) >= rank and singular[rank - 1] > LOOSE * singular[0]


def _firm(xyz, a, b, dims):
    """Mask (n,) of points that cannot be reflected at the line or plane of their neighbours."""
    n = len(xyz)
    firm = np.ones(n, dtype=bool)
    if n <= dims + 1:
        return firm  # reflecting a triangle or a tetrahedron only mirrors it
    for node in range(n):
        near = np.concatenate([b[a == node], a[b == node]])
        spread = np.linalg.svd(xyz[near] - xyz[near].mean(axis=0), compute_uv=False)
        firm[node] = len(spread) >= dims and spread[dims - 1] > FLAT * spread[0]
    return firm
