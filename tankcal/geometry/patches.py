"""Patches of rejected points on a wall that may belong to it: seams, buckles and columns.

A patch is a group of connected points that the test against the smooth form of the shell rejected,
with departures of the same sign.

A seam continues the wall: between the wall and its greatest depth there are points of every depth,
whatever its profile (a cosine, a cusp, or flat with flanks). A pipe, a bar or a tray has a jump.
The visible side of a pipe departs by at least half its crest, since the crest is a diameter or more
from the wall. For the same reason, a pipe is never wider than the distance of its crest.

A buckle is a part of the wall, however deep: within its outline, no point of the regular wall is
visible. An object in front of the wall (the treads of a stair, a pipe, the rim of a nozzle) is
narrow, or points of the wall are visible between its parts.

A column of points on a narrow seam looks like a pipe: points one above another, at equal distances
from the wall, with regular wall on both sides. The surrounding points distinguish seam and pipe:
the slope of a plate never exceeds one in one, so wall close beside a column shows that the column
is a fitting. Wall between the points of a column shows this as well. A column far from the wall is
a fitting. Even a column that certainly belongs to the wall (because it lies behind the other
points) may be narrower than the wall visible beside it: its contribution is equally uncertain.
"""

import numpy as np
import scipy
from scipy.sparse import csr_array

# Seams
SEAM_LINK_M = 0.1, 4.0  # largest distances across and along a strip, between its points
FEWEST_OF_SEAM = 8  # least number of points of a strip
SHORTEST_SEAM_M, SEAM_SLENDER = 1.2, 2.0  # least height, and least ratio of height to width
WIDER = 1.5  # least ratio of width to depth of a seam: no pipe reaches it
DEPTH = 0.9  # quantile of the departures in a strip that counts as its depth
FLANK = 0.15, 0.6  # range of relative depths of the flank, where a pipe has hardly any point
LEAST_SHARE = 0.25  # points in the flank, relative to evenly distributed depths
DEEPER = 1.4  # departures above 1.4 times the depth do not belong to the seam
# Buckles
BUCKLE_LINK_M = 2.5  # largest distance between neighbouring points of a patch, along the wall
NARROWEST_BUCKLE_M, SHORTEST_BUCKLE_M = 0.4, 0.8  # smallest width and length of a buckle
FEWEST_OF_BUCKLE = 3  # smallest number of points in a patch: three points span an area
# Columns
COLUMN_LINK_M = 0.2, 4.0  # largest distances along the arc and upwards, between points of a column
FEWEST_OF_COLUMN = 2  # least number of points of a column
SHORTEST_COLUMN_M, COLUMN_SLENDER = 0.7, 2.0  # least height, and least ratio of height to width
FARTHEST_M = 0.080  # distance from the wall beyond which a column is a fitting
STEEPEST = 1.0  # largest slope of a plate
COLUMN_SIGMA = 5.0  # least departure of a column, in standard deviations of the wall
DENIED = 0.1  # share of contradicting wall points, over the points of a column, that it tolerates
NO_COLUMN = -1  # number of points outside all columns

SIGMA = 3.0  # standard deviations of the wall that its scatter explains


def find_patches(place_m, members, link_m, fewest):
    """Divide some of the points into patches of connected points.

    Parameters
    ----------
    place_m : ndarray, shape (n, 2)
        Positions along the arc and upwards, m.
    members : ndarray of int, shape (k,)
        Indices of the points to be grouped.
    link_m : float or tuple of (float, float)
        Largest distance between connected points, m; a tuple: along the arc and upwards.
    fewest : int
        Least number of points in a patch.

    Returns
    -------
    list of ndarray of int
        Members of each patch.

    Examples
    --------
    >>> place = np.array([[0.0, 0.0], [0.1, 2.0], [3.0, 0.0], [3.0, 0.5]])
    >>> [patch.tolist() for patch in find_patches(place, np.arange(4), (0.2, 4.0), 2)]
    [[0, 1], [2, 3]]
    >>> [patch.tolist() for patch in find_patches(place, np.arange(4), 1.0, 2)]
    [[2, 3]]
    """
    if len(members) < fewest:
        return []
    from scipy.sparse.csgraph import connected_components

    # Two limits bound a rectangle (maximum norm), a single limit a circle.
    norm = np.inf if np.ndim(link_m) else 2.0
    tree = scipy.spatial.cKDTree(place_m[members] / link_m)
    pairs = tree.query_pairs(1.0, p=norm, output_type="ndarray")
    links = csr_array((np.ones(len(pairs)), pairs.T), shape=(len(members),) * 2)
    count, label = connected_components(links, directed=False)
    patches = [members[label == item] for item in range(count)]
    return [item for item in patches if len(item) >= fewest]


def _find_tall_patches(place_m, members, connection, proportions):
    """Patches of a least height (m), and of a least ratio of height to width."""
    shortest_m, slender = proportions
    patches = find_patches(place_m, members, *connection)
    sizes = (np.ptp(place_m[patch], axis=0) for patch in patches)
    is_tall = [height >= max(shortest_m, slender * width) for width, height in sizes]
    return [patch for patch, tall in zip(patches, is_tall, strict=True) if tall]


