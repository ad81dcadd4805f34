"""What every kind of observation has, and the unknowns that it may speak about.

A kind is a frozen table of n observations with m values each. It knows how to compute them from a
State and their derivatives; it knows no solver. `fill` writes (computed - observed) / sd and the
derivatives over the sd, `columns` says to which unknowns these belong.
"""

from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from tankcal.errors import SolutionError
from tankcal.geometry.rotations import apply_small_rotation
from tankcal.messages import message
from tankcal.survey.observations.trace import Trace


@dataclass(frozen=True)
class State:
    """Values of all unknowns; coordinates are relative to the survey's centre.

    Attributes
    ----------
    xyz_m : ndarray, shape (points, 3)
    photo_xyz_m : ndarray, shape (photos, 3)
        Projection centres.
    rotation : ndarray, shape (photos, 3, 3)
        R3(kappa) R2(phi) R1(omega).
    interior : ndarray, shape (q + 1,)
        Interior parameters, mm; the last is 0, for those left out.
    nuisance : dict
        Values (k,) of each name of NUISANCES: "scale" and "offset_m" of instruments (reading = true
        (1 + scale) + offset), "orientation_rad" of direction sets (azimuth of the circle's zero).
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
    """Column of each unknown in the adjustment, -1 where it is fixed or left out.

    Attributes
    ----------
    points : ndarray of int, shape (points, 3)
    photos : ndarray of int, shape (photos, 6)
    interior : ndarray of int, shape (q + 1,)
    nuisance : dict
        Of each name of NUISANCES, ndarray of int, shape (k,).
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
        named = (one for one in vars(self).values() if isinstance(one, np.ndarray))
        return 1 + max(one.max(initial=-1) for one in (*named, *self.nuisance.values()))

    def moved(self, state, step):
        """The state after a step (unknowns,); rotations are turned, everything else is added."""
        step = np.append(step, 0.0)  # column -1, the fixed ones, does not move
        photos = step[self.photos]
        changes = {"xyz_m": state.xyz_m + step[self.points]}
        if len(photos):
            changes["photo_xyz_m"] = state.photo_xyz_m + photos[:, :3]
            changes["rotation"] = apply_small_rotation(state.rotation, photos[:, 3:])
            changes["interior"] = state.interior + step[self.interior]
        changes["nuisance"] = {
            of: value + step[self.nuisance[of]] if len(value) else value
            for of, value in state.nuisance.items()
        }
        if len(self.system):
            system = step[self.system]
            changes["system"] = apply_small_rotation(state.system, system[:, :3])
            changes["system_shift_m"] = state.system_shift_m + system[:, 3:6]
            changes["system_scale"] = state.system_scale + system[:, 6]
        return State(**(vars(state) | changes))


@dataclass(frozen=True)
class Observations:
    """Observations of one kind; subclasses add what they tie together.

    Attributes
    ----------
    value : ndarray, shape (n,)
        Or (n, m) observed.
    sd : ndarray
        Like value, standard deviations.
    use : ndarray, shape (n,)
        Share with which each takes part: 1, 0 when set aside, between for robust starts.
    trace : Trace
        Which readings they were made of; None: of none that a user gave.
    """

    value: np.ndarray
    sd: np.ndarray
    use: np.ndarray = field(default=None, kw_only=True)
    trace: Trace = field(default=None, kw_only=True, repr=False)

    kind = "observation"
    unit = "m"
    rows = 1
    feels_datum = True  # False: no motion or scale of the whole survey changes it
    ties = ()  # names of the fields that hold points
    nuisances = ()  # pairs: a name of NUISANCES, the field with each row's number; -1: none
    axes = (0, 1, 2)  # of the points' coordinates that enter: x, y, z
    places_points = False  # True: from one end that is known it tells where the other may be
    knows_frame = False  # True: it has `off_frame(d)`, its misfits, m, of differences (n, 3)
    of_survey = True  # False: it speaks of points in another frame, and measures none
    shared = ()  # names of the arrays that hold for the whole table; all others have n rows

    def __len__(self):
        return len(self.value)

    @cached_property
    def weight(self):
        """(n, m) what misclosures are multiplied by: root of `use`, over the sd."""
        weight = 1.0 / np.asarray(self.sd, dtype=float).reshape(len(self), self.rows)
        return weight if self.use is None else weight * np.sqrt(self.use)[:, None]

    @property
    def in_use(self):
        """(n,) True for those that take part."""
        return np.ones(len(self), dtype=bool) if self.use is None else np.asarray(self.use) > 0

    def of_used(self, name):
        """The field of that name, of those that take part."""
        field = getattr(self, name)
        return field if self.use is None else field[self.in_use]

    @property
    def exact(self):
        """(n,) True for those that hold exactly: sd 0; SolutionError when only a part of one."""
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
        """Observations with sd 0, to be filled without an sd, and which each row is of (k,)."""
        return replace(self, sd=np.ones(np.shape(self.value)), use=None), np.arange(len(self))

    def lever(self, state):
        """(n, m) change of a condition over that of its observation."""
        return np.ones((len(self), self.rows))

    def relative(self, centre):
        """The same for coordinates that count from a centre (3,)."""
        return self

    def without_derivatives(self, state):
        """(n,) True where no derivative exists: both ends of a sight are at one place."""
        return np.zeros(len(self), dtype=bool)

    def taken(self, keep, **changes):
        """The observations `keep` (indices, a mask or a slice), other fields changed."""
        if not isinstance(keep, slice):
            keep = np.asarray(keep)
            keep = keep.nonzero()[0] if keep.dtype == bool else keep
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
        """The same observations, each with its share (n,)."""
        return replace(self, use=np.asarray(use, dtype=float))

    def columns(self, layout):
        """(n, K) column of the unknown of each derivative, -1 where it is fixed.

        Three of each point of `ties`, one of each of `nuisances`.
        """
        points = [layout.points[getattr(self, name)] for name in self.ties]
        others = (one[:, None] for one in self._each(layout.nuisance, -1))
        return np.concatenate([*points, *others], axis=1)

    def nuisance(self, state):
        """Values (n,) of each of `nuisances`; 0 where a row has none."""
        return self._each(state.nuisance, 0.0)

    def _each(self, of_all, none):
        found = []
        for of, number in self.nuisances:
            values = of_all.get(of, ())
            there = np.append(values, none) if len(values) else np.array([none])
            found.append(there[getattr(self, number)])
        return found

    def computed(self, state, derivatives):
        """Computed values (n, m) and, if asked for, derivatives (n, m, K)."""
        raise NotImplementedError

    def undisturbed(self, state):
        """The state in which misclosures that would feel a motion falsely are zero."""
        return state

    def difference(self, computed):
        """Computed minus observed (n, m)."""
        return computed - np.asarray(self.value).reshape(computed.shape)

    def part(self, rows):
        """What fills some of the rows alone, a slice of them, see `fill`."""
        return self.taken(rows, trace=None).fill

    def fill(self, state, w, jac):
        """Whitened misclosures into w (n, m), derivatives into jac (n, m, K) unless it is empty."""
        wanted = len(jac) > 0
        computed, derivatives = self.computed(state, wanted)
        np.multiply(self.difference(computed), self.weight, out=w)
        if wanted:
            np.multiply(derivatives, self.weight[:, :, None], out=jac)
