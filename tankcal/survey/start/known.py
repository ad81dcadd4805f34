"""What a survey knows of places before anything is computed: for certain, or only about."""

from dataclasses import dataclass, replace

import numpy as np

from tankcal.geometry.rotations import rotation_of_angles
from tankcal.survey.observations import ControlCoordinates, PhotoOrientation, PhotoRotation
from tankcal.survey.start.pieces import Piece


@dataclass(frozen=True)
class Known:
    """Places that are known, as a Piece; coordinates of points each on its own."""

    piece: Piece

    @property
    def nothing(self):
        """True when not a single coordinate or photo is known."""
        return not (np.isfinite(self.piece.xyz_m).any() or self.piece.oriented.any())

    def without(self, other):
        """The same without points and photos of which the other one knows something."""
        piece, told = self.piece, np.isfinite(other.piece.xyz_m).any(axis=1)
        photos = other.piece.oriented
        return Known(
            replace(
                piece,
                xyz_m=np.where(told[:, None], np.nan, piece.xyz_m),
                by_photos=piece.by_photos | told,
                place_m=np.where(photos[:, None], np.nan, piece.place_m),
                rotation=np.where(photos[:, None, None], np.nan, piece.rotation),
            )
        )

    def shifted(self, shift_m):
        """The same in a frame that is shifted."""
        piece = self.piece
        return Known(replace(piece, xyz_m=piece.xyz_m + shift_m, place_m=piece.place_m + shift_m))


def certain_places(survey):
    """Known places that are fixed or observed, of points that something was measured to."""
    xyz = np.full((len(survey.points), 3), np.nan)
    if survey.fixed is not None:
        xyz = np.where(survey.fixed & _measured(survey)[:, None], survey.xyz_m, xyz)
    for one in survey.observations:
        if isinstance(one, ControlCoordinates):
            used = one.in_use
            xyz[one.point[used], one.axis[used]] = one.value[used]
    photos = survey.photos
    if photos is None:
        return Known(_piece(xyz, np.zeros((0, 3)), np.zeros((0, 3, 3))))
    place, angles, rotation = _photos_observed(survey)
    if photos.fixed is not None:
        place = np.where(photos.fixed[:, :3], photos.xyz_m, place)
        rotation = np.where(photos.fixed[:, 3, None, None], photos.rotation, rotation)
    told = np.isfinite(angles).all(axis=1) & np.isnan(rotation).any(axis=(1, 2))
    if told.any():
        rotation[told] = rotation_of_angles(*angles[told].T)
    return Known(_piece(xyz, place, rotation))


def _photos_observed(survey):
    """Places (n, 3), angles (n, 3) and rotations (n, 3, 3) of photos that were observed."""
    n = len(survey.photos.names)
    six, rotation = np.full((n, 6), np.nan), np.full((n, 3, 3), np.nan)
    for one in survey.observations:
        if isinstance(one, PhotoOrientation):
            six[one.photo, one.element] = one.value
        elif isinstance(one, PhotoRotation):
            rotation[one.photo] = one.rotation
    return six[:, :3], six[:, 3:], rotation


def hinted_places(survey):
    """All start values that were given, whatever they are worth, of points measured to."""
    photos, xyz = survey.photos, np.where(_measured(survey)[:, None], survey.xyz_m, np.nan)
    if photos is None:
        return Known(_piece(xyz, np.zeros((0, 3)), np.zeros((0, 3, 3))))
    return Known(_piece(xyz, photos.xyz_m, photos.rotation))


def _measured(survey):
    """(points,) True for points that an image or an observation speaks of."""
    found = np.zeros(len(survey.points), dtype=bool)
    if survey.image_points is not None:
        found[survey.image_points.point] = True
    for one in survey.observations:
        for name in one.ties:
            found[getattr(one, name)] = True
    return found


def _piece(xyz_m, place_m, rotation):
    by_photos = ~np.isfinite(xyz_m).any(axis=1)
    return Piece(
        np.array(xyz_m, dtype=float),
        by_photos,
        np.array(place_m, dtype=float),
        np.array(rotation, dtype=float),
    )
