"""Local frames of photos that no known position reaches, and their connection.

A frame that shares no place with the rest is aligned to partial knowledge by a similarity
transformation. Three coordinates of one point, a height of another, plumb lines, levelled
differences, azimuths or single elements of a photo are too few for a similarity by points, but
enough for a start. Damped least squares estimates the seven parameters from 24 starts, the
rotations of a cube. Undetermined parameters keep their start values.

Pieces from photographs alone: two by relative orientation, the others by resection.

Relative orientation requires only the common points of two photos. Let f1 and f2 be unit rays to
one point, the first photo at the origin, the second at b with rotation R. Rays and base lie in a
plane: f2' R [b]x f1 = 0. Five points give up to ten matrices E = R [b]x. Many samples of five are
tried, and the matrix with which most points agree is used, also for points on a plane.

Source: Stewenius, Engels & Nister 2006, Recent developments on direct relative orientation; Hartley
& Zisserman 2004, ch. 9 (decomposition).
"""

from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import combinations, combinations_with_replacement, permutations, product

import numpy as np
from scipy.sparse import csr_array

from tankcal.adjust import Damping, gauss_newton
from tankcal.geometry.rotations import apply_small_rotation
from tankcal.messages import message
from tankcal.survey.observations import HeightDifferences
from tankcal.survey.start.photographs import (
    ENOUGH,
    WORST_ERROR,
    add_points,
    bearings,
    grow_by_photos,
    resect,
)
from tankcal.survey.start.pieces import BAD_JOINT, Motion, certain_places, empty, grow_piece, joint

STEPS = 30  # of the alignment from one start
FAR = 5.0  # largest step of the logarithm of the scale


def join_local_frames(clues, piece, places, least):
    """Add local frames of the remaining photos to a Piece.

    Parameters
    ----------
    clues : Clues
    piece : Piece
    places : ndarray, shape (photos, 3)
        Given projection centres; nan: unknown.
    least : int
        Known points required in a photo.

    Returns
    -------
    piece : Piece
    reasons : list of str
        Sentences about frames that do not join.
    """
    original = piece
    if not np.isfinite(piece.xyz_m[:, 0]).any() or not np.isfinite(piece.xyz_m[:, 2]).any():
        piece = grow_piece(clues, piece, least, free=not piece.oriented.any())
    tried, loose, reasons = piece.oriented.copy(), [], []
    while not tried.all():
        local, why = blind_piece(clues.sights, ~tried, clues.points, clues.rng, clues.trial)
        if local is None:
            reasons.append(why)
            break
        piece, loose = _attach_frames(clues, piece, [*loose, local], least)
        tried |= local.oriented | piece.oriented
    if loose and not (
        piece.oriented.any()
        or (piece.known & ~np.isfinite(certain_places(clues.survey).piece.xyz_m).any(axis=1)).any()
    ):
        local = max(loose, key=lambda frame: frame.oriented.sum())
        # Without a place in common, align the largest frame to single known coordinates.
        motion = align_piece(clues.survey, local, piece.xyz_m, places)
        piece = grow_piece(clues, piece.fill_from(local.moved(motion)), least)
        piece, loose = _attach_frames(
            clues, piece, [frame for frame in loose if frame is not local], least
        )
    reasons += [_unjoined_sentence(clues.survey, local, piece) for local in loose]
    piece = _scale_about_photo(clues, piece, original, places)
    return grow_piece(clues, piece, least, free=not np.isfinite(piece.xyz_m[:, 0]).any()), reasons


def _attach_frames(clues, piece, loose, least):
    """Join all frames that share enough with the Piece or with each other; return it and the
    others."""
    loose = [_scale_by_distances(clues, frame) for frame in loose]
    while True:
        for local in loose:
            joined = _join(clues, local, piece)
            if joined is not None:
                piece = grow_piece(clues, joined, least)
                loose = [frame for frame in loose if frame is not local]
                break
        else:
            pairs = ((a, b, _join(clues, a, b)) for a, b in combinations(loose, 2))
            first, second, joined = next((frame for frame in pairs if frame[2]), (None,) * 3)
            if joined is None:
                return piece, loose
            joined = grow_by_photos(clues.sights, joined, clues.rng, least=least)
            rest = [frame for frame in loose if frame is not first and frame is not second]
            loose = [*rest, _scale_by_distances(clues, joined)]


