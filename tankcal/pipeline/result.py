"""What a job gave: the capacity table, what it was made of, and what is read off it."""

from collections.abc import Sequence
from dataclasses import dataclass
from html import escape
from typing import TYPE_CHECKING

import numpy as np

from tankcal.errors import HeightError, Problem
from tankcal.job import Job
from tankcal.messages import message
from tankcal.pipeline.corrections import Correction
from tankcal.pipeline.overruling import Overrulings
from tankcal.pipeline.simulation import Intervals, TableSimulation
from tankcal.pipeline.statements import Statements, stated_delivery, stated_volume
from tankcal.pipeline.tanks import shell_volume
from tankcal.tank import dips
from tankcal.tank.body import Body
from tankcal.tank.budgets import Budget, budget, reading_sources
from tankcal.tank.capacity import Capacity, Quantity
from tankcal.tank.dips import Dips, ProportionalParts, Straightness
from tankcal.tank.rules import RuleVerdict
from tankcal.tank.service import shell_factor, shell_temperature_c, solid_factor
from tankcal.tank.volumes import ShellVolume
from tankcal.text.digits import decimals_of_height, fixed
from tankcal.text.display import table_html, volume_text

if TYPE_CHECKING:
    import pandas
    from matplotlib.figure import Figure

    from tankcal.pipeline.cloud_wall import Clouded
    from tankcal.pipeline.liquid_result import LiquidResult
    from tankcal.pipeline.nominal_wall import NominalWall
    from tankcal.pipeline.radii_wall import RadiiWall
    from tankcal.pipeline.read_wall import ReadWall
    from tankcal.pipeline.ringed_wall import RingedWall
    from tankcal.pipeline.scan import Scan
    from tankcal.pipeline.ship import ShipTables
    from tankcal.pipeline.strapped_sphere import StrappedSphere
    from tankcal.pipeline.strapped_wall import StrappedWall
    from tankcal.pipeline.surveyed_wall import Wall
    from tankcal.pipeline.wall_straps import Straps
    from tankcal.survey import Adjustment
    from tankcal.survey.sighting import Sighting
    from tankcal.survey.tangents import Touching


