"""Pieces of a survey in one frame each, their growth and connection.

    X_onto = scale R X + shift

Three points, or one photo and a further place, determine the transformation. Many triples are
tried; the transformation with which most places agree is used. Source: Umeyama 1991 (similarity of
point sets); Fischler & Bolles 1981.

Growth of a piece of a survey by all observations: photos, angles, tapes, levels.

Heights from levelling and slopes, by least absolute deviations.

Slopes become height differences with the horizontal length of their line. Iteratively reweighted
least squares minimizes the sum of absolute misfits (Schlossmacher 1973), so that a blunder is
outvoted where a height is controlled.
"""

from dataclasses import dataclass, field, replace
from itertools import combinations

import numpy as np
from scipy.sparse import coo_array, csr_array, diags_array
from scipy.sparse.csgraph import connected_components
from scipy.sparse.linalg import spsolve

from tankcal.geometry.rotations import rotation_of_angles
from tankcal.survey.observations import (
    ControlCoordinates,
    HeightDifferences,
    PhotoOrientation,
    PhotoRotation,
    Vectors,
)
from tankcal.survey.start.photographs import Wall, grow_by_photos, wall_of
from tankcal.survey.start.plan_frames import find_plan_positions, lay_out_networks
from tankcal.survey.start.polar import Plan, improve_plan_positions, look_up
from tankcal.survey.start.single_points import misfit_of_places, position_single_points

TRIPLES = 200  # samples of three common places
BAD_JOINT = 0.05  # relative misfit above which a joint is rejected
FLAT = 0.02  # height over length below which three places lie on a line


@dataclass(frozen=True)
class Piece:
    """Known positions in one frame; nan: unknown.

    Attributes
    ----------
    xyz_m : ndarray, shape (points, 3)
    by_photos : ndarray of bool, shape (points,)
        True: photos may improve the point.
    place_m : ndarray, shape (photos, 3)
    rotation : ndarray, shape (photos, 3, 3)
    """

    xyz_m: np.ndarray
    by_photos: np.ndarray
    place_m: np.ndarray
    rotation: np.ndarray

    @property
    def known(self):
        """Mask (points,), True where all three coordinates are known."""
        return np.isfinite(self.xyz_m).all(axis=1)

    @property
    def oriented(self):
        """Mask (photos,), True where position and rotation are known."""
        return np.isfinite(self.place_m).all(axis=1) & np.isfinite(self.rotation).all(axis=(1, 2))

    @property
    def extent(self):
        """Diagonal of the box around all known positions, m."""
        places = np.vstack([self.xyz_m[self.known], self.place_m[self.oriented]])
        return float(np.linalg.norm(np.ptp(places, axis=0))) if len(places) else 0.0

    def moved(self, motion):
        """Apply a Motion."""
        return replace(
            self,
            xyz_m=motion.of(self.xyz_m),
            place_m=motion.of(self.place_m),
            rotation=self.rotation @ motion.rotation.T,
        )

    def fill_from(self, other):
        """Add positions known only in another Piece of the same frame."""
        photos = self.oriented
        return replace(
            self,
            xyz_m=np.where(np.isfinite(self.xyz_m), self.xyz_m, other.xyz_m),
            by_photos=np.where(self.known, self.by_photos, other.by_photos),
            place_m=np.where(photos[:, None], self.place_m, other.place_m),
            rotation=np.where(photos[:, None, None], self.rotation, other.rotation),
        )


@dataclass(frozen=True)
class Motion:
    """X_onto = scale rotation X + shift_m; `misfit_m` is met by most of the common places."""

    rotation: np.ndarray
    shift_m: np.ndarray
    scale: float
    misfit_m: float

    def of(self, xyz_m):
        """Places (n, 3) after the motion."""
        return self.scale * xyz_m @ self.rotation.T + self.shift_m


def empty(points, photos):
    """A Piece without known positions."""
    return Piece(
        np.full((points, 3), np.nan),
        np.ones(points, dtype=bool),
        np.full((photos, 3), np.nan),
        np.full((photos, 3, 3), np.nan),
    )