def find_seams(place_m, departure_m, rejected, noise_m):
    """Mark points that belong to a narrow seam of the wall.

    A strip is a group of connected rejected points whose departures have the same sign, at least
    1.2 m tall. A strip is a seam if its width exceeds 1.5 times its depth and it has points of
    every depth. Its flank, from 0.15 to 0.6 of the depth, must contain at least a quarter of the
    points expected for evenly distributed depths. The part of the flank within the scatter of the
    wall is excluded from this test. All points of a seam are marked, including those of its flanks.

    Parameters
    ----------
    place_m : ndarray, shape (n, 2)
        Positions along the arc and upwards, m.
    departure_m : ndarray, shape (n,)
        Departures from the smooth form of the shell, fitted without the rejected points, m.
    rejected : ndarray of bool, shape (n,)
    noise_m : float
        Scatter of the wall about that form (standard deviation), m.

    Returns
    -------
    ndarray of bool, shape (n,)

    Examples
    --------
    A groove of 40 mm, 0.4 m wide, and a pipe that is 60 mm off:

    >>> x, z = (axis.ravel() for axis in np.meshgrid(np.linspace(0, 4, 201), np.linspace(0, 4, 21)))
    >>> groove = 0.04 * np.maximum(1 - abs(x - 1) / 0.2, 0)
    >>> pipe = 0.06 * (abs(x - 3) < 0.06)
    >>> in_seam = find_seams(np.column_stack([x, z]), pipe - groove, groove + pipe > 0.013, 0.001)
    >>> int(in_seam[groove > 0.013].sum()), int(in_seam[pipe > 0].sum())
    (273, 0)
    """
    in_seam = np.zeros(len(rejected), dtype=bool)
    order = np.argsort(place_m[:, 0], kind="stable")
    arc = place_m[order, 0]
    for sign in (-1, 1):
        depth = sign * departure_m
        for strip in _find_tall_patches(
            place_m,
            np.flatnonzero(rejected & (depth > 0)),
            (SEAM_LINK_M, FEWEST_OF_SEAM),
            (SHORTEST_SEAM_M, SEAM_SLENDER),
        ):
            # Neighbourhood of twice the width of the strip, over its height: it contains the
            # flanks.
            begin, end = np.ptp(place_m[strip, 0]) * np.array([-1, 1]) + place_m[strip, 0].mean()
            neighbours = order[np.searchsorted(arc, begin) : np.searchsorted(arc, end)]
            foot, top = place_m[strip, 1].min(), place_m[strip, 1].max()
            neighbours = neighbours[
                (place_m[neighbours, 1] >= foot) & (place_m[neighbours, 1] <= top)
            ]
            # A quantile is robust against single points in front of the seam.
            deepest = np.quantile(depth[strip], DEPTH)
            if _is_seam(place_m[strip], depth[neighbours], deepest, noise_m):
                in_seam[neighbours[np.abs(depth[neighbours]) < DEEPER * deepest]] = True
    return in_seam


def _is_seam(strip_m, depth, deepest, noise_m):
    """Whether a strip (k, 2) is a seam; depth (j,) of all points around it."""
    arc, height = (strip_m - strip_m.mean(axis=0)).T
    # Remove the regression line over the height: a leaning strip appears wider than it is.
    straightened = arc - height * (arc @ height) / (height @ height)
    if np.ptp(straightened) < WIDER * deepest:
        return False
    least, most = max(FLANK[0] * deepest, SIGMA * noise_m), FLANK[1] * deepest
    if least >= most:
        return True
    # Expected count for evenly distributed depths: proportional to the depth range of the flank.
    flank = np.count_nonzero((depth > least) & (depth < most))
    return flank >= LEAST_SHARE * (most - least) / deepest * np.count_nonzero(depth > least)


def find_buckles(place_m, departure_m, rejected):
    """Mark rejected points that belong to a buckle of the wall.

    A patch is a group of connected rejected points whose departures have the same sign. A patch is
    a buckle if it is at least 0.8 m long and 0.4 m wide, in any direction, and no other point lies
    within its convex hull.

    Parameters
    ----------
    place_m : ndarray, shape (n, 2)
        Positions along the arc and upwards, m.
    departure_m : ndarray, shape (n,)
        Departures from the smooth form of the shell, fitted without the rejected points, m.
    rejected : ndarray of bool, shape (n,)
        Points that the test rejected.

    Returns
    -------
    ndarray of bool, shape (n,)
        True for points of a buckle.

    Examples
    --------
    Nine points 30 mm behind a wall that is seen all around them:

    >>> x, z = (axis.ravel() for axis in np.meshgrid(np.arange(8.0), np.arange(8.0)))
    >>> departure = -0.03 * (abs(x - 4) < 1.5) * (abs(z - 4) < 1.5)
    >>> buckle = find_buckles(np.column_stack([x, z]), departure, departure < 0)
    >>> int(buckle.sum())
    9
    """
    in_buckle = np.zeros(len(rejected), dtype=bool)
    # An inward and an outward buckle may touch: the signs are treated separately.
    for sign in (-1, 1):
        candidates = np.flatnonzero(rejected & (sign * departure_m > 0))
        for patch in find_patches(place_m, candidates, BUCKLE_LINK_M, FEWEST_OF_BUCKLE):
            in_buckle[patch] = _is_buckle(place_m[patch], np.delete(place_m, patch, axis=0))
    return in_buckle