def _join(clues, local, onto):
    """The Piece `onto` extended by another one, or None if too little is common."""
    motion = joint(local, onto, clues.rng)
    if motion is None or motion.misfit_m > BAD_JOINT * max(local.extent * motion.scale, 1e-9):
        return None
    return onto.fill_from(local.moved(motion))


def _scale_about_photo(clues, piece, original, places):
    """Scale a Piece about its only completely given photo.

    Relative orientation alone sets the base to 1. Single coordinates of other photos and of points
    determine the scale.

    Parameters
    ----------
    clues : Clues
    piece : Piece
    given : Piece
        Positions known at the start.
    places : ndarray, shape (photos, 3)
        See `join_local_frames`.
    """
    is_given, plan = original.oriented, clues.plan
    taped = piece.known[plan.start] & piece.known[plan.end] & ~plan.flat
    if is_given.sum() != 1 or original.known.any() or taped.any() or piece.oriented.sum() < 2:
        return piece
    bare = replace(
        piece,
        xyz_m=np.full_like(piece.xyz_m, np.nan),
        by_photos=np.ones_like(piece.by_photos),
    )
    bare, hinge = add_points(clues.sights, bare), original.place_m[is_given][0]
    targets = np.vstack(
        [original.xyz_m, np.where(np.isfinite(original.place_m), original.place_m, places)]
    )
    away, target_offsets = np.vstack([bare.xyz_m, bare.place_m]) - hinge, targets - hinge
    common = np.isfinite(away) & np.isfinite(target_offsets)
    square = float(np.sum(away[common] ** 2))
    # Least squares scale of the offsets from the given photo.
    scale = float(np.sum(away[common] * target_offsets[common])) / square if square > 0 else 0.0
    if not scale > 0:
        return piece
    return original.fill_from(bare.moved(Motion(np.eye(3), hinge * (1 - scale), scale, 0.0)))


def _scale_by_distances(clues, piece):
    """The Piece scaled by measured distances."""
    plan, known = clues.plan, piece.known
    use = known[plan.start] & known[plan.end] & ~plan.flat
    computed = np.linalg.norm(piece.xyz_m[plan.end[use]] - piece.xyz_m[plan.start[use]], axis=1)
    good = computed > 0
    if not good.any():
        return piece
    # The median ratio is robust against blunders.
    scale = float(np.median(plan.length[use][good] / computed[good]))
    return replace(piece, xyz_m=scale * piece.xyz_m, place_m=scale * piece.place_m)


def _unjoined_sentence(survey, local, piece):
    """Sentence about photos of a frame that does not join."""
    names = [survey.photos.names[i] for i in np.flatnonzero(local.oriented & ~piece.oriented)]
    common, some = int((local.known & piece.known).sum()), ", ".join(names[:10])
    if common > 3:
        why = message(
            "shared_do_not_fit",
            "but the {common} points that they share with the rest do not fit",
            common=common,
        )
        return message(
            "photos_apart", "photos {some} are connected to each other, {why}", some=some, why=why
        )
    return message(
        "photos_loose",
        "photos {some} are connected to each other, but share only {common} known points "
        "with the rest: 3 that do not lie on a line are needed, and more to choose between "
        "possible positions",
        some=some,
        common=common,
    )


def align_piece(survey, piece, known, place_m):
    """Fit a piece to known coordinates and observed verticals and azimuths.

    Parameters
    ----------
    survey : network.Survey
    piece : Piece
    known : ndarray, shape (points, 3)
        Known coordinates; nan: unknown.
    place_m : ndarray, shape (photos, 3)
        Projection centres; nan: unknown.

    Returns
    -------
    Motion
    """
    places = np.vstack([piece.xyz_m, piece.place_m])
    count = np.isfinite(places).sum(axis=0)
    middle = np.nansum(places, axis=0) / np.maximum(count, 1)
    clues = _FrameClues(survey, piece, known, place_m)
    at_rest = Motion(np.eye(3), np.zeros(3), 1.0, 0.0)
    if not len(clues.misfits(at_rest)):
        return at_rest
    best = None
    for rotation in _cube():
        motion = _fit_from(clues, rotation, clues.middle - rotation @ middle)
        # The margin keeps the first of equal solutions, whatever the rounding.
        if best is None or motion.misfit_m < best.misfit_m * (1 - 1e-6):
            best = motion
    return best