def joint(piece, onto, rng):
    """Estimate the Motion that brings a piece onto another, from common points and photos.

    Parameters
    ----------
    piece, onto : Piece
    rng : numpy.random.Generator

    Returns
    -------
    Motion or None
        None: too little is common.
    """
    points, photos = piece.known & onto.known, piece.oriented & onto.oriented
    here = np.vstack([piece.xyz_m[points], piece.place_m[photos]])
    there = np.vstack([onto.xyz_m[points], onto.place_m[photos]])
    motions = _motions_of_triples(here, there, rng)
    turns = onto.rotation[photos].transpose(0, 2, 1) @ piece.rotation[photos]
    # A common photo gives the rotation; scale and shift follow from the other places.
    centres, targets = piece.place_m[photos], onto.place_m[photos]
    motions += [
        _motion_with_rotation(turn, here, there, centre, target)
        for turn, centre, target in zip(turns, centres, targets, strict=True)
    ]
    motions = [motion for motion in motions if motion is not None]
    if not motions:
        return None
    best = min(motions, key=lambda motion: motion.misfit_m)
    return _polish(best, here, there)


def similarity(here, there, weight=None):
    """(Weighted) least squares similarity between two sets of places (n, 3), not on a line.

    Parameters
    ----------
    here, there : ndarray, shape (n, 3)
    weight : ndarray, shape (n,), optional

    Returns
    -------
    Motion
    """
    w = np.ones(len(here)) if weight is None else weight
    w = w / w.sum()
    a, b = w @ here, w @ there
    p, q = here - a, there - b
    u, singular, v = np.linalg.svd((q * w[:, None]).T @ p)
    # The sign of the last singular direction excludes reflections (Umeyama 1991).
    side = np.array([1.0, 1.0, np.sign(np.linalg.det(u @ v))])
    rotation = (u * side) @ v
    scale = float(singular @ side / np.sum(w[:, None] * p * p))
    return _motion_with_misfit(rotation, b - scale * rotation @ a, scale, here, there)


