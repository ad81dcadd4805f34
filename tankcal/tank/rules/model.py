"""What a decision rule says: limits of the expanded uncertainty, limits of a deviation."""

from dataclasses import dataclass

TANKS = (
    "vertical_fixed_roof",
    "vertical_floating_roof",
    "horizontal",
    "inclined",
    "sphere",
    "other",
)
UNCERTAINTY_OF = ("volumes", "capacity", "deliveries")
DEVIATION_OF = ("volumes", "capacity", "deliveries")
RELATIVE_TO = ("itself", "capacity")
SIDES = ("both", "upper", "lower")
GUARDS = ("none", "U")
PERIOD_OF = ("all", "bottom_course")


@dataclass(frozen=True)
class UncertaintyLimit:
    """A limit of the expanded uncertainty U.

    Attributes
    ----------
    name : str
        As the file names it.
    tanks : tuple of str
        Kinds it is for; (): all.
    of : str
        "volumes": of every row; "capacity": of the highest row; "deliveries": of all of at least
        minimum_height_m.
    limit : float or None
        U over what `relative_to` names; None: U is to be stated, nothing is limited.
    relative_to : str
        "itself": the row, the capacity, the delivered volume; "capacity".
    minimum_height_m : float or None
        Of a delivery; None for the others.
    clause : str
        Where it stands.
    verified : bool
        Whether it was read there.
    """

    name: str
    tanks: tuple[str, ...]
    of: str
    limit: float | None
    relative_to: str
    minimum_height_m: float | None
    clause: str
    verified: bool


@dataclass(frozen=True)
class DeviationLimit:
    """A limit of the deviation of a volume from a stated one.

    Attributes
    ----------
    of : str
        "volumes": at any dip; "capacity": of the highest row; "deliveries".
    limit : float or None
        Part of the stated volume.
    limit_m3 : float or None
        Or an amount; one of them is None.
    side : str
        "both", "upper": only larger volumes are limited, "lower": only smaller ones.
    guard : str
        "none": accepted up to the limit; "U": up to the limit less U (JCGM 106:2012 8.3.2).
    name, tanks, clause, verified
        As of an UncertaintyLimit.
    """

    name: str
    tanks: tuple[str, ...]
    of: str
    limit: float | None
    limit_m3: float | None
    side: str
    guard: str
    clause: str
    verified: bool


@dataclass(frozen=True)
class ReferenceHeightLimit:
    """How far the reference height may be from the former one.

    Attributes
    ----------
    limit_m : float
    name, tanks, clause, verified
        As of an UncertaintyLimit.
    """

    name: str
    tanks: tuple[str, ...]
    limit_m: float
    clause: str
    verified: bool


@dataclass(frozen=True)
class Period:
    """How old a table may become.

    Attributes
    ----------
    of : str
        "all": the whole tank; "bottom_course": its lowest course.
    years : float
    name, tanks, clause, verified
        As of an UncertaintyLimit.
    """

    name: str
    tanks: tuple[str, ...]
    of: str
    years: float
    clause: str
    verified: bool


@dataclass(frozen=True)
class Rule:
    """One jurisdiction's decision rule.

    Attributes
    ----------
    source : str
        Where the values were read.
    verified : bool
        All of them in the text itself.
    remark : str
        What is to stand beside it; "": nothing.
    largest_capacity_m3 : float or None
        Tanks up to which it is for; None: all.
    uncertainty, deviation
        Its limits of one table.
    reference_height, periods
        What it says of a new table beside a former one, besides the deviation.
    """

    name: str
    source: str
    verified: bool
    remark: str
    largest_capacity_m3: float | None
    uncertainty: tuple[UncertaintyLimit, ...]
    deviation: tuple[DeviationLimit, ...]
    reference_height: tuple[ReferenceHeightLimit, ...] = ()
    periods: tuple[Period, ...] = ()

    @property
    def limits(self):
        """All of its limits."""
        return (*self.uncertainty, *self.deviation, *self.reference_height, *self.periods)
