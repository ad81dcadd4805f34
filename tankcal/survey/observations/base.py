"""Base class of observations, and the unknowns of their equations.

NUISANCES are the unknowns besides points and photos. A further one requires a line there, values
and sds in `Survey.nuisances`, and a pair in `nuisances` of each class of observations that contains
it: its name, and the field with the number for each row. Layout, State, start values, names, a
priori sds and the datum follow from these.

Each kind of observation is a frozen table of n observations with m values each. It computes them
and their derivatives from a State and is independent of the solver. `fill` writes (computed -
observed) / sd and the derivatives over the sd; `columns` returns the unknowns of the derivatives.
"""

from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from tankcal.errors import SolutionError
from tankcal.geometry.rotations import apply_small_rotation
from tankcal.messages import message


@dataclass(frozen=True)
class Nuisance:
    """Properties of a name of NUISANCES.

    Attributes
    ----------
    element, unit : str
        Name and unit in messages.
    file : str
        File of its a priori value and sd.
    by_turn : float
        Change per rad of a rotation of the whole survey about Z.
    is_scale : bool
        True: a scaling of the whole survey divides 1 + value.
    """

    element: str
    unit: str
    file: str = ""
    by_turn: float = 0.0
    is_scale: bool = False

    def ways(self, value):
        """Derivatives (k, 7) of values (k,) by the seven motions of `network.datum`."""
        derivatives = np.zeros((len(value), 7))
        derivatives[:, 5] = self.by_turn
        if self.is_scale:
            derivatives[:, 6] = -(1.0 + value)
        return derivatives


NUISANCES = {
    "scale": Nuisance("scale", "", "instruments.toml", is_scale=True),
    "offset_m": Nuisance("offset", "m", "instruments.toml"),
    "orientation_rad": Nuisance("orientation", "rad", by_turn=-1.0),
}


@dataclass(frozen=True)
class State:
    """Values of all unknowns; coordinates are relative to the centre of the survey.

    Attributes
    ----------
    xyz_m : ndarray, shape (points, 3)
    photo_xyz_m : ndarray, shape (photos, 3)
        Projection centres.
    rotation : ndarray, shape (photos, 3, 3)
        R3(kappa) R2(phi) R1(omega).
    interior : ndarray, shape (q + 1,)
        Interior parameters, mm; the last is 0, for omitted parameters.
    nuisance : dict
        Values (k,) of each name of NUISANCES: "scale" and "offset_m" of instruments (reading = true
        (1 + scale) + offset), "orientation_rad" of direction sets (azimuth of the circle zero).
    system : ndarray, shape (systems, 3, 3)
        Rotations of further control systems.
    system_shift_m : ndarray, shape (systems, 3)
    system_scale : ndarray, shape (systems,)
        Scale minus one.
    """

    xyz_m: np.ndarray
    photo_xyz_m: np.ndarray = field(default_factory=lambda: np.zeros((0, 3)))
    rotation: np.ndarray = field(default_factory=lambda: np.zeros((0, 3, 3)))
    interior: np.ndarray = field(default_factory=lambda: np.zeros(1))
    nuisance: dict = field(default_factory=dict)
    system: np.ndarray = field(default_factory=lambda: np.zeros((0, 3, 3)))
    system_shift_m: np.ndarray = field(default_factory=lambda: np.zeros((0, 3)))
    system_scale: np.ndarray = field(default_factory=lambda: np.zeros(0))


@dataclass(frozen=True)
class Layout:
    """Column of each unknown in the adjustment, -1 for fixed or omitted unknowns.

    Attributes
    ----------
    points : ndarray of int, shape (points, 3)
    photos : ndarray of int, shape (photos, 6)
    interior : ndarray of int, shape (q + 1,)
    nuisance : dict
        {name of NUISANCES: ndarray of int, shape (k,)}.
    system : ndarray of int, shape (systems, 7)
        Rotation, shift, scale.
    """

    points: np.ndarray
    photos: np.ndarray
    interior: np.ndarray
    nuisance: dict
    system: np.ndarray

    @property
    def unknowns(self):
        """Number of unknowns."""
        arrays = (columns for columns in vars(self).values() if isinstance(columns, np.ndarray))
        return 1 + max(columns.max(initial=-1) for columns in (*arrays, *self.nuisance.values()))

    def moved(self, state, step):
        """The state after a step (unknowns,): rotations are multiplied, all other unknowns
        added."""
        step = np.append(step, 0.0)  # column -1, of fixed unknowns, does not move
        photos = step[self.photos]
        changes = {"xyz_m": state.xyz_m + step[self.points]}
        if len(photos):
            changes["photo_xyz_m"] = state.photo_xyz_m + photos[:, :3]
            changes["rotation"] = apply_small_rotation(state.rotation, photos[:, 3:])
            changes["interior"] = state.interior + step[self.interior]
        changes["nuisance"] = {
            name: value + step[self.nuisance[name]] if len(value) else value
            for name, value in state.nuisance.items()
        }
        if len(self.system):
            system = step[self.system]
            changes["system"] = apply_small_rotation(state.system, system[:, :3])
            changes["system_shift_m"] = state.system_shift_m + system[:, 3:6]
            changes["system_scale"] = state.system_scale + system[:, 6]
        return State(**(vars(state) | changes))


