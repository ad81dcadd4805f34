"""Distances, angles and directions between points: tapes, levels, theodolites, total stations.

From `start` (plus height of the instrument) to `end` (plus height of the target), with (x, y, z)
the difference, p2 = x2 + y2 and s2 = p2 + z2:

    azimuth atan2(x, y)     height angle atan2(z, p)     zenith angle pi/2 - that     distance s

Azimuths are clockwise from +y. Derivatives by `start` are the negative derivatives by `end`.
"""

from dataclasses import dataclass, field

import numpy as np

from tankcal.survey.observations.base import Observations


@dataclass(frozen=True)
class Sights(Observations):
    """Observations from one point to another.

    Attributes
    ----------
    start, end : ndarray, shape (n,)
        Points.
    rise_m : ndarray, shape (n,)
        Height of the instrument minus height of the target; None: zero.
    """

    start: np.ndarray
    end: np.ndarray
    rise_m: np.ndarray = field(default=None, kw_only=True)

    ties, places_points = ("end", "start"), True

    def line(self, state):
        """Differences x, y, z (3, n), end minus start, m."""
        d = (state.xyz_m[self.end] - state.xyz_m[self.start]).T
        if self.rise_m is not None:
            d[2] -= self.rise_m
        return d

    @staticmethod
    def of_ends(derivative):
        """Derivatives (n, 1, 6) by end and start from derivatives by the difference (3, n)."""
        d = np.stack(derivative, axis=-1)
        return np.concatenate([d, -d], axis=1)[:, None, :]


@dataclass(frozen=True)
class Distances(Sights):
    """Distances by tape, EDM or total station: (1 + scale) s + offset.

    The derivatives are (1 + scale) (x, y, z) / s by `end`, s by the scale, and 1 by the offset.

    Parameters
    ----------
    value, sd : ndarray, shape (n,)
        m.
    start, end : ndarray of int, shape (n,)
        Points.
    instrument : ndarray of int, shape (n,)
        Instrument of scale (without unit) and offset (m); -1 for none.
    horizontal : bool
        True: heights do not enter, z = 0.
    rise_m : ndarray, shape (n,), optional
        m.
    """

    instrument: np.ndarray
    horizontal: bool = field(default=False, kw_only=True)

    kind = "distance"
    nuisances = ("scale", "instrument"), ("offset_m", "instrument")

    @property
    def axes(self):
        """Coordinates in the equation; a horizontal distance does not depend on heights."""
        return (0, 1) if self.horizontal else (0, 1, 2)

    def without_derivatives(self, state):
        """Mask (n,), True where both ends coincide; in plan, if the distance is horizontal."""
        x, y, z = self.line(state)
        return (x == 0) & (y == 0) & (self.horizontal | (z == 0))

    def computed(self, state, derivatives):
        """The readings (n, 1)."""
        d = self.line(state)
        # Without the height difference the derivative by z vanishes as well.
        if self.horizontal:
            d[2] = 0.0
        s = np.sqrt(np.einsum("kn,kn->n", d, d))
        scale, offset = self.nuisance(state)
        m = 1.0 + scale
        computed = (m * s + offset)[:, None]
        if not derivatives:
            return computed, None
        jacobian = np.ones((len(self), 1, 8))
        jacobian[:, 0, :3] = (m * d / s).T
        jacobian[:, 0, 3:6] = -jacobian[:, 0, :3]
        jacobian[:, 0, 6] = s
        return computed, jacobian


@dataclass(frozen=True)
class _Angles(Sights):
    """Sights with angles, in rad."""

    unit = "rad"

    def without_derivatives(self, state):
        """Mask (n,), True where both ends coincide in plan, where no angle has derivatives."""
        x, y, _ = self.line(state)
        return (x == 0) & (y == 0)

    def difference(self, computed):
        """Computed minus observed, reduced to -pi to pi."""
        misclosure = super().difference(computed)
        return misclosure - 2 * np.pi * np.round(misclosure / (2 * np.pi))


def azimuth(x, y):
    """Azimuth (n,), rad clockwise from +y, and its derivatives by x, y, z (3, n)."""
    p2 = x * x + y * y
    return np.arctan2(x, y), np.stack([y / p2, -x / p2, np.zeros_like(p2)])


