"""Connected groups of points on a wall (patches), the candidates for buckles, seams and columns."""

import numpy as np
import scipy
from scipy.sparse import csr_array


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
