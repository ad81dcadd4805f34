"""Observations with an sd of zero: what they say holds exactly.

Their rows are not divided by an sd; single angles of a photo are written so that they stay sound
up to phi = 90 deg. With R = R3(kappa) R2(phi) R1(omega), rows counted from 0,

    omega0     -R21 cos(omega0) - R22 sin(omega0) = cos(phi) sin(omega - omega0) = 0
    kappa0     -R10 cos(kappa0) - R00 sin(kappa0) = cos(phi) sin(kappa - kappa0) = 0
    phi0       phi - phi0 = 0, at +-90 deg  R00 = R10 = 0
    all three  rotation vector from R0 = 0 (tests of the three are then about the camera's axes)
"""

from dataclasses import dataclass, replace

import numpy as np

from tankcal.errors import SolutionError
from tankcal.geometry.rotations import (
    angle_derivatives,
    angles_of,
    rotation_of_angles,
    rotation_vector,
    vector_derivatives,
)
from tankcal.messages import message
from tankcal.survey.observations.base import Observations
from tankcal.survey.observations.photographs import PhotoOrientation, PhotoRotation

UPRIGHT = 1e-6  # rad from 90 deg: phi is then no angle any more but a direction
OMEGA, PHI, KAPPA, ACROSS, ALONG, VECTOR = 3, 4, 5, 6, 7, 8  # rows of HeldOrientation
NAMES = ("x", "y", "z", "omega", "phi", "kappa", "phi", "phi", "omega", "phi", "kappa")


@dataclass(frozen=True)
class HeldOrientation(Observations):
    """Elements of the exterior orientation that hold exactly; value in m (relative) or rad.

    Attributes
    ----------
    photo : ndarray, shape (n,)
    row : ndarray, shape (n,)
        0 1 2 for x, y, z, 3 4 5 for omega, phi, kappa, 6 7 for phi at +-90 deg, 8 9 10 for the
        rotation vector from `rotation`.
    rotation : ndarray, shape (n, 3, 3)
        Known, of rows 8 to 10.
    """

    photo: np.ndarray
    row: np.ndarray
    rotation: np.ndarray

    kind, unit = "exterior orientation", "m or rad"

    def columns(self, layout):
        """Photo (6)."""
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


def lever(conditions, state):
    """Change of a condition over that of its observation: cos(phi) for omega and kappa.

    Parameters
    ----------
    conditions : Observations
    state : State

    Returns
    -------
    ndarray, shape (n, m)
    """
    found = np.ones((len(conditions), conditions.rows))
    if isinstance(conditions, HeldOrientation):
        turning = (conditions.row == OMEGA) | (conditions.row == KAPPA)
        phi = angles_of(state.rotation[conditions.photo[turning]])[:, 1]
        found[turning] = np.cos(phi)[:, None]
    return found


def _element(rotation, i, j):
    """Element (n,) of rotation matrices, and its derivatives (n, 3) by a small rotation d x R."""
    value, by = rotation[:, i, j], np.zeros((len(rotation), 3))
    k, l = (i + 1) % 3, (i + 2) % 3
    by[:, k], by[:, l] = rotation[:, l, j], -rotation[:, k, j]
    return value, by


def exact_rows(one):
    """Which observations of a table hold exactly: sd 0, and taking part.

    Parameters
    ----------
    one : Observations

    Returns
    -------
    ndarray of bool, shape (n,)

    Raises
    ------
    SolutionError
        When only a part of an observation has the sd 0.
    """
    zero = np.asarray(one.sd).reshape(len(one), one.rows) == 0
    if not zero.any():
        return np.zeros(len(one), dtype=bool)
    if (zero.any(axis=1) & ~zero.all(axis=1)).any():
        raise SolutionError(
            message(
                "exact_in_part", "{kind}: all its values hold exactly (sd 0) or none", kind=one.kind
            )
        )
    return zero.all(axis=1)


def make_conditions(one):
    """Observations that hold exactly, to be filled without an sd, and their rows' numbers (k,).

    Parameters
    ----------
    one
        Observations with sd 0.
    """
    n = len(one)
    if isinstance(one, PhotoRotation):
        row = np.tile(VECTOR + np.arange(3), n)
        rotation = np.repeat(one.rotation, 3, axis=0)
        return _held(np.zeros(3 * n), np.repeat(one.photo, 3), row, rotation), np.repeat(
            np.arange(n), 3
        )
    if isinstance(one, PhotoOrientation):
        return _held_elements(one)
    return replace(one, sd=np.ones(np.shape(one.value)), use=None), np.arange(n)


def _held(value, photo, row, rotation):
    return HeldOrientation(value, np.ones(len(value)), photo=photo, row=row, rotation=rotation)


def _held_elements(one):
    value, row = np.array(one.value, dtype=float), np.array(one.element)
    rotation = np.tile(np.eye(3), (len(one), 1, 1))
    for photo in np.unique(one.photo):
        mine = np.flatnonzero((one.photo == photo) & (row > 2))
        if len(mine) == 3 and len(np.unique(row[mine])) == 3:
            rotation[mine] = rotation_of_angles(*value[mine[np.argsort(row[mine])]])
            row[mine], value[mine] = row[mine] + VECTOR - OMEGA, 0.0
    numbers = np.arange(len(one))
    upright = np.flatnonzero((row == PHI) & (np.abs(np.abs(value) - np.pi / 2) < UPRIGHT))
    value[upright], row[upright] = 0.0, ACROSS
    numbers = np.concatenate([numbers, upright])
    row = np.concatenate([row, np.full(len(upright), ALONG)])
    return _held(value[numbers], one.photo[numbers], row, rotation[numbers]), numbers
