"""Results of the adjustment of a survey, by the user's names.

A scale or an offset of an instrument with an a priori value and standard deviation is a weighted
unknown. A shift of that value by one standard deviation changes all adjusted coordinates by a
column c. The contribution to their covariance is c c'. Source: JCGM 100, 5.2; Koch 1999, section
3.2.
"""

from collections.abc import Sequence
from dataclasses import dataclass, fields
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from tankcal.messages import Message
from tankcal.text.digits import fixed
from tankcal.text.display import table_html

if TYPE_CHECKING:
    from tankcal.survey.measurements import RejectedReadings
    from tankcal.survey.network import Adjusted

_SHOWN = 20  # points listed in the HTML representation of an adjustment


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


@dataclass(frozen=True)
class GroupOfReadings:
    """Test of the declared standard deviations of a group of observations.

    Attributes
    ----------
    kind, name : str
        Such as "distance", "tape 1"; name "" where the kind is sufficient.
    unit : str
    count, removed : int
        Number of adjusted values, and of rejected values.
    redundancy : float
        Redundancy of the group.
    factor : float
        Estimated over declared standard deviation (root of the variance component); nan: the group
        is not controlled.
    factor_sd : float
        Standard deviation of the factor, if the declaration holds.
    rms : float
        Root mean square of the residuals, in `unit`.
    sd_smallest, sd_largest : float or None
        Range of the declared standard deviations of the adjusted values; None: no values.
    """

    kind: str
    name: str
    unit: str
    count: int
    removed: int
    redundancy: float
    factor: float
    factor_sd: float
    rms: float
    sd_smallest: float | None = None
    sd_largest: float | None = None


@dataclass(frozen=True)
class DatumReport:
    """Datum of a survey.

    Attributes
    ----------
    choice : str
        Declared choice: "control", "fixed_photo", "minimal" or "inner".
    defect : int
        Number of the seven datum parameters that the observations leave undetermined.
    words : Message
        Sentence that names the defect; "" when it is 0.
    held : tuple
        Items that hold the datum: names of points with axes ("P7:z"), or of the photo.
    vertical : bool
        True: observations determine the vertical, whatever the choice.
    scale : bool
        True: observations determine the scale.
    """

    choice: str
    defect: int
    words: Message
    held: tuple
    vertical: bool
    scale: bool


@dataclass(frozen=True)
class Dependence:
    """Quantities that depend on the choice of the datum, and quantities that do not.

    Attributes
    ----------
    depends, independent : tuple of str
        Quantities, in words.
    """

    depends: tuple
    independent: tuple


def datum_dependence(report):
    """Determine which results depend on the choice of the datum.

    A quantity is independent if it is invariant under the motions or scaling that the observations
    leave undetermined (`network.datum.depends_on_datum` tests single quantities). Silva (1995)
    attributed standard deviations of 1.37 m with another fixed station to ill-conditioning.
    Coordinates and their standard deviations belong to the datum; shape and its standard deviations
    do not.

    Returns
    -------
    Dependence
    """
    if not report.defect:
        return Dependence((), ("every result",))
    depends = ["coordinates of points and photos", "their standard deviations and ellipsoids"]
    independent = ["residuals, redundancy numbers and sigma0", "angles and ratios of distances"]
    lengths = ["distances and radii with their standard deviations"]
    (independent if report.scale else depends).extend(lengths)
    upright = ["heights above a level plane, tilt and plumb of the shell"]
    (independent if report.vertical else depends).extend(upright)
    # A volume needs the scale, and the vertical for the heights of the table.
    volumes = ["volumes and the capacity table with their uncertainty"]
    (independent if report.scale and report.vertical else depends).extend(volumes)
    return Dependence(tuple(depends), tuple(independent))


@dataclass(frozen=True)
class CheckPoints:
    """Comparison of check points with the adjustment (Silva 5, 6); lengths in m.

    Attributes
    ----------
    names : tuple, length n
    difference_m : ndarray, shape (n, 3)
        Adjusted minus known; nan: not known.
    sd_m : ndarray, shape (n, 3)
        Standard deviation of the difference, from adjustment and known coordinates.
    r_xyz_m : float
        Root mean square magnitude.
    largest_m, mean_m : float
        Largest and mean magnitude.
    """

    names: tuple
    difference_m: np.ndarray
    sd_m: np.ndarray
    r_xyz_m: float
    largest_m: float
    mean_m: float


