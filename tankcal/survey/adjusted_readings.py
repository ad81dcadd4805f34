"""What became of each reading in the adjustment: one `Reading`, and all of them by columns."""

from collections.abc import Sequence
from dataclasses import dataclass, fields

import numpy as np


@dataclass(frozen=True)
class Reading:
    """One value of one observation after the adjustment.

    Attributes
    ----------
    kind : str
        As the observations name it: "image coordinate", "distance", "direction", ...
    ids : tuple
        Names, such as ("photo 1", "215") or ("A", "B").
    element : str
        "x" or "y", "omega", ...; "" where there is only one.
    file, row
        Where it was read; of averaged readings the first row; "" and None: no file.
    repeats : int
        Readings that were averaged.
    unit : str
        Of value, residual, sd, mdb: "mm" (images), "m", "rad" or "" (weighted unknowns).
    value : float
        Observed, as adjusted (after averaging and corrections).
    residual : float
        Computed minus observed.
    sd : float
        A priori.
    redundancy : float
        0 to 1.
    w : float
        Baarda's test quantity.
    tau : float
        Pope's: w over sigma0 (nan: no redundancy).
    mdb : float
        Minimal detectable bias; inf: nothing controls it.
    effect_m : float
        Largest change of a point's coordinates by an undetected bias of that size; inf as well.
    removed : bool
        True: set aside by data snooping; residual and w are then those that it would have.
    check : bool
        True: it was only compared; w is then its difference over the sd of that.
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
    """A sequence of `Reading`, kept by columns: each is made when it is asked for.

    A survey may have 200 000; what looks at all of them looks at columns.

    Attributes
    ----------
    columns : dict
        {attribute of a Reading: its values, ndarray (n,)}: of floats, bool, whole numbers, or
        objects.

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
        """Those of some Reading rows."""
        return cls(
            {
                one.name: np.fromiter((getattr(row, one.name) for row in rows), _TYPES[one.type],
                                      len(rows))
                for one in fields(Reading)
            }
        )  # fmt: skip

    @classmethod
    def joined(cls, parts):
        """Those of some Readings, one after the other."""
        return cls(
            {
                one.name: np.concatenate([part.columns[one.name] for part in parts])
                for one in fields(Reading)
            }
        )

    def where(self, chosen):
        """The Readings that a mask, numbers or a slice choose."""
        return Readings({name: column[chosen] for name, column in self.columns.items()})

    @property
    def removed(self):
        """(n,) True: was set aside."""
        return self.columns["removed"]

    @property
    def check(self):
        """(n,) True: was only compared."""
        return self.columns["check"]

    @property
    def hold(self):
        """(n,) True: a value that holds exactly; it has no redundancy, but a reaction."""
        return (self.columns["sd"] == 0) & ~self.check & ~self.removed

    def are(self, *kinds):
        """(n,) whether they are of these kinds."""
        return np.isin(self.columns["kind"], kinds)

    def __len__(self):
        return len(self.check)

    def __getitem__(self, number):
        if isinstance(number, slice):
            return self.where(number)
        number = range(len(self))[number]
        return next(iter(self.where(slice(number, number + 1))))

    def __iter__(self):
        return map(Reading, *(column.tolist() for column in self.columns.values()))


_TYPES = {str: object, tuple: object, int | None: object, int: int, float: float, bool: bool}
