"""A piece from photographs alone: two by relative orientation, the others by resection."""

from dataclasses import replace

import numpy as np
from scipy.sparse import csr_array

from tankcal.survey.start.photographs import ENOUGH, WORST_ERROR, add_points, grow_by_photos
from tankcal.survey.start.pieces import empty
from tankcal.survey.start.relative import relative_poses
from tankcal.survey.start.resection import resect

COMMON = 7  # points shared by two photos
PAIRS = 12  # pairs tried
SHARE = 0.4  # share of the most common points below which a pair is not tried
WIDE_RAD = 0.7  # parallax beyond which a pair gains nothing
NARROW_RAD = 0.02  # parallax below which a pair determines no depth
HYPOTHESES = 6  # hypotheses decided by a third photo
BAD_PAIR = 0.01  # error, rad, above which two photos do not show the same points
RIVAL = 2.0  # misfit ratio of the third photo below which another pose is equivalent


def blind_piece(sights, waiting, points, rng, seed=0):
    """Build a Piece in its own frame from photos without known positions.

    Parameters
    ----------
    sights : sequence of Sight
    waiting : ndarray of bool, shape (photos,)
        Photos of which at least one must be in the first pair.
    points : int
        Number of points.
    rng : numpy.random.Generator
    seed : int
        Of the samples for relative orientation.

    Returns
    -------
    piece : Piece or None
    reason : str
        Reason for None.
    """
    hypotheses = _hypotheses(sights, waiting, points, seed)
    if not hypotheses:
        return None, f"no two of these photos share {COMMON} points seen from different places"
    judged = [(*_judged(sights, piece, rng), pair, piece) for pair, piece in hypotheses]
    judged.sort(key=lambda candidate: (-candidate[0], candidate[1]))
    third, misfit, pair, piece = judged[0]
    if not third:
        # Without a third photo, two poses of the same pair cannot be separated.
        alike = [candidate for candidate in judged if candidate[2] == pair]
        if len(alike) > 1:
            return None, (
                "the points that two photos share lie on a plane, which two positions of the "
                "second photo explain equally: a third photo or a point off the plane is needed"
            )
    elif misfit > WORST_ERROR:
        return None, "no third photo fits to any two of these photos"
    return grow_by_photos(sights, piece, rng, least=ENOUGH), ""


def _hypotheses(sights, waiting, points, seed):
    """Pairs of photos with a Piece of each, the most promising first."""
    hypotheses = []
    for first, second in _pairs(sights, waiting, points):
        _, i, j = np.intersect1d(sights[first].point, sights[second].point, return_indices=True)
        poses = relative_poses(sights[first].ideal[i], sights[second].ideal[j], seed)
        for pose in poses:
            if pose.error > BAD_PAIR or pose.parallax < NARROW_RAD:
                continue
            # Many points and a wide parallax make a pair reliable.
            hope = len(i) * min(pose.parallax, WIDE_RAD)
            hypotheses.append((hope, (first, second), pose))
    hypotheses.sort(key=lambda hypothesis: -hypothesis[0])
    return [
        (pair, _piece_of_pair(sights, pair, pose, points))
        for _, pair, pose in hypotheses[:HYPOTHESES]
    ]


def _pairs(sights, waiting, points):
    """Pairs with a waiting photo that share many points, spread over the numbers of shared
    points."""
    lengths = [len(sight.point) for sight in sights]
    rows = np.repeat(np.arange(len(sights)), lengths)
    columns = np.concatenate([sight.point for sight in sights])
    incidence = csr_array((np.ones(len(rows)), (rows, columns)), shape=(len(sights), points))
    incidence.sum_duplicates()
    incidence.data[:] = 1.0
    # Product of the incidence matrices: number of points shared by each two photos.
    common = np.triu((incidence @ incidence.T).toarray(), 1) * (waiting[:, None] | waiting[None])
    a, b = np.nonzero(common >= max(COMMON, SHARE * common.max(initial=0.0)))
    order = np.argsort(-common[a, b], kind="stable")
    few = order[np.unique(np.linspace(0, len(order) - 1, min(len(order), PAIRS)).astype(int))]
    return [(int(a[i]), int(b[i])) for i in few]


def _piece_of_pair(sights, pair, pose, points):
    """The Piece of two photos with a base of length 1, the first at the origin."""
    piece = empty(points, len(sights))
    place, rotation = piece.place_m.copy(), piece.rotation.copy()
    place[list(pair)] = [np.zeros(3), pose.base]
    rotation[list(pair)] = [np.eye(3), pose.rotation]
    return add_points(sights, replace(piece, place_m=place, rotation=rotation))


def _judged(sights, piece, rng):
    """Whether a third photo shows enough points of a Piece, and its misfit (smaller is better)."""
    known, best = piece.known, (False, np.inf)
    counts = [0 if is_oriented else known[sight.point].sum()
              for sight, is_oriented in zip(sights, piece.oriented, strict=True)]  # fmt: skip
    for photo in np.argsort(counts)[::-1][:2]:
        if counts[photo] <= ENOUGH:
            continue
        sight = sights[photo]
        is_known = known[sight.point]
        pose = resect(piece.xyz_m[sight.point[is_known]], sight.ideal[is_known], rng)
        error = np.inf if pose is None else pose.error
        best = (True, min(best[1], error))
    return best
