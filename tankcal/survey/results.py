"""What the adjustment of a survey gave, by the names that the user gave to things."""

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from tankcal.messages import Message
from tankcal.survey.adjusted_readings import Reading, Readings
from tankcal.text.digits import fixed
from tankcal.text.display import table_html

if TYPE_CHECKING:
    from tankcal.survey.measurements import RejectedReadings
    from tankcal.survey.network import Adjusted

_SHOWN = 20  # points that an adjustment shows of itself


@dataclass(frozen=True)
class GroupOfReadings:
    """Is a group of observations as good as declared?

    kind, name  such as "distance", "tape 1"; name "" where the kind says it all
    count       values adjusted     removed     set aside
    redundancy  of the group        factor      true sd over declared (variance component); nan:
    factor_sd   its sd, if the      nothing controls the group
                declaration holds
    rms         of the residuals, in `unit`
    sd_smallest, sd_largest         declared sds of the values adjusted; None: there are none
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
    """What holds the frame.

    Attributes
    ----------
    choice : str
        As asked for: "control", "fixed_photo", "minimal" or "inner".
    defect : int
        Number of the seven ways that no observation feels, before the choice was applied.
    words : Message
        a sentence that names them; "" when the defect is 0.
    held : tuple
        What holds them: names of points with axes ("P7:z"), or of the photo.
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
    """What depends on the choice of the datum, and what does not.

    Attributes
    ----------
    depends, independent : tuple of str
        Quantities, in words.
    """

    depends: tuple
    independent: tuple


def datum_dependence(report):
    """The Dependence of results on the choice of a datum.

    A quantity does not depend on the choice when no motion or scaling that the observations leave
    open changes it (`network.datum.depends_on_datum` tests single ones). Silva (1995) blamed
    ill-conditioning for sds of 1.37 m with another fixed station: coordinates, and their sds, are
    of the datum; the shape, and its sds, is not.

    Parameters
    ----------
    report : DatumReport

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
    volumes = ["volumes and the capacity table with their uncertainty"]
    (independent if report.scale and report.vertical else depends).extend(volumes)
    return Dependence(tuple(depends), tuple(independent))


@dataclass(frozen=True)
class CheckPoints:
    """Check points against the adjustment (Silva 5, 6); lengths in m.

    names          (n,)               difference_m  (n, 3) adjusted minus known; nan: not known
    sd_m           (n, 3) of the difference: adjustment and known coordinates
    r_xyz_m        root of the mean squared magnitude
    largest_m      largest magnitude  mean_m        mean magnitude
    """

    names: tuple
    difference_m: np.ndarray
    sd_m: np.ndarray
    r_xyz_m: float
    largest_m: float
    mean_m: float


@dataclass(frozen=True)
class Cause:
    """A named, shared cause of uncertainty of the coordinates: scale or offset of an instrument.

    Attributes
    ----------
    name : str
        "tape 1".
    what : str
        "instrument_scale", "instrument_offset", "incidence" or "registration".
    u, unit
        As declared: ppm or mm; None: it was computed. Several of one name and kind are one cause of
        several columns.
    column_m : ndarray, shape (3 points,)
        Change of all coordinates by one u, in the order of Adjustment.names; covariance = column
        column' + everything else, uncorrelated.
    is_assumed : bool
        Whether nobody declared it.
    """

    name: str
    what: str
    u: float | None
    unit: str | None
    column_m: np.ndarray
    is_assumed: bool = False


@dataclass(frozen=True)
class RepeatedReadings:
    """Repeated readings of image points, before anything was averaged.

    photo, point  (n,) names of the points read more than once      count  (n,) readings
    mean_mm       (n, 2) without weights      sd_mm  (n, 2) of one reading, from the sample
    limit_mm      sd beyond which readings were rejected; None: no limit
    rejected      tuple of RejectedReadings, which are among the n
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
        """(2,) mean of the standard deviations."""
        return self.sd_mm.mean(axis=0)

    @property
    def pooled_sd_mm(self):
        """(2,) root of the mean variance, by degrees of freedom: sd of one reading of any point."""
        return np.sqrt((self.count - 1) @ self.sd_mm**2 / np.sum(self.count - 1))


@dataclass(frozen=True)
class DepthOfField:
    """The outer iteration that corrects image points for the depth of their objects.

    rounds      adjustments made           last_change_mm  largest change of the last correction
    largest_mm  largest correction (x or y)       rms_mm   root mean square of all of them
    left        image readings left uncorrected: their objects have no depth in front of the lens
    """

    rounds: int
    last_change_mm: float
    largest_mm: float
    rms_mm: float
    left: int


@dataclass(frozen=True, repr=False)
class Adjustment:
    """The adjusted survey. Covariances are scaled as `cov_scale` says.

    Attributes
    ----------
    adjusted : network.Adjusted
        Numbers and covariances of everything, points by their number.
    there : ndarray of int, shape (n,)
        Numbers of the points that could be adjusted.
    aside : tuple of str
        Sentences: points that could not be adjusted, and why.
    readings : Readings
        A sequence of `Reading`, in the order of the files.
    removed : tuple of Reading
        Those that were set aside, the worst first.
    groups : tuple of GroupOfReadings
    datum : DatumReport
    check_points : CheckPoints or None
    causes : tuple of Cause
        Uncertainties that many points share, such as the scale of a tape.
    cov_scale : float
        Variance factor that covariances were multiplied by: 1, or sigma0 squared.
    rounds : int
        Adjustments by data snooping.
    warnings : tuple of Problem
    doubts : tuple of Problem
        Those of the warnings that put the whole result in doubt: what was set aside may be the
        victim of what was kept, or another reading may be wrong in its place.
    repeats : RepeatedReadings or None
        Of image points; None: each was read once.
    depth : DepthOfField or None
        None: not asked for.
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
        """(n,) names of the points that were adjusted."""
        return tuple(self.adjusted.survey.points[i] for i in self.there)

    @cached_property
    def xyz_m(self) -> np.ndarray:
        """(n, 3) adjusted coordinates."""
        return self.adjusted.xyz_m[self.there]

    @cached_property
    def covariance_m2(self) -> np.ndarray:
        """(n, 3, 3) covariance of each point; `full_covariance_m2` has all of them together."""
        return self.cov_scale * self.adjusted.point_covariances_m2[self.there]

    @property
    def fixed(self) -> np.ndarray:
        """(n, 3) True: was held."""
        return self.adjusted.problem.layout.points[self.there] < 0

    @property
    def sigma0(self) -> float:
        """A posteriori; nan: no redundancy."""
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
        """The adjusted points by columns, as `pandas.DataFrame` takes them: m, and sds in mm."""
        sd_mm = 1000 * np.sqrt(np.einsum("nii->ni", self.covariance_m2))
        columns = {"point": list(self.names)}
        columns |= {f"{axis}_m": self.xyz_m[:, i] for i, axis in enumerate("xyz")}
        return columns | {f"s{axis}_mm": sd_mm[:, i] for i, axis in enumerate("xyz")}

    @property
    def dof(self):
        """Degrees of freedom of the covariances: infinite unless residuals scaled them."""
        return np.inf if self.cov_scale == 1 else float(self.redundancy)

    def full_covariance_m2(self, names=None):
        """(3k, 3k) covariance of chosen points, all when None, scaled like the others."""
        wanted = self.names if names is None else names
        place = {name: i for i, name in enumerate(self.adjusted.survey.points)}
        return self.cov_scale * self.adjusted.covariance_m2([place[name] for name in wanted])