def _cube():
    """Yield the 24 rotations (3, 3) that map a cube onto itself, the identity first."""
    for order in permutations(range(3)):
        for signs in product((1.0, -1.0), repeat=3):
            rotation = np.eye(3)[list(order)] * np.array(signs)[:, None]
            if np.linalg.det(rotation) > 0:
                yield rotation


class _FrameClues:
    """Known data of the frame, as misfits in metres of a transformed piece."""

    def __init__(self, survey, piece, known_m, place_m):
        points = piece.known[:, None] & np.isfinite(known_m)
        photos = piece.oriented[:, None] & np.isfinite(place_m)
        self.places = np.vstack([piece.xyz_m, piece.place_m])
        self.known_m = np.vstack([known_m, place_m])
        self.size = max(piece.extent, 1e-9)
        self.which = np.nonzero(np.vstack([points, photos]))
        self.others = [item.taken(
        item.in_use & piece.known[item.start] & piece.known[item.end]
    ) for item in survey.observations
                       if item.knows_frame]  # fmt: skip
        target = np.where(np.vstack([points, photos]), self.known_m, np.nan)
        counts = np.isfinite(target).sum(axis=0)
        levelled = any(isinstance(item, HeightDifferences) and len(item) for item in self.others)
        self.metres = levelled or np.isfinite(target).any(axis=1).sum() > 1
        self.middle = np.where(counts, np.nansum(target, axis=0) / np.maximum(counts, 1), 0.0)

    def misfits(self, motion):
        """Misfits (n,) in metres of the transformed piece."""
        xyz = motion.of(self.places)
        parts = [(xyz - self.known_m)[self.which]]
        for item in self.others:
            parts += item.off_frame(xyz[item.end] - xyz[item.start])
        return np.concatenate(parts)


def _fit_from(clues, rotation, shift_m):
    """Fit a Motion by damped least squares from one start."""
    tiny, size = 1e-6, clues.size

    def step_at(motion, damping):
        misfits = clues.misfits(motion)
        # Seven parameters: numerical derivatives are accurate enough for a start value.
        jac = np.empty((len(misfits), 7))
        for k in range(7):
            moved = _move(motion, tiny * np.eye(7)[k], size)
            jac[:, k] = (clues.misfits(moved) - misfits) / tiny
        # Without a length, plumb lines would fit best at scale zero, so the scale is held.
        if not clues.metres:
            jac[:, 6] = 0.0
        normal = jac.T @ jac
        ridge = damping * np.eye(7) * max(float(normal.diagonal().max()), 1e-30)
        return -np.linalg.solve(normal + ridge, jac.T @ misfits)

    def square(motion):
        misfits = clues.misfits(motion)
        return misfits @ misfits

    motion = gauss_newton(
        step_at,
        Motion(rotation, shift_m, 1.0, 0.0),
        move=lambda motion, step: _move(motion, step, size),
        is_better=lambda candidate, motion: square(candidate) < square(motion),
        is_small=lambda step: np.abs(step).max() < 1e-10,
        most_steps=STEPS,
        damping=Damping(relax=10.0),
    )
    return replace(motion, misfit_m=float(np.sqrt(square(motion))))


def _move(motion, step, size):
    """Motion after a step (7,): rotation, shift over `size`, logarithm of the scale."""
    return Motion(
        apply_small_rotation(motion.rotation[None], step[None, :3])[0],
        motion.shift_m + size * step[3:6],
        motion.scale * np.exp(np.clip(step[6], -FAR, FAR)),
        motion.misfit_m,
    )


# ---- pieces from photographs alone