@dataclass(frozen=True)
class Cause:
    """Named cause of uncertainty shared by coordinates: scale or offset of an instrument.

    Attributes
    ----------
    name : str
        "tape 1".
    what : str
        "instrument_scale", "instrument_offset", "incidence" or "registration".
    u, unit
        Declared standard uncertainty in ppm or mm; None: computed. Causes of equal name and kind
        are one cause with several columns.
    column_m : ndarray, shape (3 points,)
        Change of all coordinates by one u, in the order of Adjustment.names. Covariance = column
        column' + an uncorrelated remainder.
    is_assumed : bool
        Whether u is assumed rather than declared.
    """

    name: str
    what: str
    u: float | None
    unit: str | None
    column_m: np.ndarray
    is_assumed: bool = False


def causes_of(adjusted, points, cov_scale):
    """Return the shared causes of the coordinates of selected points.

    Parameters
    ----------
    adjusted : network.Adjusted
    points : array_like of int, shape (k,)
        Numbers of the points.
    cov_scale : float
        Variance factor of the covariances.

    Returns
    -------
    tuple of Cause
        Instruments without effect on the points are omitted.
    """
    causes = []
    for i, tool in enumerate(adjusted.survey.instruments):
        for what, parameter, sd, factor, unit in (
            ("instrument_scale", "scale", tool.scale_sd, 1e6, "ppm"),
            ("instrument_offset", "offset_m", tool.offset_sd_m, 1e3, "mm"),
        ):
            if sd > 0:
                moves = adjusted.effect_of_known_m(parameter, i).reshape(-1, 3)[np.asarray(points)]
                # Covariances carry the factor cov_scale, so a column carries its root.
                change = np.sqrt(cov_scale) * moves.ravel()
                if change.any():
                    causes.append(Cause(tool.name, what, factor * sd, unit, change))
    return tuple(causes)


@dataclass(frozen=True)
class RepeatedReadings:
    """Repeated readings of image points, before averaging.

    Attributes
    ----------
    photo, point : tuple, length n
        Names of the points read more than once.
    count : ndarray of int, shape (n,)
        Number of readings.
    mean_mm : ndarray, shape (n, 2)
        Unweighted means.
    sd_mm : ndarray, shape (n, 2)
        Sample standard deviation of one reading.
    limit_mm : float or None
        Limit of sd_mm beyond which readings are rejected; None: no limit.
    rejected : tuple of RejectedReadings
        Rejected points among the n.
    """

    photo: tuple
    point: tuple
    count: np.ndarray
    mean_mm: np.ndarray
    sd_mm: np.ndarray
    limit_mm: float | None
    rejected: tuple["RejectedReadings", ...]

    @property
    def mean_sd_mm(self):
        """Mean (2,) of the standard deviations."""
        return self.sd_mm.mean(axis=0)

    @property
    def pooled_sd_mm(self):
        """Pooled standard deviation (2,) of one reading, weighted by degrees of freedom."""
        # Weighted by n - 1 of each point: sum (n - 1) s^2 / sum (n - 1).
        return np.sqrt((self.count - 1) @ self.sd_mm**2 / np.sum(self.count - 1))


@dataclass(frozen=True)
class DepthOfField:
    """Outer iteration that corrects image points for the depth of their objects.

    Attributes
    ----------
    rounds : int
        Number of adjustments.
    last_change_mm : float
        Largest change of the last correction.
    largest_mm, rms_mm : float
        Largest correction (x or y), and root mean square of all corrections.
    left : int
        Uncorrected image readings, whose objects have no valid depth in front of the lens.
    """

    rounds: int
    last_change_mm: float
    largest_mm: float
    rms_mm: float
    left: int


