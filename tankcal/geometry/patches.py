"""Points of a wall that hang together: patches, of which buckles, seams and columns are told."""

import numpy as np
import scipy
from scipy.sparse import csr_array


def find_patches(place_m, members, link_m, fewest):
    """Some of the points, parted into patches that hang together.

    Parameters
    ----------
    place_m : ndarray, shape (n, 2)
        Along the arc and upwards, m.
    members : ndarray of int, shape (k,)
        The points that are looked at.
    link_m : float or tuple of (float, float)
        Distance between points of one patch, at most, m; two: along the arc, and upwards.
    fewest : int
        Points of a patch.

    Returns
    -------
    list of ndarray of int
        Members of each patch.

    Examples
    --------
    >>> place = np.array([[0.0, 0.0], [0.1, 2.0], [3.0, 0.0], [3.0, 0.5]])
    >>> [one.tolist() for one in find_patches(place, np.arange(4), (0.2, 4.0), 2)]
    [[0, 1], [2, 3]]
    >>> [one.tolist() for one in find_patches(place, np.arange(4), 1.0, 2)]
    [[2, 3]]
    """
    if len(members) < fewest:
        return []
    from scipy.sparse.csgraph import connected_components

    norm = np.inf if np.ndim(link_m) else 2.0
    tree = scipy.spatial.cKDTree(place_m[members] / link_m)
    pairs = tree.query_pairs(1.0, p=norm, output_type="ndarray")
    links = csr_array((np.ones(len(pairs)), pairs.T), shape=(len(members),) * 2)
    count, label = connected_components(links, directed=False)
    patches = [members[label == one] for one in range(count)]
    return [one for one in patches if len(one) >= fewest]