@dataclass(frozen=True)
class Source:
    """The N readings of a file, by the user's names.

    Attributes
    ----------
    file : str
    rows : tuple
        (N,) rows of the file; (): no rows.
    ids : tuple
        (N,) tuples of names.
    element : tuple
        (N,) tuples of value names: ("x", "y"); ("",) for a single value.
    group : tuple
        (N,) names of the groups whose standard deviations are tested together, "tape 1"; (): none.
    table : str
        As in `Readings`; "" for all other observations.
    """

    file: str
    rows: tuple
    ids: tuple
    element: tuple
    group: tuple = ()
    table: str = ""

    @cached_property
    def values(self):
        """Number (N,) of values of each reading."""
        return np.array([len(names) for names in self.element], dtype=int)

    def trace(self):
        """The Trace of observations that are these readings, without averaging."""
        n = len(self.ids)
        return Trace(self, np.arange(n), np.ones(n, dtype=int))


@dataclass(frozen=True)
class Trace:
    """Readings from which n observations were made; selected together with them.

    Attributes
    ----------
    source : Source
    reading : ndarray of int, shape (n,)
        Number in the source of the first reading of each observation.
    repeats : ndarray of int, shape (n,)
        Number of readings averaged.
    scatter : ndarray, shape (n,)
        Chi-square of the readings about their mean; None: no averaging.
    """

    source: Source
    reading: np.ndarray
    repeats: np.ndarray
    scatter: np.ndarray | None = None

    def taken(self, keep):
        """The Trace of selected observations (indices or a mask)."""
        scatter = None if self.scatter is None else self.scatter[keep]
        return Trace(self.source, self.reading[keep], self.repeats[keep], scatter)

    @property
    def file(self):
        """Name of the file."""
        return self.source.file

    @property
    def table(self):
        """See Source."""
        return self.source.table

    @cached_property
    def rows(self):
        """Row (n,) of the first reading of each observation, or None."""
        return self._each(self.source.rows, None)

    @cached_property
    def ids(self):
        """Tuples (n,) of names."""
        return self._each(self.source.ids)

    @cached_property
    def element(self):
        """Tuples (n,) of value names."""
        return self._each(self.source.element)

    @cached_property
    def group(self):
        """Names (n,) of groups."""
        return self._each(self.source.group, "")

    def _each(self, names, missing=None):
        """Names (n,) of the first reading of each observation."""
        if not names:
            return (missing,) * len(self.reading)
        return tuple(names[i] for i in self.reading.tolist())

    @property
    def repeated(self):
        """Chi-square (n,) and degrees of freedom (n,) of the averaged readings."""
        scatter = np.zeros(len(self.reading)) if self.scatter is None else self.scatter
        # k readings about their mean have k - 1 degrees of freedom per value.
        return scatter, (self.repeats - 1) * self.source.values[self.reading]


