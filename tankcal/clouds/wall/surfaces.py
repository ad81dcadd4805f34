"""The surfaces that cells of a wall lie about: a cylinder standing or lying, and a sphere.

Each says of points where they are on it (`places`), and of such places which points they are
(`points`). A place is u, along the rows of cells (m), the turn about the axis (0 to 2 pi), and the
distance outwards from the surface (m).
"""

from dataclasses import dataclass, field

import numpy as np

from tankcal.geometry.outlines import FULL_TURN


def _turn(x, y):
    """arctan2(x, y) from 0 to 2 pi: as the remainder is, and three times as fast."""
    turn = np.arctan2(x, y)
    turn += FULL_TURN * (turn < 0)
    return turn


@dataclass(frozen=True)
class CylinderSurface:
    """An approximate cylinder: distances are taken square to the third vector of its frame.

    Attributes
    ----------
    centre_m : ndarray, shape (3,)
        A point of its axis, m.
    radius_m : float
    slope : tuple of float
        By how much the axis moves along the first two vectors for each metre of the third.
    frame : ndarray, shape (3, 3)
        Unit vectors in its rows: turns are 0 along the second and run towards the first. Those of
        an upright tank are x, y and z, so that u is the height and a turn an azimuth.
    """

    centre_m: np.ndarray
    radius_m: float
    slope: tuple[float, float] = (0.0, 0.0)
    frame: np.ndarray = field(default_factory=lambda: np.eye(3))

    def local(self, xyz_m):
        """(3, n) columns in the frame, about the centre."""
        columns = np.ascontiguousarray((xyz_m - self.centre_m).T)
        if np.array_equal(self.frame, np.eye(3)):
            return columns
        x, y, z = columns  # no product of matrices: its rounding would hang on the number of points
        return np.stack([a * x + b * y + c * z for a, b, c in self.frame])

    def places(self, xyz_m):
        """u (n,), turn (n,) and distance outwards (n,) of points (n, 3)."""
        x, y, z = self.local(xyz_m)
        x -= self.slope[0] * z
        y -= self.slope[1] * z
        distance = np.sqrt(x * x + y * y) - self.radius_m
        return z + self.origin, _turn(x, y), distance

    def points(self, u, turn, distance):
        """(n, 3) points at places (n,) each."""
        z = u - self.origin
        r = self.radius_m + distance
        x, y = r * np.sin(turn) + self.slope[0] * z, r * np.cos(turn) + self.slope[1] * z
        return np.column_stack([x, y, z]) @ self.frame + self.centre_m

    @property
    def origin(self):
        """u of the centre."""
        return float(self.frame[2] @ self.centre_m)

    def width_m(self, u):
        """Radius of the circle that a row at u goes round."""
        return np.full(np.shape(u), self.radius_m)


@dataclass(frozen=True)
class SphereSurface:
    """An approximate sphere: u is the height on it, so that even rows are zones of equal area.

    Attributes
    ----------
    centre_m : ndarray, shape (3,)
    radius_m : float
    """

    centre_m: np.ndarray
    radius_m: float

    def places(self, xyz_m):
        """u (n,), turn (n,) and distance outwards (n,) of points (n, 3)."""
        x, y, z = np.ascontiguousarray((xyz_m - self.centre_m).T)
        distance = np.sqrt(x * x + y * y + z * z)
        up = self.radius_m * z / np.maximum(distance, np.finfo(float).tiny)
        return up + self.centre_m[2], _turn(x, y), distance - self.radius_m

    def points(self, u, turn, distance):
        """(n, 3) points at places (n,) each."""
        sine = np.clip((u - self.centre_m[2]) / self.radius_m, -1, 1)
        level = np.sqrt(1 - sine**2)
        normal = np.column_stack([level * np.sin(turn), level * np.cos(turn), sine])
        return self.centre_m + (self.radius_m + distance)[:, None] * normal

    def width_m(self, u):
        """Radius of the circle that a row at u goes round."""
        return np.sqrt(np.maximum(self.radius_m**2 - (np.asarray(u) - self.centre_m[2]) ** 2, 0))
