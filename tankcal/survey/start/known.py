"""Positions known before the computation: certain, or approximate."""

from dataclasses import dataclass, replace

import numpy as np

from tankcal.geometry.rotations import rotation_of_angles
from tankcal.survey.observations import ControlCoordinates, PhotoOrientation, PhotoRotation
from tankcal.survey.start.pieces import Piece


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