def _motion_with_misfit(rotation, shift, scale, here, there):
    """The Motion with its misfit: the distance met by just over half of the places."""
    off = np.linalg.norm(scale * here @ rotation.T + shift - there, axis=1)
    place = min(len(off) - 1, len(off) // 2 + 1)
    return Motion(rotation, shift, scale, float(np.partition(off, place)[place]))


def _motions_of_triples(here, there, rng):
    """Motions from triples of common places."""
    n = len(here)
    if n < 3:
        return []
    triples = rng.integers(0, n, (TRIPLES, 3)) if n > 5 else np.array(
        [(i, j, k) for i in range(n) for j in range(i + 1, n) for k in range(j + 1, n)]
    )  # fmt: skip
    motions = []
    for triple in triples:
        sides = here[triple[1:]] - here[triple[0]]
        extent = max(np.sum(sides**2, axis=1).max(), np.sum((sides[1] - sides[0]) ** 2))
        # A triple on a line leaves the rotation about it undetermined.
        if np.linalg.norm(np.cross(*sides)) > FLAT * extent:
            motion = similarity(here[triple], there[triple])
            motions.append(
                _motion_with_misfit(motion.rotation, motion.shift_m, motion.scale, here, there)
            )
    return motions


def _motion_with_rotation(turn, here, there, centre, onto):
    """The Motion with a known rotation that maps one place onto another; other places give the
    scale."""
    before = np.linalg.norm(here - centre, axis=1)
    after = np.linalg.norm(there - onto, axis=1)
    # Places at the centre give no ratio of distances.
    apart = before > 1e-6 * max(before.max(initial=0.0), 1e-30)
    scale = float(np.median(after[apart] / before[apart])) if apart.any() else 1.0
    if not scale > 0:
        return None
    return _motion_with_misfit(turn, onto - scale * turn @ centre, scale, here, there)


def _polish(motion, here, there):
    """Refit a Motion to all places with Cauchy weights beyond its misfit."""
    if len(here) < 3:
        return motion
    for _ in range(5):
        off = np.linalg.norm(motion.of(here) - there, axis=1)
        # Cauchy weights: places beyond the misfit lose influence.
        weight = 1 / (1 + (off / max(2 * motion.misfit_m, 1e-12)) ** 2)
        spread = np.linalg.svd((here - np.average(here, axis=0, weights=weight))
                               * np.sqrt(weight)[:, None], compute_uv=False)  # fmt: skip
        if spread[1] < FLAT * spread[0]:
            return motion
        refined = similarity(here, there, weight)
        if not refined.misfit_m < motion.misfit_m * (1 - 1e-6):
            break
        motion = refined
    return motion


# ---- positions known before the computation: certain, or approximate


@dataclass(frozen=True)
class KnownPositions:
    """Known positions as a Piece; each coordinate of a point may be known separately."""

    piece: Piece

    @property
    def nothing(self):
        """True if no coordinate and no photo is known."""
        return not (np.isfinite(self.piece.xyz_m).any() or self.piece.oriented.any())

    def without(self, reference):
        """Omit points and photos known in another Known."""
        piece, is_known = self.piece, np.isfinite(reference.piece.xyz_m).any(axis=1)
        photos = reference.piece.oriented
        return KnownPositions(
            replace(
                piece,
                xyz_m=np.where(is_known[:, None], np.nan, piece.xyz_m),
                by_photos=piece.by_photos | is_known,
                place_m=np.where(photos[:, None], np.nan, piece.place_m),
                rotation=np.where(photos[:, None, None], np.nan, piece.rotation),
            )
        )

    def shifted(self, shift_m):
        """Shift the frame."""
        piece = self.piece
        xyz_m, place_m = piece.xyz_m + shift_m, piece.place_m + shift_m
        return KnownPositions(replace(piece, xyz_m=xyz_m, place_m=place_m))


def certain_places(survey):
    """Known positions that are fixed or observed, of points with measurements."""
    xyz = np.full((len(survey.points), 3), np.nan)
    if survey.fixed is not None:
        xyz = np.where(survey.fixed & _measured_points(survey)[:, None], survey.xyz_m, xyz)
    for item in survey.observations:
        if isinstance(item, ControlCoordinates):
            accepted = item.in_use
            xyz[item.point[accepted], item.axis[accepted]] = item.value[accepted]
    photos = survey.photos
    if photos is None:
        return KnownPositions(_piece(xyz, np.zeros((0, 3)), np.zeros((0, 3, 3))))
    place, angles, rotation = _photos_observed(survey)
    if photos.fixed is not None:
        place = np.where(photos.fixed[:, :3], photos.xyz_m, place)
        rotation = np.where(photos.fixed[:, 3, None, None], photos.rotation, rotation)
    has_angles = np.isfinite(angles).all(axis=1) & np.isnan(rotation).any(axis=(1, 2))
    if has_angles.any():
        rotation[has_angles] = rotation_of_angles(*angles[has_angles].T)
    return KnownPositions(_piece(xyz, place, rotation))


def _photos_observed(survey):
    """Observed positions (n, 3), angles (n, 3) and rotations (n, 3, 3) of photos."""
    n = len(survey.photos.names)
    six, rotation = np.full((n, 6), np.nan), np.full((n, 3, 3), np.nan)
    for item in survey.observations:
        if isinstance(item, PhotoOrientation):
            six[item.photo, item.element] = item.value
        elif isinstance(item, PhotoRotation):
            rotation[item.photo] = item.rotation
    return six[:, :3], six[:, 3:], rotation


def hinted_places(survey):
    """All given start values, whatever their quality, of points with measurements."""
    photos, xyz = survey.photos, np.where(_measured_points(survey)[:, None], survey.xyz_m, np.nan)
    if photos is None:
        return KnownPositions(_piece(xyz, np.zeros((0, 3)), np.zeros((0, 3, 3))))
    return KnownPositions(_piece(xyz, photos.xyz_m, photos.rotation))


def _measured_points(survey):
    """Mask (points,) of points in an image or an observation."""
    mask = np.zeros(len(survey.points), dtype=bool)
    if survey.image_points is not None:
        mask[survey.image_points.point] = True
    for item in survey.observations:
        for name in item.ties:
            mask[getattr(item, name)] = True
    return mask


def _piece(xyz_m, place_m, rotation):
    """A Piece of known coordinates, projection centres and rotations."""
    by_photos = ~np.isfinite(xyz_m).any(axis=1)
    return Piece(
        np.array(xyz_m, dtype=float),
        by_photos,
        np.array(place_m, dtype=float),
        np.array(rotation, dtype=float),
    )


AS_WELL = 1e-6  # share of the extent: misfits closer than this are equal
ROUNDS = 25
NOISE_M = 1e-4  # misfits below this count as equal


@dataclass(frozen=True)
class Clues:
    """Observations in the form required by the search for start values.

    Attributes
    ----------
    survey : network.Survey
    sights : tuple of Sight
    plan : Plan
    wall : Wall or None
    rng : numpy.random.Generator
    trial : int
        Number of the attempt; each draws other samples.
    sought : dict
        Results for single points, see `single_points`.
    """

    survey: object
    sights: tuple
    plan: Plan
    wall: Wall
    rng: np.random.Generator
    trial: int = 0
    sought: dict = field(default_factory=dict, repr=False)

    @property
    def points(self):
        return len(self.survey.points)

    @property
    def silent(self):
        """True if only photos (and coordinates) were observed."""
        return not any(item.places_points for item in self.survey.observations)


def grow_piece(clues, piece, least, free=False):
    """Grow a piece by photos and by set-ups in turn until nothing is added.

    Parameters
    ----------
    clues : Clues
    piece : Piece
    least : int
        Known points required in a photo.
    free : bool
        Whether plan and heights without known values may start in a frame of their own.

    Returns
    -------
    Piece
    """
    while True:
        before = np.isfinite(piece.xyz_m).sum() + piece.oriented.sum()
        piece = _add_by_vectors(clues, piece, free)
        piece = _add_by_tapes(clues, _add_by_survey(clues, piece, free), free)
        wall = clues.wall or wall_of(piece.xyz_m)
        piece = grow_by_photos(clues.sights, piece, clues.rng, wall, least)
        if np.isfinite(piece.xyz_m).sum() + piece.oriented.sum() == before:
            # Mixed observations are slow to solve, so they come last.
            piece = _add_by_mixtures(clues, piece)
        if np.isfinite(piece.xyz_m).sum() + piece.oriented.sum() == before:
            return piece


def _add_by_vectors(clues, piece, free):
    """Add points tied to the Piece by vectors."""
    groups = [item for item in clues.survey.observations if isinstance(item, Vectors) and len(item)]
    if not groups:
        return piece
    start, end, value = (
        np.concatenate([getattr(item, name)[item.in_use] for item in groups])
        for name in ("start", "end", "value")
    )
    xyz = piece.xyz_m.copy()
    if free and len(start) and not np.isfinite(xyz).any():
        xyz[start[0]] = 0.0
    while True:
        before = np.isfinite(xyz).sum()
        for sign, base, target in ((1.0, start, end), (-1.0, end, start)):
            ahead = np.isfinite(xyz[base]) & np.isnan(xyz[target])
            row, axis = np.nonzero(ahead)
            xyz[target[row], axis] = xyz[base[row], axis] + sign * value[row, axis]
        if np.isfinite(xyz).sum() == before:
            break
    new = np.isfinite(xyz).all(axis=1) & ~piece.known
    return replace(piece, xyz_m=xyz, by_photos=piece.by_photos & ~new)


def _add_by_mixtures(clues, piece):
    """Add points determined only by a mixture of readings to known points."""
    if clues.silent or not np.isfinite(piece.xyz_m).any():
        return piece
    xyz = position_single_points(clues.survey, clues.plan, piece.xyz_m, clues.sought)
    new = np.isfinite(xyz).all(axis=1) & ~piece.known
    return replace(piece, xyz_m=xyz, by_photos=piece.by_photos & ~new)


def _add_by_survey(clues, piece, free):
    """Add points from angles, distances and levels."""
    if clues.silent:
        return piece
    xyz = _place_by_readings(clues, piece.xyz_m, free)
    new = np.isfinite(xyz) & ~np.isfinite(piece.xyz_m)
    if not new.any():
        return piece
    # Compute the new positions again from all their sights, so that blunders are outvoted.
    if np.isfinite(xyz[:, 2]).any():
        xy = improve_plan_positions(clues.plan, xyz[:, :2], xyz[:, 2], ~new[:, 0])
        first = np.where(new[:, 2], np.nan, xyz[:, 2])
        if not np.isfinite(first).any():
            # Heights without a known value start from one of the computed heights.
            first[np.flatnonzero(new[:, 2])[0]] = xyz[np.flatnonzero(new[:, 2])[0], 2]
        better = add_heights(clues.survey, clues.plan, np.column_stack([xy, first]), False)
        xyz = np.where(np.isfinite(better), better, xyz)
    return replace(piece, xyz_m=xyz, by_photos=piece.by_photos & ~new.any(axis=1))


def _place_by_readings(clues, xyz, free):
    """Coordinates (points, 3) after alternating between plan and heights."""
    # Slope distances need heights, and heights by slopes need distances.
    for _ in range(3):
        before = np.isfinite(xyz).sum()
        if free or np.isfinite(xyz[:, 0]).any():
            xy, _ = find_plan_positions(clues.plan, xyz[:, :2], xyz[:, 2], clues.rng)
            xyz = np.column_stack([xy, xyz[:, 2]])
        xyz = add_heights(clues.survey, clues.plan, xyz, free)
        if np.isfinite(xyz).sum() == before:
            break
    return xyz


def _add_by_tapes(clues, piece, free):
    """Add points tied to the Piece by spatial distances alone."""
    plan, known = clues.plan, piece.known
    straight = ~plan.flat & (plan.rise == 0) & ~(known[plan.start] & known[plan.end])
    if not straight.any() or not (free or known.any()) or len(plan.station):
        return piece
    start, end, length = plan.start[straight], plan.end[straight], plan.length[straight]
    firm = np.unique(np.concatenate([start, end]))
    firm = firm[known[firm]]
    sides = np.array(list(combinations(firm, 2)), dtype=int).reshape(-1, 2)
    # Distances between known points stiffen the network.
    between = np.linalg.norm(piece.xyz_m[sides[:, 0]] - piece.xyz_m[sides[:, 1]], axis=1)
    ties = np.concatenate([start, sides[:, 0]]), np.concatenate([end, sides[:, 1]])
    for points, places in lay_out_networks(*ties, np.concatenate([length, between]), 3, clues.rng):
        # Distances do not determine the handedness, so both mirror images are tried.
        either = [_piece_of(clues, points, places * mirror) for mirror in ([1, 1, 1], [1, 1, -1])]
        if free and not known.any():
            return piece.fill_from(either[0])
        joined = _join_mirror_image(clues, piece, either)
        if joined is not None:
            return joined
    return piece


def _join_mirror_image(clues, piece, either):
    """Join the mirror image that agrees with the readings; None if neither or both do.

    Known points in one plane leave the side of the other points undetermined.
    """
    motions = [joint(image, piece, clues.rng) for image in either]
    candidates = []
    for image, motion in zip(either, motions, strict=True):
        if motion is None:
            continue
        filled = piece.fill_from(image.moved(motion))
        new = np.flatnonzero(filled.known & ~piece.known)
        misfit = misfit_of_places(clues.survey, clues.plan, filled.xyz_m, new)
        candidates.append((misfit + motion.misfit_m, filled))
    if not candidates:
        return None
    candidates.sort(key=lambda candidate: candidate[0])
    best = candidates[0]
    if len(candidates) > 1 and candidates[1][0] - best[0] < AS_WELL * best[1].extent:
        return None
    return best[1]


def _piece_of(clues, points, places):
    """A Piece with places (k, 3) of some points."""
    piece = empty(clues.points, len(clues.sights))
    piece.xyz_m[points], piece.by_photos[points] = places, False
    return piece


# ---- heights of a piece


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
