"""Figure of an inspection, and the decision on it by `tankcal.gum.conformity`.

The limit of the magnitude of a value and the guard band U determine the verdict. Without U no
figure passes or fails. If the value estimates the largest of many true values, the largest reading
plus its U must also be within the limit.
"""

from dataclasses import dataclass, field

from tankcal.gum.conformity import probability_of, verdict_of
from tankcal.record.inspection import InspectionCheck, InspectionLimit

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


def make_check(figure):
    """`InspectionCheck` of a `Figure`, with its verdict and probability of conformity."""
    limit = None if figure.limit is None else figure.limit.value
    u = figure.U / figure.k if figure.U is not None and figure.k else None
    return InspectionCheck(
        code=figure.code,
        unit=figure.unit,
        value=figure.value,
        U=figure.U,
        k=figure.k,
        course=figure.course,
        height_m=figure.height_m,
        azimuth_deg=figure.azimuth_deg,
        epoch=figure.epoch,
        used=figure.used,
        limit=figure.limit,
        probability=probability_of(figure.value, u, limit, figure.dof, at_least=figure.at_least),
        verdict=verdict_of(
            figure.value,
            figure.U,
            limit,
            at_least=figure.at_least,
            reading=figure.reading,
            U_reading=figure.U_reading,
        ),
        reading=figure.reading,
        U_reading=figure.U_reading,
        remark=figure.remark,
        remark_values=figure.remark_values,
    )
