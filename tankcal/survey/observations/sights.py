"""Observations of coordinates, heights, plumb lines, distances, angles and directions.

Correlated observations, which enter the adjustment as a single observation.

Values l with covariance Q = L L' are whitened together: L^-1 (computed - observed) has covariance
I, as have the rows in the solver. Source: Koch 1999, section 3.2.

Distances, angles and directions between points: tapes, levels, theodolites, total stations.

From `start` (plus height of the instrument) to `end` (plus height of the target), with (x, y, z)
the difference, p2 = x2 + y2 and s2 = p2 + z2:

    azimuth atan2(x, y)     height angle atan2(z, p)     zenith angle pi/2 - that     distance s

Azimuths are clockwise from +y. Derivatives by `start` are the negative derivatives by `end`.
"""

from dataclasses import dataclass, field, replace

import numpy as np
import scipy.linalg

from tankcal.survey.observations.base import NUISANCES, Observations

_UNITS = np.eye(3)  # derivatives of a coordinate by x, y, z


@dataclass(frozen=True)
class ControlCoordinates(Observations):
    """Single control coordinates (n,), m, relative to the centre.

    Attributes
    ----------
    point : ndarray, shape (n,)
    axis : ndarray, shape (n,)
        0 x, 1 y, 2 z.
    """

    point: np.ndarray
    axis: np.ndarray

    kind, ties = "control coordinate", ("point",)

    def computed(self, state, derivatives):
        """The coordinates (n, 1)."""
        computed = state.xyz_m[self.point, self.axis, None]
        return computed, _UNITS[self.axis, None] if derivatives else None

    def relative(self, centre):
        """The observations with coordinates relative to a centre (3,)."""
        return replace(self, value=self.value - centre[self.axis])


@dataclass(frozen=True)
class SystemCoordinates(Observations):
    """Control coordinates (n,), m, in a further system with a transformation of its own.

        X_system = (1 + scale) R_system X + shift

    Attributes
    ----------
    point, axis : ndarray, shape (n,)
        As in ControlCoordinates.
    system : ndarray, shape (n,)
    """

    point: np.ndarray
    axis: np.ndarray
    system: np.ndarray

    kind, ties, of_survey = "control coordinate of a further system", ("point",), False

    def columns(self, layout):
        """Columns of point (3), system (rotation 3, shift 3, scale)."""
        return np.hstack([super().columns(layout), layout.system[self.system]])

    def computed(self, state, derivatives):
        """The coordinates (n, 1)."""
        rotation, m = state.system[self.system], 1.0 + state.system_scale[self.system]
        turned = np.einsum("nij,nj->ni", rotation, state.xyz_m[self.point])
        rows = np.arange(len(self))
        all_three = m[:, None] * turned + state.system_shift_m[self.system]
        if not derivatives:
            return all_three[rows, self.axis, None], None
        jac = np.zeros((len(self), 3, 10))
        jac[:, :, :3] = m[:, None, None] * rotation
        # A small rotation w moves the rotated vector r by w x r.
        x, y, z = (m[:, None] * turned).T
        jac[:, 0, 4], jac[:, 0, 5] = z, -y
        jac[:, 1, 3], jac[:, 1, 5] = -z, x
        jac[:, 2, 3], jac[:, 2, 4] = y, -x
        jac[:, :, 6:9] = np.eye(3)
        # The derivative by the scale is the rotated vector itself.
        jac[:, :, 9] = turned
        return all_three[rows, self.axis, None], jac[rows, self.axis][:, None, :]


@dataclass(frozen=True)
class _Differences(Observations):
    """Differences of coordinates of two points."""

    start: np.ndarray
    end: np.ndarray

    ties = ("start", "end")

    def columns(self, layout):
        """Columns of point end (3), point start (3)."""
        return np.hstack([layout.points[self.end], layout.points[self.start]])


@dataclass(frozen=True)
class HeightDifferences(_Differences):
    """Height differences: z of `end` minus z of `start`; derivatives 1 and -1.

    Parameters
    ----------
    value, sd : ndarray, shape (n,)
        m.
    start, end : ndarray of int, shape (n,)
        Points.
    """

    kind, axes, places_points = "height difference", (2,), True
    knows_frame = True

    def computed(self, state, derivatives):
        """The differences (n, 1)."""
        computed = state.xyz_m[self.end, 2:] - state.xyz_m[self.start, 2:]
        # Derivatives by x, y, z of end, then of start.
        row = np.array([0.0, 0, 1, 0, 0, -1])
        return computed, np.tile(row, (len(self), 1, 1)) if derivatives else None

    def off_frame(self, d):
        """Misfits in metres, a list of (n,), from differences d (n, 3) of the ends."""
        return [d[:, 2] - self.value]


