"""Figure of an inspection before the decision: value, expanded uncertainty and limit."""

from dataclasses import dataclass, field

from tankcal.record.inspection import InspectionLimit

PROBABILITY = 0.95  # coverage probability of U


@dataclass(frozen=True, kw_only=True)
class Figure:
    """A measured value with at most one limit, in the terms of `InspectionCheck`.

    Attributes
    ----------
    code : str
        One of tankcal.record.inspection.CHECKS.
    unit : str
        "mm", "1/m" or "" (a ratio).
    value : float or None
        Value with its sign; None if not determined.
    U : float or None
        Expanded uncertainty for PROBABILITY; None if no standard deviation is known.
    k : float or None
        Coverage factor of U.
    dof : float
        Degrees of freedom of U; may be inf.
    limit : InspectionLimit or None
        None if the rule has no limit, or if the limit requires data that are not given.
    at_least : bool
        Whether the limit is a lower limit of the value; if not, an upper limit of its magnitude.
    course, height_m, azimuth_deg, epoch : optional
        Place of the value, and its epoch or difference of two epochs.
    used : int
        Number of places that the largest value was selected from.
    reading, U_reading : float or None
        Largest single reading and its expanded uncertainty if the value estimates the largest true
        value; None if the value is a reading.
    remark, remark_values
        Code of a remark on the value, and the numbers of the remark.
    """

    code: str
    unit: str
    value: float | None
    U: float | None
    k: float | None
    dof: float
    limit: InspectionLimit | None
    at_least: bool = False
    course: int | None = None
    height_m: float | None = None
    azimuth_deg: float | None = None
    epoch: str | None = None
    used: int = 0
    reading: float | None = None
    U_reading: float | None = None
    remark: str | None = None
    remark_values: dict = field(default_factory=dict)