@dataclass(frozen=True, repr=False)
class Adjustment:
    """The adjusted survey. Covariances include the factor `cov_scale`.

    Attributes
    ----------
    adjusted : network.Adjusted
        Values and covariances of all unknowns, points by number.
    there : ndarray of int, shape (n,)
        Numbers of the adjusted points.
    aside : tuple of str
        Sentences: points that could not be adjusted, and the reasons.
    readings : Readings
        Sequence of `Reading`, in the order of the files.
    removed : tuple of Reading
        Rejected readings, the worst first.
    groups : tuple of GroupOfReadings
    datum : DatumReport
    check_points : CheckPoints or None
    causes : tuple of Cause
        Uncertainties shared by many points, such as the scale of a tape.
    cov_scale : float
        Variance factor of the covariances: 1, or sigma0 squared.
    rounds : int
        Adjustments during data snooping.
    warnings : tuple of Problem
    doubts : tuple of Problem
        Warnings that question the whole result: a valid reading may have been rejected because of a
        wrong one that was kept, or another reading may be wrong instead.
    repeats : RepeatedReadings or None
        Repeated readings of image points; None: each point was read once.
    depth : DepthOfField or None
        None: not requested.
    """

    adjusted: "Adjusted"
    there: np.ndarray
    aside: tuple
    readings: Readings
    removed: tuple[Reading, ...]
    groups: tuple[GroupOfReadings, ...]
    datum: DatumReport
    check_points: CheckPoints | None
    causes: tuple[Cause, ...]
    cov_scale: float
    rounds: int
    warnings: tuple = ()
    doubts: tuple = ()
    repeats: RepeatedReadings | None = None
    depth: DepthOfField | None = None

    @cached_property
    def names(self) -> tuple:
        """Names (n,) of the adjusted points."""
        return tuple(self.adjusted.survey.points[i] for i in self.there)

    @cached_property
    def xyz_m(self) -> np.ndarray:
        """Adjusted coordinates (n, 3), m."""
        return self.adjusted.xyz_m[self.there]

    @cached_property
    def covariance_m2(self) -> np.ndarray:
        """Covariance (n, 3, 3) of each point; `full_covariance_m2` includes correlations of
        points."""
        return self.cov_scale * self.adjusted.point_covariances_m2[self.there]

    @property
    def fixed(self) -> np.ndarray:
        """Mask (n, 3), True for held coordinates."""
        # Held coordinates have no column in the adjustment.
        return self.adjusted.problem.layout.points[self.there] < 0

    @property
    def sigma0(self) -> float:
        """A posteriori sigma0; nan: no redundancy."""
        return self.adjusted.sigma0

    @property
    def observations(self) -> int:
        """Number of values adjusted, each repeated reading counted."""
        return self.adjusted.solution.rows

    @property
    def unknowns(self) -> int:
        """Number of unknowns."""
        return self.adjusted.solution.estimated

    @property
    def redundancy(self) -> int:
        """Degrees of freedom of the adjustment."""
        return self.adjusted.dof

    @property
    def iterations(self) -> int:
        """Iterations of the last adjustment."""
        return self.adjusted.solution.iterations

    def __str__(self) -> str:
        fit = "nothing redundant"
        if self.redundancy > 0:
            test = "passed" if self.adjusted.test().passed else "FAILED"
            fit = f"sigma0 = {fixed(self.sigma0, 3)}, global test {test}"
        aside = f", {len(self.removed)} readings rejected" if self.removed else ""
        return f"{len(self.names)} points, redundancy {self.redundancy}, {fit}{aside}"

    def __repr__(self) -> str:
        return f"<tankcal.Adjustment of {self}>"

    def _repr_html_(self) -> str:
        columns = self.points
        rows = [
            [
                columns["point"][i],
                *(fixed(columns[f"{axis}_m"][i], 4) for axis in "xyz"),
                *(fixed(columns[f"s{axis}_mm"][i], 2) for axis in "xyz"),
            ]
            for i in range(min(len(self.names), _SHOWN))
        ]
        more = len(self.names) - _SHOWN
        headings = ["point", "x, m", "y, m", "z, m", "sx, mm", "sy, mm", "sz, mm"]
        table = table_html(f"Adjustment: {self}", headings, rows)
        return table + (f"<p>and {more} more points</p>" if more > 0 else "")

    @property
    def points(self) -> dict:
        """Columns of the adjusted points for `pandas.DataFrame`: m, and standard deviations in
        mm."""
        sd_mm = 1000 * np.sqrt(np.einsum("nii->ni", self.covariance_m2))
        columns = {"point": list(self.names)}
        columns |= {f"{axis}_m": self.xyz_m[:, i] for i, axis in enumerate("xyz")}
        return columns | {f"s{axis}_mm": sd_mm[:, i] for i, axis in enumerate("xyz")}

    @property
    def dof(self):
        """Degrees of freedom of the covariances: infinite unless residuals scaled them."""
        # A priori covariances do not depend on an estimated variance factor.
        return np.inf if self.cov_scale == 1 else float(self.redundancy)

    def full_covariance_m2(self, names=None):
        """Covariance (3k, 3k) of the named points, or of all when None, scaled by `cov_scale`."""
        selection = self.names if names is None else names
        place = {name: i for i, name in enumerate(self.adjusted.survey.points)}
        return self.cov_scale * self.adjusted.covariance_m2([place[name] for name in selection])

    def covariance_of_points(self, names):
        """`PointCovariance` of the named points, scaled by `cov_scale`."""
        place = {name: i for i, name in enumerate(self.adjusted.survey.points)}
        return self.adjusted.covariance_of_points([place[name] for name in names]) * self.cov_scale