def _is_buckle(patch_m, others_m):
    """Whether a patch (k, 2) has the size of a buckle and encloses none of the other points."""
    # Principal axes of the patch: a buckle may run in any direction of the wall.
    axes = np.linalg.svd(patch_m - patch_m.mean(axis=0), full_matrices=False)[2]
    length, width = np.ptp(patch_m @ axes.T, axis=0)
    if width < NARROWEST_BUCKLE_M or length < SHORTEST_BUCKLE_M:
        return False
    # `find_simplex` returns -1 for points outside the convex hull of the patch.
    return not np.any(scipy.spatial.Delaunay(patch_m).find_simplex(others_m) >= 0)


def find_columns(place_m, departure_m, rejected, noise_m, turn_m):
    """Number the columns of rejected points that may belong to the wall or to a fitting.

    Parameters
    ----------
    place_m : ndarray, shape (n, 2)
        Positions along the arc and upwards, m.
    departure_m : ndarray, shape (n,)
        Departures from the wall, fitted without the rejected points, m.
    rejected : ndarray of bool, shape (n,)
    noise_m : float
        Scatter of the wall (standard deviation), m.
    turn_m : float
        Circumference along the arc, m.

    Returns
    -------
    ndarray of int, shape (n,)
        Number of the column, from 0; -1 for points in no column.

    Examples
    --------
    A column 40 mm off with the next points at 0.6 m, and x with the wall seen at 20 mm:

    >>> x, z = np.meshgrid([0.0, 0.6, 1.2, 1.8, 2.4, 2.42, 3.0], np.arange(5.0))
    >>> off = np.where((x == 0.6) | (x == 2.4), -0.04, 0.0).ravel()
    >>> place = np.column_stack([x.ravel(), z.ravel()])
    >>> number = find_columns(place, off, off < 0, 0.001, 40.0)
    >>> int(number.max()), [float(x) for x in np.unique(place[number == 0, 0])]
    (0, [0.6])
    """
    numbers, count = np.full(len(rejected), NO_COLUMN), 0
    if np.count_nonzero(rejected) < FEWEST_OF_COLUMN:
        return numbers
    place = _cut_at_gap(place_m, rejected, turn_m)
    for sign in (-1, 1):
        depth = sign * departure_m
        # A shallow column may be chance, a deep column is certainly a fitting: neither is
        # ambiguous.
        for column in _find_tall_patches(
            place,
            np.flatnonzero(rejected & (depth > 0)),
            (COLUMN_LINK_M, FEWEST_OF_COLUMN),
            (SHORTEST_COLUMN_M, COLUMN_SLENDER),
        ):
            if not COLUMN_SIGMA * noise_m < np.median(depth[column]) <= FARTHEST_M:
                continue
            contradictions = _count_contradictions(place, depth, column, ~rejected, noise_m)
            if contradictions > DENIED * len(column):
                continue
            numbers[column] = count
            count += 1
    return numbers


def _cut_at_gap(place_m, rejected, turn_m):
    """Return positions whose arc begins in the widest gap between rejected points.

    No column is then cut in two by the origin of the arc.
    """
    arc = np.sort(place_m[rejected, 0] % turn_m)
    gaps = np.diff(arc, append=arc[0] + turn_m)
    widest = int(np.argmax(gaps))
    place = place_m.copy()
    place[:, 0] = (place_m[:, 0] - arc[widest] - gaps[widest] / 2) % turn_m
    return place


def _count_contradictions(place_m, depth, column, accepted, noise_m):
    """Return the number of accepted points closer to the wall than a plate allows."""
    arc, height = place_m.T
    # Beyond this distance along the arc, even the steepest plate has returned to the wall.
    reach = depth[column].max() / STEEPEST
    lowest, highest = place_m[column].min(axis=0), place_m[column].max(axis=0)
    neighbours = accepted & (arc > lowest[0] - reach) & (arc < highest[0] + reach)
    neighbours = np.flatnonzero(neighbours & (height >= lowest[1]) & (height <= highest[1]))
    if not len(neighbours):
        return 0
    # The slope of a plate concerns the distance along the arc: heights have little weight.
    scale = np.array([1.0, reach / COLUMN_LINK_M[1]])
    nearest = scipy.spatial.cKDTree(place_m[column] * scale).query(place_m[neighbours] * scale)[1]
    partner = column[nearest]
    # Least depth of the wall at a neighbour: the plate descends from the column at the steepest
    # slope.
    least_depth = (
        depth[partner] - STEEPEST * np.abs(arc[neighbours] - arc[partner]) - SIGMA * noise_m
    )
    return np.count_nonzero(depth[neighbours] < least_depth)