FIVES = 150  # samples of five points; nine in ten of them may contain a blunder
JUDGES = 200  # points used for comparison if there are more
TRIED = 30  # matrices examined, the best first
WORSE = 10.0  # ratio to the best error, above which a matrix is not refined
REFINING_STEPS = 10
SAME_RAD = 0.02  # difference below which two poses are equal
RIVAL = 3.0  # error ratio to the best pose, below which another pose is returned
FLOOR = 1e-5  # errors below are measuring noise, rad
IN_FRONT = 0.7  # share of points required in front of both cameras
COMMON = 7  # points shared by two photos
PAIRS = 12  # pairs tried
SHARE = 0.4  # share of the most common points below which a pair is not tried
WIDE_RAD = 0.7  # parallax beyond which a pair gains nothing
NARROW_RAD = 0.02  # parallax below which a pair determines no depth
HYPOTHESES = 6  # hypotheses decided by a third photo
BAD_PAIR = 0.01  # error, rad, above which two photos do not show the same points

_CUBES = list(combinations_with_replacement(range(3), 3))
_SQUARES = list(combinations_with_replacement(range(3), 2))
_MONOMIALS = (
    _CUBES + [(*square, 3) for square in _SQUARES] + [(0, 3, 3), (1, 3, 3), (2, 3, 3), (3, 3, 3)]
)
_PLACE = {monomial: place for place, monomial in enumerate(_MONOMIALS)}
_GATHER = np.zeros((64, 20))
for _i, _ijk in enumerate(np.ndindex(4, 4, 4)):
    _GATHER[_i, _PLACE[tuple(sorted(_ijk))]] = 1.0
_EVEN = np.zeros((3, 3, 3))
_EVEN[[0, 1, 2], [1, 2, 0], [2, 0, 1]] = 1.0
_EVEN[[0, 2, 1], [2, 1, 0], [1, 0, 2]] = -1.0


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
    judged = [
        (*_judge_by_third_photo(sights, piece, rng), pair, piece) for pair, piece in hypotheses
    ]
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


def _judge_by_third_photo(sights, piece, rng):
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


@dataclass(frozen=True)
class Pair:
    """Relative pose of two photos: rotation (3, 3) and position (3,), of length 1, of the second.

    Attributes
    ----------
    rotation : ndarray, shape (3, 3)
    base : ndarray, shape (3,)
    error : float
        Geometric mean of the angles between rays and epipolar planes, rad.
    parallax : float
        Median angle between two rays to a point, rad.
    """

    rotation: np.ndarray
    base: np.ndarray
    error: float
    parallax: float


def relative_poses(first, second, seed):
    """Relative poses of two photos, the best first.

    More than one pose is returned if several fit nearly equally well, as for points on a plane.
    Results are cached, because a survey that does not fit is adjusted repeatedly with other
    assumptions.

    Parameters
    ----------
    first, second : ndarray, shape (n, 2)
        Ideal image points over c, n at least 6.
    seed : int
        Of the samples.

    Returns
    -------
    list of Pair
    """
    first, second = (
        np.ascontiguousarray(ideal, dtype=float).tobytes() for ideal in (first, second)
    )
    return list(_cached_poses(first, second, seed))


@lru_cache(maxsize=256)
def _cached_poses(first, second, seed):
    """`relative_poses` of arrays as bytes, which a cache can use as a key."""
    first, second = (np.frombuffer(item).reshape(-1, 2) for item in (first, second))
    n, rng = len(first), np.random.default_rng(seed)
    judges = rng.choice(n, JUDGES, replace=False) if n > JUDGES else np.arange(n)
    f1, f2 = bearings(first[judges]), bearings(second[judges])
    fives = np.argsort(rng.random((FIVES, len(f1))), axis=1)[:, :5]
    matrices = essential_matrices(f1[fives], f2[fives])
    if not len(matrices):
        return []
    errors = _misfit(epipolar_errors(matrices, f1, f2))
    pairs, rough = [], []
    for best in np.argsort(errors)[:TRIED]:
        if pairs and errors[best] > WORSE * max(pairs[0].error, FLOOR):
            break
        pose = _decompose(matrices[best], f1, f2)
        if pose is None or any(_are_alike(pose, pose_before) for pose_before in rough):
            continue
        rough.append(pose)
        rotation, base, error = _refine(*pose, f1, f2)
        cosine = np.sum(f1 * (f2 @ rotation), axis=1)
        pair = Pair(rotation, base, error, float(np.median(np.arccos(np.clip(cosine, -1, 1)))))
        if not any(_are_alike((pair.rotation, pair.base), (o.rotation, o.base)) for o in pairs):
            pairs.append(pair)
    pairs.sort(key=lambda pair: pair.error)
    return [item for item in pairs if item.error <= RIVAL * max(pairs[0].error, FLOOR)]


