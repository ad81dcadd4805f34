"""Observations of photographs: image coordinates, and a priori exterior orientation.

Elements of the orientation with an sd of zero hold exactly. Their rows are not divided by an sd.
Single angles are written so that their equations remain valid up to phi = 90 deg. With the rotation
R = R3(kappa) R2(phi) R1(omega), rows counted from 0,

    omega0     -R21 cos(omega0) - R22 sin(omega0) = cos(phi) sin(omega - omega0) = 0
    kappa0     -R10 cos(kappa0) - R00 sin(kappa0) = cos(phi) sin(kappa - kappa0) = 0
    phi0       phi - phi0 = 0, at +-90 deg  R00 = R10 = 0
    all three  rotation vector from R0 = 0 (tests of the three then refer to the camera axes)
"""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from tankcal.camera.imaging import image_rows
from tankcal.geometry.rotations import (
    angle_axes,
    angle_derivatives,
    angles_of,
    rotation_of_angles,
    rotation_vector,
    vector_derivatives,
)
from tankcal.survey.observations.base import Observations

UPRIGHT = 1e-6  # rad from 90 deg: phi is then a direction, not an angle
OMEGA, PHI, KAPPA, ACROSS, ALONG, VECTOR = 3, 4, 5, 6, 7, 8  # rows of HeldOrientation


@dataclass(frozen=True)
class ImageCoordinates(Observations):
    """Measured image coordinates (n, 2), mm.

    With (u, v, w) = R (X - X0) the ideal image is (-c u / w, -c v / w); the distortion of the
    camera moves it according to its `form`. A `Survey` has one table for all cameras; the solver
    has one table for each form of camera, with the interior parameters in use.

    Attributes
    ----------
    value, sd : ndarray, shape (n, 2)
        x to the right and y upwards from the centre of the format, mm.
    point, photo : ndarray of int, shape (n,)
    form : tankcal.camera.model.Form
        Form of the distortion; None: not split by form yet.
    active : ndarray of int, shape (k,)
        Indices in PARAMETERS of the parameters in use.
    interior_of : ndarray of int, shape (photos, 13)
        Indices of the parameters of each photo in State.interior.
    """

    point: np.ndarray
    photo: np.ndarray
    form: object = None
    active: np.ndarray = None
    interior_of: np.ndarray = None

    kind, unit, rows, ties = "image coordinate", "mm", 2, ("point",)
    feels_datum, shared = False, ("active", "interior_of")

    def columns(self, layout):
        """Columns of point (3), photo (6), interior parameters (k)."""
        interior = layout.interior[self.interior_of[:, self.active]]
        of_photo = np.concatenate([layout.photos, interior], axis=1).astype(np.int32)
        numbers = np.empty((len(self), 3 + of_photo.shape[1]), dtype=np.int32)
        numbers[:, :3] = layout.points.take(self.point, axis=0)
        numbers[:, 3:] = of_photo.take(self.photo, axis=0)
        return numbers

    def computed(self, state, derivatives):
        """Image coordinates (n, 2) in mm and their derivatives."""
        w = np.empty((len(self), 2))
        jac = np.empty((len(self) if derivatives else 0, 2, 9 + len(self.active)))
        if self.form.weights == "measured":
            self._rows(state, np.zeros_like(w), np.ones_like(w), w, jac)
            return w, jac
        self._rows(state, self.value, np.ones_like(w), w, jac)
        # The misclosure of the ideal image takes the place of that of the measured image.
        return w + self.value, jac

    def fill(self, state, w, jac):
        """Write whitened misclosures and derivatives without intermediate arrays."""
        self._rows(state, self.value, self.weight, w, jac)

    def _rows(self, state, value, weight, w, jac):
        """Call the kernel for misclosures and derivatives of all rows."""
        of_ideal = self.form.convention == "distortion_of_ideal"
        image_rows(
            state.xyz_m, state.photo_xyz_m, state.rotation, state.interior[self.interior_of],
            self.form.numbers, of_ideal, self.point, self.photo, value, weight,
            self.active, w, jac, in_ideal=self.form.weights == "ideal",
        )  # fmt: skip


