"""Pieces of a survey, each with points and photos in one frame, and their connection.

    X_onto = scale R X + shift

Three points, or one photo and a further place, determine the transformation. Many triples are
tried; the transformation with which most places agree is used. Source: Umeyama 1991 (similarity of
point sets); Fischler & Bolles 1981.
"""

from dataclasses import dataclass, replace

import numpy as np

from tankcal.geometry.rotations import rotation_of_angles
from tankcal.survey.observations import ControlCoordinates, PhotoOrientation, PhotoRotation

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
