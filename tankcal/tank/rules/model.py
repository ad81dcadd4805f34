"""Data model of a decision rule: limits of the expanded uncertainty, limits of a deviation.

`PrintedU` holds printed expanded uncertainties, where they differ from those of the table.
"""

from dataclasses import dataclass, field, replace

import numpy as np

from tankcal.gum.conformity import Limit, RuleSet

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
FROM_LEVEL = ("lower_accurate",)
PERIOD_OF = ("all", "bottom_course")
PLATE = (  # entries of the identification plate of a tank
    *("laboratory", "tank_id", "certificate_number", "certificate_number_and_year"),
    *("survey_date", "date_of_issue", "nominal_volume", "capacity", "zero"),
    *("reference_height", "reference_temperature"),
)
LAYOUT = {  # layouts of a capacity table: key of [table] and its value
    "centimetres": ("heights_in", "cm"),
    "litres": ("volume_unit", "L"),
    "ullages": ("ullage", True),
}


@dataclass(frozen=True, kw_only=True)
class TankLimit(Limit):
    """Limit for some kinds of tank; (): for all."""

    tanks: tuple[str, ...]

    def applies_to(self, tank):
        """Whether the limit applies to a kind of tank."""
        return not self.tanks or tank in self.tanks


@dataclass(frozen=True, kw_only=True)
class UncertaintyLimit(TankLimit):
    """Limit of the expanded uncertainty U.

    Attributes
    ----------
    of : str
        "volumes": every row; "capacity": the highest row; "deliveries": all deliveries of at least
        minimum_height_m.
    limit : float or None
        Limit of U over the quantity in `relative_to`; None: U is to be stated, without limit.
    relative_to : str
        "itself": the row, the capacity, the delivered volume; "capacity".
    minimum_height_m : float or None
        Least height of a delivery; None for other limits.
    from_level : str or None
        "lower_accurate": the limit is valid from the lower limit of accurate capacity, the level
        from which all rows meet it and which the certificate states; None: everywhere.
    name, tanks, clause, verified
        As for a TankLimit.
    """

    of: str
    limit: float | None
    relative_to: str
    minimum_height_m: float | None
    from_level: str | None = None


@dataclass(frozen=True, kw_only=True)
class DeviationLimit(TankLimit):
    """Limit of the deviation of a volume from a stated volume.

    Attributes
    ----------
    of : str
        "volumes": at any dip; "capacity": of the highest row; "deliveries".
    limit : float or None
        Fraction of the stated volume.
    limit_m3 : float or None
        Absolute limit; one of limit and limit_m3 is None.
    side : str
        "both"; "upper": only larger volumes are limited; "lower": only smaller volumes.
    guard : str
        "none": accepted up to the limit; "U": up to the limit less U (JCGM 106:2012 8.3.2).
    in_service_factor : float
        Factor of the limit for a table in use, such as 2 for twice the limit of verification.
    name, tanks, clause, verified
        As for a TankLimit.
    """

    of: str
    limit: float | None
    limit_m3: float | None
    side: str
    guard: str
    in_service_factor: float = 1.0

    def in_service(self):
        """Return the limit for a table in use."""
        factor, limits = self.in_service_factor, (self.limit, self.limit_m3)
        limit, limit_m3 = (None if value is None else factor * value for value in limits)
        return replace(self, limit=limit, limit_m3=limit_m3, in_service_factor=1.0)


@dataclass(frozen=True, kw_only=True)
class ReferenceHeightLimit(TankLimit):
    """Limit of the change of the reference height since the previous calibration.

    Attributes
    ----------
    limit_m : float
    name, tanks, clause, verified
        As for a TankLimit.
    """

    limit_m: float


@dataclass(frozen=True, kw_only=True)
class Period(TankLimit):
    """Period of validity of a table.

    Attributes
    ----------
    of : str
        "all": the whole tank; "bottom_course": its lowest course.
    years : float
    name, tanks, clause, verified
        As for a TankLimit.
    """

    of: str
    years: float


@dataclass(frozen=True, kw_only=True)
class Rule(RuleSet):
    """Decision rule of a jurisdiction.

    Attributes
    ----------
    largest_capacity_m3 : float or None
        Largest capacity to which the rule applies; None: no limit.
    uncertainty, deviation
        Limits of a table.
    reference_height, periods
        Additional limits of a new table relative to the previous table.
    statements : tuple of str
        Sentences that the rule requires in a certificate, in the language of the rule.
    plate : tuple of str
        Entries of the identification plate, some of PLATE, in their order.
    layout : tuple of str
        Layouts that the rule requires of the table, some of LAYOUT.
    name, source, verified, remark
        As for a RuleSet.
    """

    largest_capacity_m3: float | None
    uncertainty: tuple[UncertaintyLimit, ...]
    deviation: tuple[DeviationLimit, ...]
    reference_height: tuple[ReferenceHeightLimit, ...] = ()
    periods: tuple[Period, ...] = ()
    statements: tuple[str, ...] = ()
    plate: tuple[str, ...] = ()
    layout: tuple[str, ...] = ()

    @property
    def limits(self):
        """All limits of the rule."""
        return (*self.uncertainty, *self.deviation, *self.reference_height, *self.periods)


@dataclass(frozen=True)
class PrintedU:
    """U of rows and deliveries as printed in reports: Monte Carlo where the GUM does not apply.

    Attributes
    ----------
    rows_m3 : ndarray, shape (rows,)
        U of the rows.
    by_gum : ndarray, shape (rows,), or None
        Whether U of a row is that of the table; None: all rows.
    pairs_m3 : dict
        {(low_m, high_m): U} of simulated deliveries.
    factor : float
        Factor on U of all other deliveries: the largest ratio among simulated deliveries with
        smooth volumes at both dips, at least 1.
    """

    rows_m3: np.ndarray
    by_gum: np.ndarray | None = None
    pairs_m3: dict = field(default_factory=dict)
    factor: float = 1.0

    def of(self, table, low_m, high_m, U_m3):
        """Return the printed U of a volume or of a delivery.

        Parameters
        ----------
        table : Capacity
        low_m : float or None
            Lower dip of a delivery, m; None: the volume below high_m.
        high_m : float
            Dip, m.
        U_m3 : float
            U of the table.

        Returns
        -------
        float
            For a delivery, the simulated U, otherwise `factor` times U of the table. For a volume
            at a row, U of the row. Between two rows, of which at least one differs from the table,
            the largest U of the rows and the table.
        """
        if low_m is not None:
            return self.pairs_m3.get((low_m, high_m), self.factor * U_m3)
        rows = table.rows_of(high_m)
        if self.by_gum is None or np.all(self.by_gum[rows]):
            return U_m3
        largest = float(self.rows_m3[rows].max())
        return largest if len(rows) == 1 else max(U_m3, largest)


def printed_of_table(table):
    """Return the `PrintedU` with the uncertainties of the table."""
    return PrintedU(table.U_m3)