def essential_matrices(f1, f2):
    """Essential matrices (k, 3, 3) with f2' E f1 = 0 from samples of five unit rays (t, 5, 3)."""
    rows = np.einsum("tni,tnj->tnij", f2, f1).reshape(-1, 5, 9)
    # Five equations leave a null space of dimension four for the nine elements of E.
    basis = np.linalg.svd(rows)[2][:, 5:].reshape(-1, 4, 3, 3)
    cubic = _constraints(basis)
    lead = cubic[:, :, :10]
    sound = np.abs(np.linalg.det(lead)) > 0
    basis, cubic = basis[sound], cubic[sound]
    # Eliminate the ten cubic monomials to obtain the action matrix of multiplication by x.
    reduced = np.linalg.solve(cubic[:, :, :10], cubic[:, :, 10:])
    action = np.zeros((len(basis), 10, 10))
    # x times a square is a cubic monomial, which the constraints reduce.
    for row in range(6):
        cube = _PLACE[tuple(sorted((0, *_SQUARES[row])))]
        action[:, row] = -reduced[:, cube]
    # x times x, y, z and 1 are quadratic or linear monomials themselves.
    for row, square in ((6, 0), (7, 1), (8, 2), (9, 6)):
        action[:, row, square] = 1.0
    sound = np.isfinite(action).all(axis=(1, 2))
    _, vectors = np.linalg.eig(action[sound])
    with np.errstate(divide="ignore", invalid="ignore"):
        xyz = vectors[:, 6:9] / vectors[:, 9:]
    # The eigenvectors hold the solutions; complex ones have no geometric meaning.
    real = np.isfinite(xyz).all(axis=1) & (np.abs(xyz.imag).max(axis=1) < 1e-6)
    which, number = np.nonzero(real)
    a = np.column_stack([xyz.real[which, :, number], np.ones(len(which))])
    matrices = np.einsum("ka,kaij->kij", a, basis[sound][which])
    return matrices / np.linalg.norm(matrices, axis=(1, 2), keepdims=True)


def _constraints(basis):
    """Ten cubic equations (t, 10, 20) in the multipliers of basis matrices (t, 4, 3, 3)."""
    product = np.einsum("aipq,ajrq->aijpr", basis, basis)
    trace = np.einsum("aijpp->aij", product)
    # 2 E E' E - trace(E E') E = 0 gives nine equations, det E = 0 the tenth.
    cubes = 2 * np.einsum("aijpr,akrs->aijkps", product, basis)
    cubes -= np.einsum("aij,akps->aijkps", trace, basis)
    rows = basis[:, :, 0], basis[:, :, 1], basis[:, :, 2]
    determinant = np.einsum("pqr,aip,ajq,akr->aijk", _EVEN, *rows, optimize=True)
    nine = cubes.reshape(-1, 64, 9)
    ten = np.concatenate([nine, determinant.reshape(-1, 64, 1)], axis=2)
    return np.einsum("aie,im->aem", ten, _GATHER)


def epipolar_errors(matrices, f1, f2):
    """Angles (k, n), rad, between rays (n, 3) and the epipolar planes of matrices (k, 3, 3)."""
    planes_2 = np.einsum("kij,nj->kni", matrices, f1)
    planes_1 = np.einsum("kij,ni->knj", matrices, f2)
    off = np.abs(np.einsum("kni,ni->kn", planes_2, f2))
    # Sampson distance: the misfit over its gradient in both images.
    square = np.sum(planes_2**2, axis=-1) + np.sum(planes_1**2, axis=-1)
    return off / np.sqrt(np.maximum(square, 1e-30))