@dataclass(frozen=True)
class Observations:
    """Observations of one kind; subclasses add the points and other items that they connect.

    Attributes
    ----------
    value : ndarray, shape (n,) or (n, m)
        Observed values.
    sd : ndarray, like value
        Standard deviations.
    use : ndarray, shape (n,)
        Weight factor: 1, 0 if rejected, between for robust starts.
    trace : Trace
        Readings of the observations; None: no readings of a user.
    """

    value: np.ndarray
    sd: np.ndarray
    use: np.ndarray = field(default=None, kw_only=True)
    trace: Trace = field(default=None, kw_only=True, repr=False)

    kind = "observation"
    unit = "m"
    rows = 1
    feels_datum = True  # False: invariant under motions and scale of the whole survey
    ties = ()  # names of the fields that contain points
    nuisances = ()  # pairs: a name of NUISANCES, the field with the number for each row; -1: none
    axes = (0, 1, 2)  # coordinates of the points in the equation: x, y, z
    places_points = False  # True: determines the position of one end from the other
    knows_frame = False  # True: has `off_frame(d)`, misfits, m, of differences (n, 3)
    of_survey = True  # False: refers to another frame and measures no point
    shared = ()  # names of the arrays of the whole table; all others have n rows

    def __len__(self):
        return len(self.value)

    @cached_property
    def weight(self):
        """Factors (n, m) of the misclosures: root of `use`, over the sd."""
        weight = 1.0 / np.asarray(self.sd, dtype=float).reshape(len(self), self.rows)
        return weight if self.use is None else weight * np.sqrt(self.use)[:, None]

    @property
    def in_use(self):
        """Mask (n,), True where not rejected."""
        return np.ones(len(self), dtype=bool) if self.use is None else np.asarray(self.use) > 0

    def of_used(self, name):
        """The field of a name, without rejected rows."""
        field = getattr(self, name)
        return field if self.use is None else field[self.in_use]

    @property
    def exact(self):
        """Mask (n,) of exact observations (sd 0).

        Raises
        ------
        SolutionError
            If only some values of an observation have sd 0.
        """
        zero = np.reshape(self.sd, (len(self), self.rows)) == 0
        if not zero.any():
            return np.zeros(len(self), dtype=bool)
        exact = zero.all(axis=1)
        if (zero.any(axis=1) & ~exact).any():
            raise SolutionError(
                message(
                    "exact_in_part",
                    "{kind}: all its values hold exactly (sd 0) or none",
                    kind=self.kind,
                )
            )
        return exact

    def conditions(self):
        """Exact observations as conditions without sd, and the observation number (k,) of each
        row."""
        # Conditions have no weight: the unit sd leaves the equation unscaled.
        return replace(self, sd=np.ones(np.shape(self.value)), use=None), np.arange(len(self))

    def lever(self, state):
        """Change (n, m) of a condition per change of its observation."""
        return np.ones((len(self), self.rows))

    def relative(self, centre):
        """The observations with coordinates relative to a centre (3,)."""
        return self

    def without_derivatives(self, state):
        """Mask (n,), True where no derivative exists because both ends of a sight coincide."""
        return np.zeros(len(self), dtype=bool)

    def taken(self, keep, **changes):
        """Select observations by indices, a mask or a slice, and change other fields."""
        if not isinstance(keep, slice):
            keep = np.asarray(keep)
            keep = keep.nonzero()[0] if keep.dtype == bool else keep
        # Only fields with one row per observation are indexed; cached arrays are not fields.
        parts = {
            name: value[keep] if isinstance(keep, slice) else value.take(keep, axis=0)
            for name, value in vars(self).items()
            if isinstance(value, np.ndarray)
            and name in self.__dataclass_fields__
            and name not in self.shared
        }
        if self.trace is not None and "trace" not in changes:
            parts["trace"] = self.trace.taken(keep)
        return replace(self, **parts, **changes)

    def using(self, use):
        """The observations with weight factors (n,)."""
        return replace(self, use=np.asarray(use, dtype=float))

    def columns(self, layout):
        """Column (n, K) of the unknown of each derivative, -1 for fixed unknowns.

        Three for each point of `ties`, followed by one for each of `nuisances`.
        """
        points = [layout.points[getattr(self, name)] for name in self.ties]
        shared_columns = (numbers[:, None] for numbers in self._each(layout.nuisance, -1))
        return np.concatenate([*points, *shared_columns], axis=1)

    def nuisance(self, state):
        """Values (n,) of each of `nuisances`; 0 for rows without one."""
        return self._each(state.nuisance, 0.0)

    def _each(self, by_name, none):
        """Values or columns (n,) of each of `nuisances`, or `none` for rows without one."""
        columns = []
        for name, number in self.nuisances:
            values = by_name.get(name, ())
            # The appended value is selected by number -1.
            padded = np.append(values, none) if len(values) else np.array([none])
            columns.append(padded[getattr(self, number)])
        return columns

    def computed(self, state, derivatives):
        """Computed values (n, m) and, if requested, derivatives (n, m, K)."""
        raise NotImplementedError

    def undisturbed(self, state):
        """The state with zero misclosures for observations that would otherwise respond to a
        motion."""
        return state

    def difference(self, computed):
        """Computed minus observed (n, m)."""
        return computed - np.asarray(self.value).reshape(computed.shape)

    def part(self, rows):
        """The `fill` method for a slice of the rows."""
        return self.taken(rows, trace=None).fill

    def fill(self, state, w, jac):
        """Write whitened misclosures to w (n, m) and derivatives to jac (n, m, K) unless it is
        empty."""
        with_derivatives = len(jac) > 0
        computed, derivatives = self.computed(state, with_derivatives)
        # Whitening: division by the sd gives rows with unit variance.
        np.multiply(self.difference(computed), self.weight, out=w)
        if with_derivatives:
            np.multiply(derivatives, self.weight[:, :, None], out=jac)
