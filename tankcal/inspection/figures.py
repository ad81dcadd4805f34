"""A figure of an inspection before it is judged: value, U, and the limit it is held against."""

from dataclasses import dataclass, field

from tankcal.record.inspection import InspectionLimit

PROBABILITY = 0.95  # of the interval that U spans


@dataclass(frozen=True, kw_only=True)
class Figure:
    """One number against at most one limit, in the words of `InspectionCheck`.

    Attributes
    ----------
    code : str
        One of tankcal.record.inspection.CHECKS.
    unit : str
        "mm", "1/m" or "" (a ratio).
    value : float or None
        With its sign; None: not determined.
    U : float or None
        Expanded, for PROBABILITY; None: no standard deviation is known.
    k : float or None
        Coverage factor of U.
    dof : float
        Degrees of freedom of U; may be inf.
    limit : InspectionLimit or None
        None: the rule has none, or what it needs is not given.
    at_least : bool
        Whether the value must reach the limit; else its size must stay within it.
    course, height_m, azimuth_deg, epoch : optional
        Where, and of which epoch or difference of two.
    used : int
        Places that the largest was taken from.
    reading, U_reading : float or None
        Largest single reading and its expanded uncertainty, where the value is an estimate of the
        largest true value; None: the value is a reading itself.
    remark, remark_values
        Code of what is to be read beside it, and its numbers.
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
