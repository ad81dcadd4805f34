"""Results of a calibration by liquid: the parts of `Result.liquid`."""

from dataclasses import dataclass

import numpy as np

from tankcal.tank.liquid import Verdict
from tankcal.uncertainty import combine


@dataclass(frozen=True)
class BesideTable:
    """Volumes at the rows of the printed table, according to one kind of information.

    Attributes
    ----------
    kind : {"geometry", "liquid", "joint"}
    volume_m3, u_m3, U_m3 : ndarray, shape (rows,)
        Volume, its standard and expanded uncertainty; nan where liquid alone has no dips.
    """

    kind: str
    volume_m3: np.ndarray
    u_m3: np.ndarray
    U_m3: np.ndarray


@dataclass(frozen=True)
class LiquidSteps:
    """Steps between used dips, arrays of shape (n,); volumes in m3.

    Attributes
    ----------
    row : ndarray of int
        Input row at the end of the step.
    run, meter : tuple of str
    from_dip_m, to_dip_m : ndarray
        Dips before and after the step; nan: from the empty tank.
    indicated_m3 : ndarray
        Indication of the meter.
    by_factor_m3, by_meter_temperature_m3, by_shell_m3, by_tank_temperature_m3, by_head_m3 : ndarray
        Corrections of the indication to the reference temperature and the liquid of the table.
    reference_m3 : ndarray
        Sum of the indication and its corrections.
    misclosure_m3, misclosure_sd_m3, misclosure_w : ndarray
        Liquid less geometry before the adjustment, its standard deviation, and their ratio.
    residual_m3 : ndarray
        Volume missing from the batch according to the joint adjustment.
    sd_m3, redundancy, w : ndarray
        Standard deviation of the batch before the adjustment, its redundancy, and its test
        quantity.
    detectable_m3 : ndarray
        Smallest error of the batch that the test would detect; inf: none.
    """

    row: np.ndarray
    run: tuple
    meter: tuple
    from_dip_m: np.ndarray
    to_dip_m: np.ndarray
    indicated_m3: np.ndarray
    by_factor_m3: np.ndarray
    by_meter_temperature_m3: np.ndarray
    by_shell_m3: np.ndarray
    by_tank_temperature_m3: np.ndarray
    by_head_m3: np.ndarray
    reference_m3: np.ndarray
    misclosure_m3: np.ndarray
    misclosure_sd_m3: np.ndarray
    misclosure_w: np.ndarray
    residual_m3: np.ndarray
    sd_m3: np.ndarray
    redundancy: np.ndarray
    w: np.ndarray
    detectable_m3: np.ndarray

    @property
    def sd(self):
        """Standard deviation of each batch, m3."""
        return self.sd_m3


@dataclass(frozen=True)
class LiquidDips:
    """Used dips, arrays of shape (d,).

    Attributes
    ----------
    row : ndarray of int
        Input row.
    run : tuple of str
    dip_m : ndarray
        Dip as read.
    residual_m : ndarray
        Correction to add to the dip.
    sd_m, redundancy, w : ndarray
        Standard deviation before the adjustment, redundancy and test quantity.
    """

    row: np.ndarray
    run: tuple
    dip_m: np.ndarray
    residual_m: np.ndarray
    sd_m: np.ndarray
    redundancy: np.ndarray
    w: np.ndarray

    @property
    def sd(self):
        """Standard deviation of each dip, m."""
        return self.sd_m


@dataclass(frozen=True)
class LiquidChecks:
    """Dips that are only compared, arrays of shape (c,).

    Attributes
    ----------
    row : ndarray of int
        Input row.
    run : tuple of str
    dip_m : ndarray
        Dip as read.
    difference_m, sd_m, w : ndarray
        Reading less prediction by all used readings, its standard deviation, and their ratio.
    """

    row: np.ndarray
    run: tuple
    dip_m: np.ndarray
    difference_m: np.ndarray
    sd_m: np.ndarray
    w: np.ndarray


@dataclass(frozen=True)
class Estimate:
    """A quantity with its value and standard uncertainty before and after the adjustment."""

    name: str
    before: float
    u_before: float
    after: float
    u_after: float


@dataclass(frozen=True)
class LiquidResult:
    """Results of metered runs and geometry of a tank, as an entry of `Result.surveys`.

    Attributes
    ----------
    certified : {"joint", "liquid", "geometry"}
        Basis of the printed table.
    steps : LiquidSteps
    dips : LiquidDips
    checks : LiquidChecks or None
        Dips that are only compared; None: there are none.
    runs : tuple of Estimate
        Effect of each run, relative.
    run_sd, run_dof : float
        Standard deviation of the run effect, relative, and its degrees of freedom (inf: declared).
    factors : tuple of Estimate
        Factor of each meter.
    bottom_flex : Estimate or None
        Flexing of the bottom, m3 per metre of head.
    bottom_m3 : Estimate or None
        Volume below the first dip beyond the volume by geometry; None: geometry determines it.
    sizes : tuple of Estimate
        Moves of inputs of the geometry by liquid, in SI.
    chi2, dof, probability : float
        Chi-square of all misclosures, its degrees of freedom, and the probability of a larger
        value.
    detectable_radius_m : float or None
        Smallest offset of all radii that the liquid would detect; None: without meaning.
    causes : tuple of Verdict
        Possible causes of the misclosures, the likeliest first; causes with `is_named` are
        reported.
    filled_m : tuple of (float, float)
        Lowest and highest used dip.
    tables : dict of {str: BesideTable}
        "geometry", "liquid" (None if liquid alone does not determine the tank) and "joint".
    """

    certified: str
    steps: LiquidSteps
    dips: LiquidDips
    checks: LiquidChecks | None
    runs: tuple[Estimate, ...]
    run_sd: float
    run_dof: float
    factors: tuple[Estimate, ...]
    bottom_flex: Estimate | None
    bottom_m3: Estimate | None
    sizes: tuple[Estimate, ...]
    chi2: float
    dof: int
    probability: float
    detectable_radius_m: float | None
    causes: tuple[Verdict, ...]
    filled_m: tuple[float, float]
    tables: dict[str, BesideTable]

    surveyed_as = "liquid"


def beside_table(kind, body, levels_m, probability, known=None):
    """Compute the `BesideTable` of a body.

    Parameters
    ----------
    kind : str
        "geometry", "liquid" or "joint".
    body : Body
    levels_m : array_like, shape (rows,)
        Levels of the rows.
    probability : float
        Coverage probability of U.
    known : ndarray of bool, shape (rows,), optional
        Rows with information; None: all rows.
    """
    levels = np.asarray(levels_m, dtype=float)
    known = np.full(len(levels), True) if known is None else known
    columns = {name: np.full(len(levels), np.nan) for name in ("volume_m3", "u_m3", "U_m3")}
    inside = np.clip(levels[known], body.lowest_m, body.highest_m)
    if len(inside):
        combined = combine(body.sources(inside), len(inside))
        columns["volume_m3"][known] = body.volume_m3(inside)
        columns["u_m3"][known] = combined.u
        columns["U_m3"][known] = combined.expanded(probability)
    return BesideTable(kind, **columns)