@dataclass(frozen=True)
class PlumbLines(_Differences):
    """Pairs of points on a vertical: x and y of `end` and `start` are equal.

    Parameters
    ----------
    value, sd : ndarray, shape (n, 2)
        Zeros, and the sd in x and in y, m.
    start, end : ndarray of int, shape (n,)
        Points.
    """

    kind, rows, axes, knows_frame = "plumb line", 2, (0, 1), True

    def computed(self, state, derivatives):
        """Differences in x and y (n, 2)."""
        computed = state.xyz_m[self.end, :2] - state.xyz_m[self.start, :2]
        # Only x and y enter: first two rows of I and -I.
        rows = np.hstack([np.eye(2, 3), -np.eye(2, 3)])
        return computed, np.tile(rows, (len(self), 1, 1)) if derivatives else None

    def off_frame(self, d):
        """Misfits in metres, a list of (n,), from differences d (n, 3) of the ends."""
        return [d[:, 0], d[:, 1]]

    def undisturbed(self, state):
        """The state with vertical plumb lines: an oblique one would seem to determine the
        azimuth."""
        xyz = state.xyz_m.copy()
        xyz[self.end, :2] = xyz[self.start, :2]
        return replace(state, xyz_m=xyz)


@dataclass(frozen=True)
class Vectors(_Differences):
    """Vectors from `start` to `end` in the axes of the survey: GNSS baselines; derivatives +-I.

    Parameters
    ----------
    value, sd : ndarray, shape (n, 3)
        m.
    start, end : ndarray of int, shape (n,)
        Points.
    """

    kind, rows, places_points = "vector", 3, True

    def computed(self, state, derivatives):
        """Differences in x, y and z (n, 3)."""
        computed = state.xyz_m[self.end] - state.xyz_m[self.start]
        rows = np.hstack([np.eye(3), -np.eye(3)])
        return computed, np.tile(rows, (len(self), 1, 1)) if derivatives else None


@dataclass(frozen=True)
class KnownUnknowns(Observations):
    """Unknowns with an a priori value and sd: interior parameters, scales, offsets.

    Attributes
    ----------
    of : str
        "interior" or "system_scale", fields of State, or a name of NUISANCES.
    index : ndarray, shape (n,)
        Index in that field.
    """

    of: str
    index: np.ndarray

    kind, unit = "weighted unknown", "its own"

    def columns(self, layout):
        """Column of the unknown."""
        if self.of == "system_scale":
            return layout.system[self.index, 6:]
        columns = layout.interior if self.of == "interior" else layout.nuisance[self.of]
        return columns[self.index, None]

    def computed(self, state, derivatives):
        """The values (n, 1)."""
        values = state.nuisance[self.of] if self.of in NUISANCES else getattr(state, self.of)
        return values[self.index, None], np.ones((len(self), 1, 1)) if derivatives else None


# ---- correlated observations, which enter the adjustment as a single observation


@dataclass(frozen=True)
class Block:
    """Correlated values of a survey.

    Attributes
    ----------
    source, row, component : ndarray, shape (m,)
        Number of the table in Survey.observations, row, and value in the row.
    covariance : ndarray, shape (m, m)
    """

    source: np.ndarray
    row: np.ndarray
    component: np.ndarray
    covariance: np.ndarray


@dataclass(frozen=True)
class Correlated(Observations):
    """One observation of m correlated values; value and sd (1, m) are zeros and ones.

    Attributes
    ----------
    parts : tuple
        Pairs (observations of one kind, component (k,) of each), m in all.
    covariance : ndarray, shape (m, m)
    all_of : Layout
        Layout in which each unknown, fixed or not, has its own number.
    """

    parts: tuple
    covariance: np.ndarray
    all_of: object = field(repr=False)

    kind, shared = "correlated observations", ("covariance",)

    def __post_init__(self):
        slots = [observations.columns(self.all_of) for observations, _ in self.parts]
        # Several values share unknowns: each unknown has one column in the block.
        _, first, place = np.unique(
            np.concatenate([part.ravel() for part in slots]), return_index=True, return_inverse=True
        )
        cuts = np.cumsum([part.size for part in slots])[:-1]
        places = [
            places_of_part.reshape(part.shape)
            for places_of_part, part in zip(np.split(place.ravel(), cuts), slots, strict=True)
        ]
        object.__setattr__(self, "_first", first)
        object.__setattr__(self, "_places", places)
        object.__setattr__(self, "_root", np.linalg.cholesky(self.covariance))

    @property
    def rows(self):
        """Number of values, m."""
        return len(self.covariance)

    def columns(self, layout):
        """Columns (1, K) of the unknowns of all values."""
        columns = [observations.columns(layout).ravel() for observations, _ in self.parts]
        return np.concatenate(columns)[self._first][None]

    def whitened(self, values):
        """L^-1 times values (m, ...)."""
        # Solving with L is more accurate than multiplying by its inverse.
        return scipy.linalg.solve_triangular(self._root, values, lower=True)

    def linearised(self, state):
        """Misclosures (m,) and derivatives (m, K), not whitened."""
        off, jac = [], []
        for (observations, component), places in zip(self.parts, self._places, strict=True):
            rows = np.arange(len(observations))
            computed, derivatives = observations.computed(state, True)
            off.append(observations.difference(computed)[rows, component])
            rows_of_part = np.zeros((len(observations), len(self._first)))
            np.add.at(rows_of_part, (rows[:, None], places), derivatives[rows, component])
            jac.append(rows_of_part)
        return np.concatenate(off), np.vstack(jac)

    def fill(self, state, w, jac):
        """Write whitened misclosures to w (1, m) and derivatives to jac (1, m, K) unless it is
        empty."""
        off, derivatives = self.linearised(state)
        w[0] = self.whitened(off)
        if len(jac):
            jac[0] = self.whitened(derivatives)


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