def _misfit(errors):
    """Geometric mean (k,) of the errors (k, n) without the five smallest, which fit by
    construction.

    A blunder has the same effect wherever the true ray lies. With few points, a wrong pose that
    fits many of them by chance does not replace a pose that fits all within noise.
    """
    others = np.partition(errors, 4, axis=1)[:, 5:]
    return np.exp(np.mean(np.log(others**2 + FLOOR**2), axis=1) / 2)


def _decompose(matrix, f1, f2):
    """Rotation and base of a matrix, or None if most points lie behind the cameras."""
    u, _, v = np.linalg.svd(matrix.T)
    w = np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]])
    best, most = None, IN_FRONT
    # E allows two rotations and two signs of the base; points in front of both cameras decide.
    for middle in (w, w.T):
        rotation = (u @ middle @ v).T
        rotation = rotation * np.sign(np.linalg.det(rotation))
        for base in (u[:, 2], -u[:, 2]):
            share = float(np.mean(_is_in_front(rotation, base, f1, f2)))
            if share > most:
                best, most = (rotation, base), share
    return best


def _is_in_front(rotation, base, f1, f2):
    """Mask (n,) of points where both rays intersect in front of the cameras."""
    second_rays = f2 @ rotation
    cosine = np.sum(f1 * second_rays, axis=1)
    a, b = f1 @ base, second_rays @ base
    return (a - cosine * b > 0) & (cosine * a - b > 0)


def _refine(rotation, base, f1, f2):
    """Refine rotation and base by Gauss-Newton with Cauchy weights; return them and the error."""

    def step_at(pose, _):
        off, a = _linearise(*pose[:2], f1, f2)
        scale = max(float(np.median(np.abs(off))), 1e-9)
        root = 1 / np.sqrt(1 + (off / (3 * scale)) ** 2)
        return np.linalg.lstsq(a * root[:, None], -off * root, rcond=None)[0]

    def move(pose, step):
        rotation, base, _ = pose
        rotation = apply_small_rotation(rotation[None], step[None, :3])[0]
        base = base + step[3:] @ _unit_vectors_across(base)
        base = base / np.linalg.norm(base)
        # E = R [b]x, with [b]x from the products of the axes and the base.
        essential = rotation @ -np.cross(np.eye(3), base)
        return rotation, base, float(_misfit(epipolar_errors(essential[None], f1, f2))[0])

    return gauss_newton(
        step_at,
        (rotation, base, np.inf),
        move=move,
        is_better=lambda candidate, pose: candidate[2] < pose[2],
        is_small=lambda step: np.abs(step).max() < 1e-9,
        most_steps=REFINING_STEPS,
    )


def _unit_vectors_across(base):
    """Two unit vectors (2, 3) across a base of length 1, in which a step moves the base."""
    return np.linalg.svd(base[None])[2][1:]


def _linearise(rotation, base, f1, f2):
    """Sines (n,) between rays and epipolar planes, and derivatives (n, 5) by rotation and base."""
    second_rays = f2 @ rotation
    plane = np.cross(base, f1)
    length = np.maximum(np.linalg.norm(plane, axis=1), 1e-9)
    a = np.empty((len(f1), 5))
    a[:, :3] = -np.cross(f2, plane @ rotation.T)  # d (R'f2).p for R <- exp([d]x) R
    a[:, 3:] = np.stack(
        [
            np.sum(np.cross(direction, f1) * second_rays, axis=1)
            for direction in _unit_vectors_across(base)
        ],
        axis=1,
    )
    return np.sum(plane * second_rays, axis=1) / length, a / length[:, None]


def _are_alike(first, second):
    """Whether two poses (rotation, base) are equal within SAME_RAD."""
    cosine = (np.trace(first[0] @ second[0].T) - 1) / 2
    return np.arccos(np.clip(cosine, -1, 1)) < SAME_RAD and first[1] @ second[1] > np.cos(
        2 * SAME_RAD
    )
