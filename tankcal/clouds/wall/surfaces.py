"""Approximate surfaces of a wall: upright or lying cylinder, and sphere.

`places` converts points to surface coordinates, and `points` converts them back. The coordinates
are u along the axis (m), the azimuth about the axis (0 to 2 pi) and the distance outwards from the
surface (m).
"""

from dataclasses import dataclass, field

import numpy as np

from tankcal.units import FULL_TURN


def _turn(x, y):
    """Azimuth arctan2(x, y) from 0 to 2 pi; three times as fast as the remainder."""
    turn = np.arctan2(x, y)
    turn += FULL_TURN * (turn < 0)
    return turn


@dataclass(frozen=True)
class CylinderSurface:
    """Approximate cylinder; distances are normal to the third vector of its frame.

    Attributes
    ----------
    centre_m : ndarray, shape (3,)
        Point of the axis, m.
    radius_m : float
        Radius, m.
    slope : tuple of float
        Displacement of the axis along the first two vectors per metre along the third.
    frame : ndarray, shape (3, 3)
        Unit vectors in the rows. The azimuth is 0 along the second vector and increases towards the
        first. For an upright tank the vectors are x, y and z, and u is the height.
    """

    centre_m: np.ndarray
    radius_m: float
    slope: tuple[float, float] = (0.0, 0.0)
    frame: np.ndarray = field(default_factory=lambda: np.eye(3))

    def local(self, xyz_m):
        """Coordinates (3, n) of points in the frame, relative to the centre."""
        columns = np.ascontiguousarray((xyz_m - self.centre_m).T)
        if np.array_equal(self.frame, np.eye(3)):
            return columns
        # The rounding of a matrix product would depend on the number of points.
        x, y, z = columns
        return np.stack([a * x + b * y + c * z for a, b, c in self.frame])

    def places(self, xyz_m):
        """Convert points (n, 3) to u (m), azimuth (rad) and distance outwards (m), each (n,)."""
        x, y, z = self.local(xyz_m)
        x -= self.slope[0] * z
        y -= self.slope[1] * z
        distance = np.sqrt(x * x + y * y) - self.radius_m
        return z + self.origin, _turn(x, y), distance

    def points(self, u, turn, distance):
        """Convert u (m), azimuth (rad) and distance outwards (m), each (n,), to points (n, 3)."""
        z = u - self.origin
        r = self.radius_m + distance
        x, y = r * np.sin(turn) + self.slope[0] * z, r * np.cos(turn) + self.slope[1] * z
        return np.column_stack([x, y, z]) @ self.frame + self.centre_m

    @property
    def origin(self):
        """Coordinate u of the centre, m."""
        return float(self.frame[2] @ self.centre_m)

    def width_m(self, u):
        """Radius of the circle of a row at u, m."""
        return np.full(np.shape(u), self.radius_m)


@dataclass(frozen=True)
class SphereSurface:
    """Approximate sphere; u is the height on the sphere, so that equal rows have equal areas.

    Attributes
    ----------
    centre_m : ndarray, shape (3,)
        Centre, m.
    radius_m : float
        Radius, m.
    """

    centre_m: np.ndarray
    radius_m: float

    def places(self, xyz_m):
        """Convert points (n, 3) to u (m), azimuth (rad) and distance outwards (m), each (n,)."""
        x, y, z = np.ascontiguousarray((xyz_m - self.centre_m).T)
        distance = np.sqrt(x * x + y * y + z * z)
        up = self.radius_m * z / np.maximum(distance, np.finfo(float).tiny)
        return up + self.centre_m[2], _turn(x, y), distance - self.radius_m

    def points(self, u, turn, distance):
        """Convert u (m), azimuth (rad) and distance outwards (m), each (n,), to points (n, 3)."""
        sine = np.clip((u - self.centre_m[2]) / self.radius_m, -1, 1)
        level = np.sqrt(1 - sine**2)
        normal = np.column_stack([level * np.sin(turn), level * np.cos(turn), sine])
        return self.centre_m + (self.radius_m + distance)[:, None] * normal

    def width_m(self, u):
        """Radius of the circle of a row at u, m."""
        return np.sqrt(np.maximum(self.radius_m**2 - (np.asarray(u) - self.centre_m[2]) ** 2, 0))