@dataclass(frozen=True)
class Azimuths(_Angles):
    """Azimuths, clockwise from +y: atan2(x, y).

    The derivatives by `end` are (y, -x, 0) / p2.

    Parameters
    ----------
    value, sd : ndarray, shape (n,)
        rad.
    start, end : ndarray of int, shape (n,)
        Points.
    """

    kind, axes, knows_frame = "azimuth", (0, 1), True

    def computed(self, state, derivatives):
        """The azimuths (n, 1)."""
        x, y, _ = self.line(state)
        value, derivative = azimuth(x, y)
        return value[:, None], self.of_ends(derivative) if derivatives else None

    def off_frame(self, d):
        """Misfits in metres, a list of (n,), from differences d (n, 3) of the ends."""
        # The angular misfit becomes a length across the line.
        away = np.hypot(d[:, 0], d[:, 1])
        return [d[:, 0] - away * np.sin(self.value), d[:, 1] - away * np.cos(self.value)]


@dataclass(frozen=True)
class Directions(_Angles):
    """Directions on a circle whose zero has an unknown azimuth: atan2(x, y) - orientation.

    The derivatives by `end` are those of an azimuth, by the orientation -1.

    Parameters
    ----------
    value, sd : ndarray, shape (n,)
        rad.
    start, end : ndarray of int, shape (n,)
        Points.
    set : ndarray of int, shape (n,)
        Set of directions; each has its own orientation unknown (rad).
    """

    set: np.ndarray

    kind, axes = "direction", (0, 1)
    nuisances = (("orientation_rad", "set"),)

    def computed(self, state, derivatives):
        """The directions (n, 1)."""
        x, y, _ = self.line(state)
        value, derivative = azimuth(x, y)
        computed = (value - self.nuisance(state)[0])[:, None]
        if not derivatives:
            return computed, None
        # The orientation enters with derivative -1.
        turn = np.full((len(self), 1, 1), -1.0)
        return computed, np.concatenate([self.of_ends(derivative), turn], axis=2)


@dataclass(frozen=True)
class HorizontalAngles(_Angles):
    """Horizontal angles at `start`, clockwise from `origin` to `end`: differences of azimuths.

    Parameters
    ----------
    value, sd : ndarray, shape (n,)
        rad.
    start, end, origin : ndarray of int, shape (n,)
        Points.
    """

    origin: np.ndarray

    kind, ties, axes = "horizontal angle", ("end", "start", "origin"), (0, 1)

    def without_derivatives(self, state):
        """Mask (n,), True where the station coincides in plan with one of its targets."""
        back = state.xyz_m[self.origin, :2] == state.xyz_m[self.start, :2]
        return super().without_derivatives(state) | back.all(axis=1)

    def computed(self, state, derivatives):
        """The angles (n, 1)."""
        x, y, _ = self.line(state)
        back = state.xyz_m[self.origin] - state.xyz_m[self.start]
        first, of_first = azimuth(x, y)
        second, of_second = azimuth(back[:, 0], back[:, 1])
        if not derivatives:
            return (first - second)[:, None], None
        # The station enters both azimuths with negative sign, so its derivative is the difference.
        jac = np.concatenate([of_first, of_second - of_first, -of_second]).T[:, None, :]
        return (first - second)[:, None], jac


@dataclass(frozen=True)
class VerticalAngles(_Angles):
    """Vertical angles above the horizon, atan2(h, p), or from the zenith, pi/2 - atan2(h, p).

    With h = z - bend p2 the target is lower by the curvature of the earth, less refraction. The
    derivatives by `end` are (a x / p, a y / p, p / s2), with a = -h / s2 - 2 bend p2 / s2 and s2 =
    p2 + h2; zenith angles have the opposite sign.

    Parameters
    ----------
    value, sd : ndarray, shape (n,)
        rad.
    start, end : ndarray of int, shape (n,)
        Points.
    zenith : bool
        True: counted from the zenith.
    bend_per_m : float
        (1 - k) / (2 R) with the coefficient of refraction k, 1/m; 0: neither curvature nor
        refraction.
    rise_m : ndarray, shape (n,), optional
        m.
    """

    zenith: bool = field(default=False, kw_only=True)
    bend_per_m: float = field(default=0.0, kw_only=True)

    kind = "vertical angle"

    def computed(self, state, derivatives):
        """The angles (n, 1)."""
        x, y, z = self.line(state)
        p2 = x * x + y * y
        # Curvature lowers the target by bend p^2.
        p, z = np.sqrt(p2), z - self.bend_per_m * p2
        s2 = p2 + z * z
        value = np.arctan2(z, p)
        # Derivatives of atan2(h, p) by z and p; h depends on p through the curvature.
        of_z, of_p = p / s2, -z / s2 - 2 * self.bend_per_m * p2 / s2
        sign = -1.0 if self.zenith else 1.0
        computed = (np.pi / 2 - value if self.zenith else value)[:, None]
        if not derivatives:
            return computed, None
        return computed, sign * self.of_ends(np.stack([of_p * x / p, of_p * y / p, of_z]))
