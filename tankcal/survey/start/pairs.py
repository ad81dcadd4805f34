"""A piece from photographs alone: two of them by relative orientation, the others one by one."""

from dataclasses import replace

import numpy as np
from scipy.sparse import csr_array

from tankcal.survey.start.photographs import ENOUGH, WORST_ERROR, add_points, grow_by_photos
from tankcal.survey.start.pieces import empty
from tankcal.survey.start.relative import relative_poses
from tankcal.survey.start.resection import resect

COMMON = 7  # points that two photos must share
PAIRS = 12  # pairs that are tried
SHARE = 0.4  # pairs with fewer than this share of the most common points are not
WIDE_RAD = 0.7  # parallax beyond which more is no better
NARROW_RAD = 0.02  # parallax below which a pair gives no depth
HYPOTHESES = 6  # that a third photo decides between
BAD_PAIR = 0.01  # error, rad, beyond which two photos are not taken of the same points
RIVAL = 2.0  # misfit of the third photo below which another pose of the pair is as good


def blind_piece(sights, waiting, points, rng, seed=0):
    """A Piece in a frame of its own from photos that wait, with all that follows from them.

    waiting  (photos,) True for those of which one at least must start it
    points   number of points
    seed     of the samples from which two photos are set up

    Returns the Piece, or None, and a sentence that says why not.
    """
    hypotheses = _hypotheses(sights, waiting, points, seed)
    if not hypotheses:
        return None, f"no two of these photos share {COMMON} points seen from different places"
    judged = [(*_judged(sights, piece, rng), pair, piece) for pair, piece in hypotheses]
    judged.sort(key=lambda one: (-one[0], one[1]))
    third, misfit, pair, piece = judged[0]
    if not third:
        alike = [one for one in judged if one[2] == pair]
        if len(alike) > 1:
            return None, (
                "the points that two photos share lie on a plane, which two positions of the "
                "second photo explain equally: a third photo or a point off the plane is needed"
            )
    elif misfit > WORST_ERROR:
        return None, "no third photo fits to any two of these photos"
    return grow_by_photos(sights, piece, rng, least=ENOUGH), ""


def _hypotheses(sights, waiting, points, seed):
    """Pairs of photos with Pieces of their two photos and common points, the most hopeful first."""
    found = []
    for first, second in _pairs(sights, waiting, points):
        _, i, j = np.intersect1d(sights[first].point, sights[second].point, return_indices=True)
        poses = relative_poses(sights[first].ideal[i], sights[second].ideal[j], seed)
        for pose in poses:
            if pose.error > BAD_PAIR or pose.parallax < NARROW_RAD:
                continue
            hope = len(i) * min(pose.parallax, WIDE_RAD)
            found.append((hope, (first, second), pose))
    found.sort(key=lambda one: -one[0])
    return [(pair, _of_two(sights, pair, pose, points)) for _, pair, pose in found[:HYPOTHESES]]


def _pairs(sights, waiting, points):
    """Pairs with a waiting photo that share many points, spread over how many they share."""
    lengths = [len(sight.point) for sight in sights]
    rows = np.repeat(np.arange(len(sights)), lengths)
    columns = np.concatenate([sight.point for sight in sights])
    seen = csr_array((np.ones(len(rows)), (rows, columns)), shape=(len(sights), points))
    seen.sum_duplicates()
    seen.data[:] = 1.0
    common = np.triu((seen @ seen.T).toarray(), 1) * (waiting[:, None] | waiting[None])
    a, b = np.nonzero(common >= max(COMMON, SHARE * common.max(initial=0.0)))
    order = np.argsort(-common[a, b], kind="stable")
    few = order[np.unique(np.linspace(0, len(order) - 1, min(len(order), PAIRS)).astype(int))]
    return [(int(a[i]), int(b[i])) for i in few]


def _of_two(sights, pair, pose, points):
    """The Piece of two photos, the first at the origin, a base of length one apart."""
    piece = empty(points, len(sights))
    place, rotation = piece.place_m.copy(), piece.rotation.copy()
    place[list(pair)] = [np.zeros(3), pose.base]
    rotation[list(pair)] = [np.eye(3), pose.rotation]
    return add_points(sights, replace(piece, place_m=place, rotation=rotation))


def _judged(sights, piece, rng):
    """Whether a third photo sees enough of a Piece, and how well it fits (smaller is better)."""
    known, best = piece.known, (False, np.inf)
    counts = [0 if done else known[sight.point].sum()
              for sight, done in zip(sights, piece.oriented, strict=True)]  # fmt: skip
    for photo in np.argsort(counts)[::-1][:2]:
        if counts[photo] <= ENOUGH:
            continue
        sight = sights[photo]
        seen = known[sight.point]
        pose = resect(piece.xyz_m[sight.point[seen]], sight.ideal[seen], rng)
        error = np.inf if pose is None else pose.error
        best = (True, min(best[1], error))
    return best
