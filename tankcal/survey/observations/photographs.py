"""What photographs observe: image coordinates, and the exterior orientation known beforehand."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from tankcal.camera.imaging import image_rows
from tankcal.geometry.rotations import (
    angle_axes,
    angle_derivatives,
    angles_of,
    rotation_vector,
    vector_derivatives,
)
from tankcal.survey.observations.base import Observations


@dataclass(frozen=True)
class ImageCoordinates(Observations):
    """Measured image coordinates (n, 2), mm: what a photo shows of a point.

    With (u, v, w) = R (X - X0) the ideal image is (-c u / w, -c v / w); the distortion of the
    camera moves it as its `form` says. A `Survey` has those of all cameras in one table; the solver
    has one for each form of camera, with the interior parameters that take part.

    Attributes
    ----------
    value, sd : ndarray, shape (n, 2)
        x to the right and y up from the middle of the format, mm.
    point, photo : ndarray of int, shape (n,)
    form : tankcal.camera.model.Form
        Of the distortion; None: not told apart yet.
    active : ndarray of int, shape (k,)
        Places in PARAMETERS of the parameters that are not left out.
    interior_of : ndarray of int, shape (photos, 13)
        Place of each photo's parameters in State.interior.
    """

    point: np.ndarray
    photo: np.ndarray
    form: object = None
    active: np.ndarray = None
    interior_of: np.ndarray = None

    kind, unit, rows, ties = "image coordinate", "mm", 2, ("point",)
    feels_datum, shared = False, ("active", "interior_of")

    def columns(self, layout):
        """Point (3), photo (6), interior parameters (k)."""
        interior = layout.interior[self.interior_of[:, self.active]]
        of_photo = np.hstack([layout.photos, interior])
        return np.hstack([layout.points[self.point], of_photo[self.photo]])

    def computed(self, state, derivatives):
        """Image coordinates (n, 2) in mm and their derivatives."""
        w = np.empty((len(self), 2))
        jac = np.empty((len(self) if derivatives else 0, 2, 9 + len(self.active)))
        if self.form.weights == "measured":
            self._rows(state, np.zeros_like(w), np.ones_like(w), w, jac)
            return w, jac
        self._rows(state, self.value, np.ones_like(w), w, jac)
        return w + self.value, jac  # the misclosure of the ideal image, as if of the measured

    def fill(self, state, w, jac):
        """Whitened misclosures and derivatives, without arrays in between."""
        self._rows(state, self.value, self.weight, w, jac)

    def _rows(self, state, value, weight, w, jac):
        of_ideal = self.form.convention == "distortion_of_ideal"
        image_rows(
            state.xyz_m, state.photo_xyz_m, state.rotation, state.interior[self.interior_of],
            tuple(self.form.numbers), of_ideal, self.point, self.photo, value, weight,
            self.active, w, jac, in_ideal=self.form.weights == "ideal",
        )  # fmt: skip


@dataclass(frozen=True)
class PhotoOrientation(Observations):
    """Single elements of the exterior orientation known beforehand.

    Attributes
    ----------
    photo : ndarray, shape (n,)
    element : ndarray, shape (n,)
        0 1 2 for x, y, z (m, relative to the centre), 3 4 5 for omega, phi, kappa (rad).
    """

    photo: np.ndarray
    element: np.ndarray

    kind, unit = "exterior orientation", "m or rad"

    def columns(self, layout):
        """Photo (6)."""
        return layout.photos[self.photo]

    def computed(self, state, derivatives):
        """The elements (n, 1)."""
        rotation, rows = state.rotation[self.photo], np.arange(len(self))
        all_six = np.hstack([state.photo_xyz_m[self.photo], angles_of(rotation)])
        if not derivatives:
            return all_six[rows, self.element, None], None
        jac = np.zeros((len(self), 6, 6))
        jac[:, :3, :3] = np.eye(3)
        jac[:, 3:, 3:] = angle_derivatives(rotation)
        return all_six[rows, self.element, None], jac[rows, self.element][:, None, :]

    def difference(self, computed):
        """Computed minus observed; angles by the shorter way round."""
        found = super().difference(computed)
        angle = np.asarray(self.element) > 2
        found[angle] = np.angle(np.exp(1j * found[angle]))
        return found


@dataclass(frozen=True)
class PhotoRotation(Observations):
    """Whole rotations known beforehand, for photos of which all three angles are.

    The misclosure is the small rotation vector from the known rotation, with the covariance that
    the sds of the angles give it there: no angle of the rotation that is being adjusted is needed.
    Near phi = 90 deg omega and kappa turn about the same axis, and their sds say nothing about a
    third one: no direction is held tighter than a tenth of the smallest sd.

    Attributes
    ----------
    value : ndarray, shape (n, 3)
        Zeros.
    sd : ndarray, shape (n, 3)
        Rad, of omega, phi, kappa.
    photo : ndarray, shape (n,)
    rotation : ndarray, shape (n, 3, 3)
        Known.
    """

    photo: np.ndarray
    rotation: np.ndarray

    kind, unit, rows = "photo rotation", "rad", 3

    def columns(self, layout):
        """Photo's rotation (3)."""
        return layout.photos[self.photo, 3:]

    def computed(self, state, derivatives):
        """Rotation vectors (n, 3) from the known rotations, in the camera's frame."""
        away = rotation_vector(state.rotation[self.photo] @ self.rotation.transpose(0, 2, 1))
        return away, vector_derivatives(away) if derivatives else None

    @cached_property
    def whitener(self):
        """(n, 3, 3) inverse roots of the covariance of the rotation vectors."""
        turns = angle_axes(self.rotation)
        covariance = np.einsum("nij,nj,nkj->nik", turns, np.square(self.sd), turns)
        variances, axes = np.linalg.eigh(covariance)
        floor = 0.01 * np.square(self.sd).min(axis=1, keepdims=True)
        share = 1.0 if self.use is None else np.sqrt(self.use)[:, None]
        root = share / np.sqrt(np.maximum(variances, floor))
        return root[:, :, None] * axes.transpose(0, 2, 1)

    def fill(self, state, w, jac):
        """Whitened misclosures and derivatives."""
        away, derivatives = self.computed(state, len(jac) > 0)
        w[:] = np.einsum("nij,nj->ni", self.whitener, away)
        if len(jac):
            jac[:] = self.whitener @ derivatives