@dataclass(frozen=True, repr=False)
class Result:
    """Everything that a job gave; `capacity` is the table as a DataFrame.

    Attributes
    ----------
    job : Job
        As it was computed: the points are in it, too, where they came from an adjustment.
    wall : surveyed_wall.Wall or None
        The surveyed wall of a vertical tank; None for other kinds.
    scan : scan.Scan or None
        What points say of a lying cylinder or a sphere.
    strapped : strapped_wall.StrappedWall or None
        The wall of a vertical tank that a tape was put round.
    sighting : sighting.Sighting or None
        Bare hits of the wall as points, and where they were taken from.
    touching : tangents.Touching or None
        Tangents as points of the wall, and where they were sighted from.
    clouded : cloud_wall.Clouded or None
        Clouds as points of the wall: their scans, cells and what hides the wall.
    liquid : liquid.LiquidResult or None
        What metered runs say of the tank, beside its geometry.
    nominal : nominal_wall.NominalWall or None
        The wall of the drawing, of an upright tank that only liquid tells.
    radii : radii_wall.RadiiWall or None
        The wall of declared radii, with what was measured again in them.
    rings : ringed_wall.RingedWall or None
        The rings of a lying cylinder that a tape was put round.
    ship : ship.ShipTables or None
        Corrections of soundings for trim and list, of a tank of a ship.
    circles : strapped_sphere.StrappedSphere or None
        The sphere that a tape was put round.
    body : body.Body
        The tank as the sum of its parts, with all corrections that are on.
    zero_m : float
        Level of the table's zero: dip 0 in the frame of the parts, m.
    table : capacity.Capacity
        Rows with the factor of their covariance.
    straightness : Straightness
        How far linear interpolation between the rows is from the exact volume.
    proportional_parts : tuple of ProportionalParts
        What millimetres add to a row, zone by zone; () for no centimetre table.
    corrections : tuple of Correction
        Each with its size at the top row.
    by_density : dict of {float: ndarray}
        {density kg/m3: (rows,) volumes m3}: the same table for other densities.
    stated : statements.Statements
        Budgets, worst deliveries.
    simulation : simulation.TableSimulation or None
        The table by Monte Carlo; None where it is off.
    intervals : simulation.Intervals
        Of the rows, as they are printed.
    rule : rules.RuleVerdict or None
        Verdict of the job's decision rule on them.
    warnings : tuple of Problem
        What a sound survey of a sound tank hardly has.
    adjustment : survey.Adjustment or None
        The adjusted survey; None where points were handed in.
    overrulings : overruling.Overrulings or None
        What was decided against the search for blunders, and what that changed.

    Examples
    --------
    >>> import tankcal
    >>> result = tankcal.run(tankcal.load("examples/silva-1995"), simulated=False)
    >>> print(result)
    SILVA-1995: 1249.8 m3, U = 1.5 m3 (k = 1.96) at 9.500 m; 119 of 119 points of the wall
    """

    job: Job
    wall: "Wall | None"
    scan: "Scan | None"
    body: Body
    zero_m: float
    table: Capacity
    straightness: Straightness
    proportional_parts: tuple[ProportionalParts, ...]
    corrections: tuple[Correction, ...]
    by_density: dict[float, np.ndarray]
    stated: Statements
    simulation: TableSimulation | None
    intervals: Intervals
    rule: RuleVerdict | None
    warnings: tuple[Problem, ...]
    adjustment: "Adjustment | None" = None
    strapped: "StrappedWall | None" = None
    sighting: "Sighting | None" = None
    touching: "Touching | None" = None
    clouded: "Clouded | None" = None
    liquid: "LiquidResult | None" = None
    nominal: "NominalWall | None" = None
    radii: "RadiiWall | None" = None
    rings: "RingedWall | None" = None
    ship: "ShipTables | None" = None
    circles: "StrappedSphere | None" = None
    overrulings: Overrulings | None = None

    def __str__(self) -> str:
        top_m = self.table.height_m[-1]
        k = self.table.k[-1] if self.intervals.by_gum[-1] else None
        top = volume_text(self.table.volume_m3[-1], self.intervals.U_m3[-1], k)
        points = ""
        if self.accepted is not None:
            points = f"; {len(self.accepted)} of {len(self.job.points.names)} points of the wall"
        return f"{self.job.tank.id}: {top} at {fixed(top_m, decimals_of_height(top_m))} m{points}"

    def __repr__(self) -> str:
        return f"<tankcal.Result of {self}>"

    def _repr_html_(self) -> str:
        rows = [
            [
                correction.code,
                "yes" if correction.applied else "no",
                correction.size_m3,
                correction.size_percent,
            ]
            for correction in self.corrections
        ]
        warnings = "".join(f"<li>{escape(str(warning))}</li>" for warning in self.warnings)
        return (
            f"<p><b>{escape(str(self))}</b></p>"
            + table_html("Corrections at the top", ["correction", "made", "m3", "%"], rows)
            + (f"<p>Warnings:</p><ul>{warnings}</ul>" if warnings else "")
        )

    def plot(self, what: str | None = None) -> "Figure":
        """A drawing of the result, by the names that `tankcal.plot` takes."""
        from tankcal.pipeline.views import plot

        return plot(self, what)

    def budget(
        self,
        high_m: float | None = None,
        low_m: float | None = None,
        *,
        reading: bool = False,
        factors: Sequence[float] | None = None,
    ) -> Budget:
        """What the uncertainty of a volume, or of a delivery, consists of.

        Parameters
        ----------
        high_m, low_m : float, optional
            Dips, m; without `high_m` the top row, without `low_m` the volume below `high_m`.
        reading : bool
            Whether what reading the table adds (interpolation, rounding) is in it.
        factors : sequence of float, optional
            What if the u of each line of this budget were so many times what it is.

        Raises
        ------
        HeightError
            For a dip outside the table.
        ValueError
            For another number of factors than lines.
        """
        high_m = float(self.table.height_m[-1]) if high_m is None else high_m
        largest_m3 = self.straightness.largest_m3
        added = reading_sources(self.job.inputs, largest_m3) if reading else ()
        return budget(self.table, high_m, low_m, added, factors)

    @property
    def accepted(self) -> np.ndarray | None:
        """(m,) indices of the points that are of the wall; None where none were surveyed."""
        found = self.wall or self.scan
        return None if found is None else found.accepted

    @property
    def gross(self) -> ShellVolume | None:
        """The shell as surveyed, without any correction (`volumes.ShellVolume`); else None."""
        wall = self.radii or self.wall or self.strapped or self.nominal
        return None if wall is None else shell_volume(wall)

    @property
    def straps(self) -> "Straps | None":
        """Circumferences by tape, and what the wall says of them; None where none were read."""
        wall = self.wall or self.strapped or self.rings
        return None if wall is None else wall.straps

    @property
    def read(self) -> "ReadWall | None":
        """What a tape and reference lines read of a wall, alone or beside points; None: nothing."""
        return self.strapped if self.wall is None else self.wall.read

    @property
    def capacity(self) -> "pandas.DataFrame":
        """The capacity table, with the U that every paper states: the columns of capacity.csv.

        height_m, volume_m3 and u_m3, the standard uncertainty; k, not a number where U is not k u
        but Monte Carlo's; U_m3, low_m3 and high_m3; interval, "gum" or "monte_carlo": whose these
        are; with a floating roof for_use.
        """
        import pandas  # takes long to load, and no result needs it

        table, stated = self.table, self.intervals
        columns = {
            "height_m": table.height_m,
            "volume_m3": table.volume_m3,
            "u_m3": table.u_m3,
            "k": np.where(stated.by_gum, table.k, np.nan),
            "U_m3": stated.U_m3,
            "low_m3": stated.low_m3,
            "high_m3": stated.high_m3,
            "interval": np.where(stated.by_gum, "gum", "monte_carlo"),
        }
        if table.critical_m is not None:
            columns["for_use"] = table.for_use(table.height_m)
        return pandas.DataFrame(columns)

    def at(self, height_m: float) -> Quantity:
        """Volume at a dip, with the U that is stated (`capacity.Quantity`); HeightError outside."""
        return stated_volume(self.table, self.intervals, height_m)

    def in_service_m3(
        self,
        height_m: float,
        liquid_c: float,
        ambient_c: float | None = None,
        *,
        insulated: bool = False,
    ) -> float:
        """Volume at a dip of a shell that the liquid keeps at another temperature: V times CTSh,
        of a tank that is one solid as it grows all over (`service.solid_factor`).

        ambient_c  needed for a shell that is not insulated (`service.shell_temperature_c`)
        """
        shell_c = shell_temperature_c(liquid_c, ambient_c, insulated=insulated)
        reference, expansion = self.job.table.reference_temperature_c, self.job.material
        expands = expansion.expansion_per_k
        if self.job.tank.kind == "vertical":
            factor = shell_factor(shell_c, reference, expands)
        else:
            levels = np.array([height_m + self.zero_m])
            factor = float(solid_factor(self.body, levels, shell_c, reference, expands)[0])
        return self.at(height_m).value_m3 * factor

    def dip_of(self, volume_m3: float | np.ndarray) -> Dips:
        """(n,) dips of volumes, with their standard uncertainties (`dips.Dips`); HeightError."""
        table = self.table
        return dips.dips_of(table.height_m, table.volume_m3, table.factor_m3, volume_m3)

    def at_ullage(self, ullage_m: float) -> Quantity:
        """Volume at an ullage, measured down from the reference point of the gauge.

        Raises HeightError outside the table, and without a reference height in the job.
        """
        reference = self.job.datum.reference_height_m
        if reference is None:
            raise HeightError(
                message("no_ullage", "no ullage; expected datum.reference_height_m in the job")
            )
        return self.at(float(dips.ullage_m(reference, ullage_m)))

    def delivery(self, low_m: float, high_m: float) -> Quantity:
        """Volume between two dips, with its own uncertainty; HeightError outside."""
        return stated_delivery(self.table, self.simulation, low_m, high_m)