@dataclass(frozen=True)
class PhotoOrientation(Observations):
    """Single elements of the exterior orientation with a priori values.

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
        """Columns of the photo (6)."""
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
        """Computed minus observed; angles reduced to -pi to pi."""
        misclosure = super().difference(computed)
        angle = np.asarray(self.element) > 2
        # The argument of exp(i x) is x reduced to one turn.
        misclosure[angle] = np.angle(np.exp(1j * misclosure[angle]))
        return misclosure

    def relative(self, centre):
        """The observations with projection centres relative to a centre (3,)."""
        return replace(self, value=self.value - np.append(centre, np.zeros(3))[self.element])

    def conditions(self):
        """Exact elements as conditions, see the module docstring."""
        return _held_elements(self)


@dataclass(frozen=True)
class PhotoRotation(Observations):
    """Complete rotations with a priori values, for photos with three known angles.

    The misclosure is the small rotation vector from the known rotation. Its covariance follows from
    the standard deviations of the angles at the known rotation, so that no angle of the adjusted
    rotation is needed. Near phi = 90 deg omega and kappa rotate about the same axis, and their sds
    do not determine a third axis. No direction is therefore held tighter than a tenth of the
    smallest sd.

    Attributes
    ----------
    value : ndarray, shape (n, 3)
        Zeros.
    sd : ndarray, shape (n, 3)
        Of omega, phi, kappa, rad.
    photo : ndarray, shape (n,)
    rotation : ndarray, shape (n, 3, 3)
        Known rotations.
    """

    photo: np.ndarray
    rotation: np.ndarray

    kind, unit, rows = "photo rotation", "rad", 3

    def columns(self, layout):
        """Columns of the rotation of the photo (3)."""
        return layout.photos[self.photo, 3:]

    def computed(self, state, derivatives):
        """Rotation vectors (n, 3) from the known rotations, in the frame of the camera."""
        away = rotation_vector(state.rotation[self.photo] @ self.rotation.transpose(0, 2, 1))
        return away, vector_derivatives(away) if derivatives else None

    @cached_property
    def whitener(self):
        """Inverse roots (n, 3, 3) of the covariance of the rotation vectors."""
        turns = angle_axes(self.rotation)
        # Each angle rotates about its own axis: covariance = sum of s^2 a a' over the three axes.
        covariance = np.einsum("nij,nj,nkj->nik", turns, np.square(self.sd), turns)
        variances, axes = np.linalg.eigh(covariance)
        # (0.1 smallest sd)^2, the limit stated above.
        floor = 0.01 * np.square(self.sd).min(axis=1, keepdims=True)
        share = 1.0 if self.use is None else np.sqrt(self.use)[:, None]
        root = share / np.sqrt(np.maximum(variances, floor))
        return root[:, :, None] * axes.transpose(0, 2, 1)

    def fill(self, state, w, jac):
        """Write whitened misclosures and derivatives."""
        away, derivatives = self.computed(state, len(jac) > 0)
        w[:] = np.einsum("nij,nj->ni", self.whitener, away)
        if len(jac):
            jac[:] = self.whitener @ derivatives

    def conditions(self):
        """Exact rotations as conditions, three rows each."""
        n = len(self)
        row = np.tile(VECTOR + np.arange(3), n)
        rotation, photo = np.repeat(self.rotation, 3, axis=0), np.repeat(self.photo, 3)
        return _held_orientation(np.zeros(3 * n), photo, row, rotation), np.repeat(np.arange(n), 3)


@dataclass(frozen=True)
class HeldOrientation(Observations):
    """Exact elements of the exterior orientation; value in m (relative) or rad.

    Attributes
    ----------
    photo : ndarray, shape (n,)
    row : ndarray, shape (n,)
        0 1 2 for x, y, z, 3 4 5 for omega, phi, kappa, 6 7 for phi at +-90 deg, 8 9 10 for the
        rotation vector from `rotation`.
    rotation : ndarray, shape (n, 3, 3)
        Known rotation, for rows 8 to 10.
    """

    photo: np.ndarray
    row: np.ndarray
    rotation: np.ndarray

    kind, unit = "exterior orientation", "m or rad"

    def columns(self, layout):
        """Columns of the photo (6)."""
        return layout.photos[self.photo]

    def computed(self, state, derivatives):
        """Misclosures (n, 1) of the rows, plus their values."""
        r, value = state.rotation[self.photo], np.asarray(self.value, dtype=float)
        off, jac = np.zeros(len(self)), np.zeros((len(self), 1, 6))
        place = np.flatnonzero(self.row < 3)
        off[place] = state.photo_xyz_m[self.photo[place], self.row[place]] - value[place]
        jac[place, 0, self.row[place]] = 1.0
        for row, (i, a), (j, b) in ((OMEGA, (2, 1), (2, 2)), (KAPPA, (1, 0), (0, 0))):
            here = np.flatnonzero(self.row == row)
            # The equations of omega and kappa are linear in two elements of R.
            first, by_first = _element(r[here], i, a)
            second, by_second = _element(r[here], j, b)
            cos, sin = np.cos(value[here]), np.sin(value[here])
            off[here] = -first * cos - second * sin
            jac[here, 0, 3:] = -by_first * cos[:, None] - by_second * sin[:, None]
        here = np.flatnonzero(self.row == PHI)
        off[here] = angles_of(r[here])[:, 1] - value[here]
        jac[here, 0, 3:] = angle_derivatives(r[here])[:, 1]
        for row, i in ((ACROSS, 0), (ALONG, 1)):
            here = np.flatnonzero(self.row == row)
            off[here], jac[here, 0, 3:] = _element(r[here], i, 0)
        here = np.flatnonzero(self.row >= VECTOR)
        away = rotation_vector(r[here] @ self.rotation[here].transpose(0, 2, 1))
        which = self.row[here] - VECTOR
        off[here] = away[np.arange(len(here)), which]
        jac[here, 0, 3:] = vector_derivatives(away)[np.arange(len(here)), which]
        return (off + value)[:, None], jac if derivatives else None

    def lever(self, state):
        """cos(phi) for omega and kappa, otherwise 1."""
        levers = super().lever(state)
        turning = (self.row == OMEGA) | (self.row == KAPPA)
        phi = angles_of(state.rotation[self.photo[turning]])[:, 1]
        levers[turning] = np.cos(phi)[:, None]
        return levers


def _element(rotation, i, j):
    """Element (n,) of rotation matrices, and its derivatives (n, 3) by a small rotation d x R."""
    value, derivatives = rotation[:, i, j], np.zeros((len(rotation), 3))
    k, l = (i + 1) % 3, (i + 2) % 3
    derivatives[:, k], derivatives[:, l] = rotation[:, l, j], -rotation[:, k, j]
    return value, derivatives


def _held_orientation(value, photo, row, rotation):
    """HeldOrientation with unit standard deviations."""
    return HeldOrientation(value, np.ones(len(value)), photo=photo, row=row, rotation=rotation)


def _held_elements(one):
    """Exact elements as HeldOrientation, and the observation number of each row."""
    value, row = np.array(one.value, dtype=float), np.array(one.element)
    rotation = np.tile(np.eye(3), (len(one), 1, 1))
    for photo in np.unique(one.photo):
        angles = np.flatnonzero((one.photo == photo) & (row > 2))
        if len(angles) == 3 and len(np.unique(row[angles])) == 3:
            # Three exact angles of a photo are one exact rotation.
            rotation[angles] = rotation_of_angles(*value[angles[np.argsort(row[angles])]])
            row[angles], value[angles] = row[angles] + VECTOR - OMEGA, 0.0
    numbers = np.arange(len(one))
    # At phi = +-90 deg the derivative of phi is singular; two conditions replace it.
    upright = np.flatnonzero((row == PHI) & (np.abs(np.abs(value) - np.pi / 2) < UPRIGHT))
    value[upright], row[upright] = 0.0, ACROSS
    numbers = np.concatenate([numbers, upright])
    row = np.concatenate([row, np.full(len(upright), ALONG)])
    return _held_orientation(value[numbers], one.photo[numbers], row, rotation[numbers]), numbers
