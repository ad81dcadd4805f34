"""State of each reading after the adjustment: one `Reading`, and all readings as columns."""

from collections.abc import Sequence
from dataclasses import dataclass, fields

import numpy as np


@dataclass(frozen=True)
class Reading:
    """One value of one observation after the adjustment.

    Attributes
    ----------
    kind : str
        Kind of observation: "image coordinate", "distance", "direction", ...
    ids : tuple
        Names, such as ("photo 1", "215") or ("A", "B").
    element : str
        "x" or "y", "omega", ...; "" where the observation has a single value.
    file, row
        File and row of the reading; the first row of averaged readings; "" and None without a file.
    repeats : int
        Number of readings averaged.
    unit : str
        Unit of value, residual, sd and mdb: "mm" (images), "m", "rad" or "" (weighted unknowns).
    value : float
        Observed value as adjusted (after averaging and corrections).
    residual : float
        Computed minus observed.
    sd : float
        A priori standard deviation.
    redundancy : float
        Redundancy number, 0 to 1.
    w : float
        Baarda's test statistic.
    tau : float
        Pope's test statistic, w over sigma0 (nan: no redundancy).
    mdb : float
        Minimal detectable bias; inf: the reading is not controlled.
    effect_m : float
        Largest change of a point's coordinates caused by an undetected bias of size mdb, m; inf
        where mdb is inf.
    removed : bool
        True: rejected by data snooping; residual and w are then predicted from the other readings.
    check : bool
        True: compared only; w is then the difference over its standard deviation.
    """

    kind: str
    ids: tuple
    element: str
    file: str
    row: int | None
    repeats: int
    unit: str
    value: float
    residual: float
    sd: float
    redundancy: float
    w: float
    tau: float
    mdb: float
    effect_m: float
    removed: bool = False
    check: bool = False


class Readings(Sequence):
    """Sequence of `Reading`, stored as columns; each `Reading` is created on access.

    A survey may have 200 000 readings, so code that examines all of them uses the columns.

    Attributes
    ----------
    columns : dict
        {attribute of a Reading: its values, ndarray (n,)} of floats, bool, integers or objects.

    Examples
    --------
    >>> one = Reading("distance", ("A", "B"), "", "distances.csv", 2, 1, "m", 8.5, *[0.0] * 7)
    >>> readings = Readings.of([one])
    >>> readings.columns["value"], readings[0] == one, len(readings.where(readings.removed))
    (array([8.5]), True, 0)
    """

    def __init__(self, columns):
        self.columns = columns

    @classmethod
    def of(cls, rows):
        """Create `Readings` from a sequence of `Reading`."""
        return cls(
            {
                item.name: np.fromiter((getattr(row, item.name) for row in rows), _TYPES[item.type],
                                       len(rows))
                for item in fields(Reading)
            }
        )  # fmt: skip

    @classmethod
    def joined(cls, parts):
        """Concatenate several `Readings`."""
        return cls(
            {
                attribute.name: np.concatenate([part.columns[attribute.name] for part in parts])
                for attribute in fields(Reading)
            }
        )

    def where(self, selection):
        """Select `Readings` by a mask, indices or a slice."""
        return Readings({name: column[selection] for name, column in self.columns.items()})

    @property
    def removed(self):
        """Mask (n,), True where the reading was rejected."""
        return self.columns["removed"]

    @property
    def check(self):
        """Mask (n,), True where the reading was compared only."""
        return self.columns["check"]

    @property
    def hold(self):
        """Mask (n,), True for values held exactly; these have no redundancy, but a reaction."""
        return (self.columns["sd"] == 0) & ~self.check & ~self.removed

    def are(self, *kinds):
        """Mask (n,), True for readings of the given kinds."""
        return np.isin(self.columns["kind"], kinds)

    def __len__(self):
        return len(self.check)

    def __getitem__(self, number):
        if isinstance(number, slice):
            return self.where(number)
        # range() resolves negative numbers and raises IndexError beyond the end.
        number = range(len(self))[number]
        return next(iter(self.where(slice(number, number + 1))))

    def __iter__(self):
        return map(Reading, *(column.tolist() for column in self.columns.values()))


_TYPES = {str: object, tuple: object, int | None: object, int: int, float: float, bool: bool}
