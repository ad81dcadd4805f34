"""What metered runs and geometry say of a tank: the parts of `Result.liquid`."""

from dataclasses import dataclass

import numpy as np

from tankcal.pipeline.liquid_tables import BesideTable
from tankcal.tank.liquid import Verdict


@dataclass(frozen=True)
class LiquidSteps:
    """Steps between dips that count, (n,) each; volumes in m3.

    Attributes
    ----------
    row : ndarray of int
        Row of the input at its end.
    run, meter : tuple of str
    from_dip_m, to_dip_m : ndarray
        nan: from the empty tank.
    indicated_m3, by_factor_m3, by_meter_temperature_m3, by_shell_m3, by_tank_temperature_m3,
    by_head_m3 : ndarray
        As the meter showed it, and what brings it to the reference: the table's temperature and its
        liquid.
    reference_m3 : ndarray
        Their sum.
    misclosure_m3, misclosure_sd_m3, misclosure_w : ndarray
        Liquid less geometry before the adjustment, its standard deviation, and their ratio.
    residual_m3, sd_m3, redundancy, w : ndarray
        Of the batch in the joint adjustment: what it lacks, its standard deviation before, which
        part of an error shows, and the test of it.
    detectable_m3 : ndarray
        Smallest error of the batch that the test would show; inf: none.
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
    """Dips that count, (d,) each: row, run, dip, residual, sd before, redundancy, w.

    residual_m is what is to be added to a dip.
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
        """As of `LiquidSteps`, in m."""
        return self.sd_m


@dataclass(frozen=True)
class LiquidChecks:
    """Dips that are only compared, (c,) each.

    Attributes
    ----------
    row : ndarray of int
    run : tuple of str
    dip_m : ndarray
        As read.
    difference_m, sd_m, w : ndarray
        Read less what all that counts says; its standard deviation; their ratio.
    """

    row: np.ndarray
    run: tuple
    dip_m: np.ndarray
    difference_m: np.ndarray
    sd_m: np.ndarray
    w: np.ndarray


@dataclass(frozen=True)
class Estimate:
    """A number with its standard uncertainty, before and after."""

    name: str
    before: float
    u_before: float
    after: float
    u_after: float


@dataclass(frozen=True)
class LiquidResult:
    """What metered runs and geometry say of a tank.

    Attributes
    ----------
    certified : {"joint", "liquid", "geometry"}
        Whose table is printed.
    steps : LiquidSteps
    dips : LiquidDips
    checks : LiquidChecks or None
        Dips that are only compared; None: there are none.
    runs : tuple of Estimate
        The effect of each run, relative.
    run_sd, run_dof : float
        Of the run effect, relative, with its degrees of freedom (inf: declared).
    factors : tuple of Estimate
        Of each meter.
    bottom_flex : Estimate or None
        m3 per metre of head.
    bottom_m3 : Estimate or None
        The volume below the first dip beyond geometry's; None: geometry says it.
    sizes : tuple of Estimate
        Inputs of the geometry that liquid moved, in SI.
    chi2, dof, probability : float
        Of all misclosures together, and the probability of a larger one.
    detectable_radius_m : float or None
        Smallest offset of all radii that the liquid would have shown; None: it has no meaning.
    causes : tuple of Verdict
        Of misclosures, the likeliest first; those with `is_named` are told.
    filled_m : tuple of (float, float)
        Lowest and highest dip that counts.
    tables : dict of {str: BesideTable}
        "geometry", "liquid" (None where liquid alone does not tell the tank) and "joint".
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
