"""Control coordinates, height differences, plumb lines, vectors, and weighted unknowns.

Correlated observations, which enter the adjustment as a single observation.

Values l with covariance Q = L L' are whitened together: L^-1 (computed - observed) has covariance
I, as have the rows in the solver. Source: Koch 1999, section 3.2.
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
