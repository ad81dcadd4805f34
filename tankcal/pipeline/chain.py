"""Computation of a job to a `Result`: the capacity table, the data behind it, and their readers."""

from collections.abc import Callable, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from html import escape
from importlib import import_module
from typing import TYPE_CHECKING

import numpy as np

from tankcal.errors import HeightError, InputError, Problem
from tankcal.job import Job
from tankcal.messages import message
from tankcal.methods.base import given_methods, supplement_of
from tankcal.pipeline.checks import incomplete_certificate, open_questions
from tankcal.pipeline.overruling_effects import Overrulings, effect_of, warn_of_overrulings
from tankcal.pipeline.simulation import (
    SIMULATING,
    Intervals,
    TableSimulation,
    gum_intervals,
    simulate_table,
)
from tankcal.pipeline.surveying import adjust_decided, find_survey, locate_in_book
from tankcal.pipeline.table import (
    Statements,
    check_table,
    compute_table,
    pairs_to_simulate,
    stated_delivery,
    stated_volume,
    statements,
    verdict_of,
)
from tankcal.pipeline.tanks import (
    Correction,
    body_of,
    corrections_of,
    filled_with,
    gross_at_top,
    shell_volume,
)
from tankcal.tank import dips
from tankcal.tank.body import Body
from tankcal.tank.budgets import Budget, budget, reading_sources
from tankcal.tank.capacity import Capacity, Quantity, refuse_falling
from tankcal.tank.dips import Dips, ProportionalParts, Straightness, proportional_parts
from tankcal.tank.rules import RuleVerdict
from tankcal.tank.service import shell_factor, shell_temperature_c, solid_factor
from tankcal.tank.volumes import ShellVolume
from tankcal.text.digits import decimals_of_height, fixed
from tankcal.text.display import table_html, volume_text

if TYPE_CHECKING:
    import pandas
    from matplotlib.figure import Figure

    from tankcal.methods.clouds.wall import Clouded
    from tankcal.methods.mesh.ship import ShipTables
    from tankcal.methods.radii.wall import RadiiWall
    from tankcal.methods.strapping.wall import StrappedWall
    from tankcal.pipeline.liquid import NominalWall
    from tankcal.pipeline.liquid.measuring import LiquidResult
    from tankcal.pipeline.read_wall import ReadWall
    from tankcal.pipeline.scanned_solids import Scan
    from tankcal.pipeline.wall.surveyed import Wall
    from tankcal.pipeline.wall_straps import Straps
    from tankcal.survey import Adjustment
    from tankcal.survey.tangents import Touching
    from tankcal.survey.wall_hits import Sighting


@dataclass(frozen=True, repr=False)
class Result:
    """Result of a job; `capacity` is the table as a DataFrame.

    Attributes
    ----------
    job : Job
        The job as computed, with its points if these came from an adjustment.
    surveys : dict
        {`surveyed_as` of a survey: the survey}: the wall or solid that the measurements determine,
        with declared radii also the survey that checks them, and the results of a method that
        supplements it. The properties `wall`, `scan`, `strapped`, `nominal`, `radii`, `rings` and
        `liquid` are entries of it. The survey of a method of `tankcal.methods` has the name of the
        method, such as "great_circles".
    sights : dict
        {method: its sights as points of the wall}; the properties `sighting`, `touching` and
        `clouded` are entries of it.
    ship : ship.ShipTables or None
        Corrections of soundings for trim and list of a ship's tank.
    body : body.Body
        Tank as the sum of its parts, with all enabled corrections.
    zero_m : float
        Level of the table's zero (dip 0) in the frame of the parts, m.
    table : capacity.Capacity
        Rows with the factor of their covariance.
    straightness : Straightness
        Error of linear interpolation between the rows.
    proportional_parts : tuple of ProportionalParts
        Volumes of millimetres to add to a row, for each zone; () without a centimetre table.
    corrections : tuple of Correction
        Corrections with their size at the top row.
    by_density : dict of {float: ndarray}
        {density in kg/m3: volumes (rows,) in m3}: the table for other densities.
    on_high_legs : Capacity or None
        Table with the legs of a floating roof in their high position; None: a single position.
    stated : statements.Statements
        Uncertainty budgets and worst deliveries.
    simulation : simulation.TableSimulation or None
        Monte Carlo simulation of the table; None if disabled.
    intervals : simulation.Intervals
        Coverage intervals of the rows as printed.
    rule : rules.RuleVerdict or None
        Verdict of the job's decision rule.
    warnings : tuple of Problem
        Observations that are unlikely for a valid survey of a tank without defects.
    adjustment : survey.Adjustment or None
        Adjusted survey; None if points were supplied.
    overrulings : overruling.Overrulings or None
        Manual decisions against the outlier search, and their effect.

    Examples
    --------
    >>> import tankcal
    >>> result = tankcal.run(tankcal.load("examples/silva-1995"), simulated=False)
    >>> print(result)
    SILVA-1995: 1249.7 m3, U = 1.5 m3 (k = 1.96) at 9.500 m; 119 of 119 points of the wall
    """

    job: Job
    surveys: dict[str, object]
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
    sights: dict[str, object] = field(default_factory=dict)
    ship: "ShipTables | None" = None
    overrulings: Overrulings | None = None
    on_high_legs: Capacity | None = None

    @property
    def wall(self) -> "Wall | None":
        """Wall of a vertical tank surveyed by points; None for other kinds."""
        return self.surveys.get("wall")

    @property
    def scan(self) -> "Scan | None":
        """Solid fitted to the points of a horizontal cylinder or a sphere."""
        return self.surveys.get("scan")

    @property
    def strapped(self) -> "StrappedWall | None":
        """Wall of a vertical tank measured by strapping."""
        return self.surveys.get("strapping")

    @property
    def nominal(self) -> "NominalWall | None":
        """Wall from the drawing, for an upright tank calibrated by liquid alone."""
        return self.surveys.get("nominal")

    @property
    def radii(self) -> "RadiiWall | None":
        """Wall of declared radii, with the courses measured again."""
        return self.surveys.get("radii")

    @property
    def rings(self):
        """Rings of a horizontal cylinder measured by strapping."""
        return self.surveys.get("rings")

    @property
    def liquid(self) -> "LiquidResult | None":
        """Calibration by metered liquid, in addition to the geometry."""
        return self.surveys.get("liquid")

    @property
    def sighting(self) -> "Sighting | None":
        """Reflectorless hits of the wall as points, with their set-ups."""
        return self.sights.get("hits")

    @property
    def touching(self) -> "Touching | None":
        """Tangents as points of the wall, with their set-ups."""
        return self.sights.get("tangents")

    @property
    def clouded(self) -> "Clouded | None":
        """Point clouds as points of the wall: scans, cells and obstructions."""
        return self.sights.get("clouds")

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
        """Draw a figure of the result, chosen by the names that `tankcal.plot` accepts."""
        import tankcal  # the drawings belong to the reports, above this package

        return tankcal.plot(self, what)

    def budget(
        self,
        high_m: float | None = None,
        low_m: float | None = None,
        *,
        reading: bool = False,
        factors: Sequence[float] | None = None,
    ) -> Budget:
        """Uncertainty budget of a volume or of a delivery.

        Parameters
        ----------
        high_m, low_m : float, optional
            Dips, m. The default of `high_m` is the top row. Without `low_m` the budget is that of
            the volume below `high_m`.
        reading : bool
            Whether to include the uncertainty of reading the table (interpolation, rounding).
        factors : sequence of float, optional
            Factors that multiply the u of each line of this budget, to study their effect.

        Returns
        -------
        Budget

        Raises
        ------
        HeightError
            For a dip outside the table.
        ValueError
            If the number of factors differs from the number of lines.
        """
        high_m = float(self.table.height_m[-1]) if high_m is None else high_m
        largest_m3 = self.straightness.largest_m3
        added = reading_sources(self.job.inputs, largest_m3) if reading else ()
        return budget(self.table, high_m, low_m, added, factors)

    @property
    def accepted(self) -> np.ndarray | None:
        """(m,) indices of the points that are of the wall; None where none were surveyed."""
        survey = self.wall or self.scan
        return None if survey is None else survey.accepted

    @property
    def gross(self) -> ShellVolume | None:
        """Surveyed shell without corrections (`volumes.ShellVolume`), or None for other tanks."""
        is_upright = self.job.tank.kind == "vertical"
        return shell_volume(next(iter(self.surveys.values()))) if is_upright else None

    @property
    def straps(self) -> "Straps | None":
        """Circumferences by tape and their tests against the wall; None without straps."""
        wall = self.wall or self.strapped or self.rings
        return None if wall is None else wall.straps

    @property
    def read(self) -> "ReadWall | None":
        """Wall with readings of tapes and reference lines; None without such readings."""
        return self.strapped if self.wall is None else self.wall.read

    @property
    def capacity(self) -> "pandas.DataFrame":
        """Capacity table with the U of all reports, in the columns of capacity.csv.

        The columns are height_m, volume_m3, u_m3 (standard uncertainty), k, U_m3, low_m3, high_m3
        and interval. The value of k is nan in rows whose U comes from Monte Carlo instead of k u.
        The column interval is "gum" or "monte_carlo" and states the origin of U. A tank with a
        floating roof has the additional column for_use.
        """
        import pandas  # slow to load and not needed for a result

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
        """Volume at a dip with its stated U (`capacity.Quantity`); HeightError outside."""
        return stated_volume(self.table, self.intervals, height_m)

    def in_service_m3(
        self,
        height_m: float,
        liquid_c: float,
        ambient_c: float | None = None,
        *,
        insulated: bool = False,
    ) -> float:
        """Volume at a dip for a shell at the temperature of its liquid, m3: V times CTSh.

        A tank that is a single solid expands in all directions (`service.solid_factor`).

        Parameters
        ----------
        height_m : float
            Dip, m.
        liquid_c : float
            Temperature of the liquid, degrees Celsius.
        ambient_c : float, optional
            Ambient temperature; required for a shell without insulation
            (`service.shell_temperature_c`).
        insulated : bool
            Whether the shell is insulated.

        Returns
        -------
        float
        """
        shell_c = shell_temperature_c(liquid_c, ambient_c, insulated=insulated)
        reference, expansion = self.job.table.reference_temperature_c, self.job.material
        expansion_per_k = expansion.expansion_per_k
        if self.job.tank.kind == "vertical":
            factor = shell_factor(shell_c, reference, expansion_per_k)
        else:
            levels = np.array([height_m + self.zero_m])
            factor = float(solid_factor(self.body, levels, shell_c, reference, expansion_per_k)[0])
        return self.at(height_m).value_m3 * factor

    def dip_of(self, volume_m3: float | np.ndarray) -> Dips:
        """Dips (n,) of volumes with their standard uncertainties (`dips.Dips`).

        Raises HeightError for a volume outside the table.
        """
        table = self.table
        return dips.dips_of(table.height_m, table.volume_m3, table.factor_m3, volume_m3)

    def at_ullage(self, ullage_m: float) -> Quantity:
        """Volume at an ullage, measured down from the reference point of the gauge.

        Raises HeightError outside the table, and if the job has no reference height.
        """
        reference = self.job.datum.reference_height_m
        if reference is None:
            raise HeightError(
                message("no_ullage", "no ullage; expected datum.reference_height_m in the job")
            )
        return self.at(float(dips.ullage_m(reference, ullage_m)))

    def ticket(self, settings, rows=None):
        """Quantity of a transfer or of a stock with its U, as `tankcal.ticket`.

        Parameters
        ----------
        settings : path or dict
            ticket.toml, or its content.
        rows : path, optional
            CSV file with a ticket in each row.

        Returns
        -------
        tankcal.products.quantity.reading.Tickets
        """
        # Products are above the results, so the function is named by a text.
        return import_module("tankcal.products.quantity.ticketing").ticket(self, settings, rows)

    def delivery(self, low_m: float, high_m: float) -> Quantity:
        """Volume between two dips with its own uncertainty; HeightError outside the table."""
        return stated_delivery(self.table, self.simulation, low_m, high_m)


MILLIMETRE, PARTS = 0.001, 10  # m; parts of a table step of 10 mm, for proportional parts
PARTS_OF_U, PARTS_M3 = 0.05, 0.0005  # largest error of proportional parts: share of U, or m3
UNBOUNDED_U_M3 = 1e12  # replaces an infinite U


def run(
    job: Job,
    progress: Callable[[str], None] | None = None,
    *,
    part_progress: Callable[[str, int, int], None] | None = None,
    simulated: bool | None = None,
    cluster: int | str | None = None,
) -> Result:
    """Compute a job: adjusted points, wall and axis, parts of the tank, table with covariance.

    Parameters
    ----------
    job : Job
        Job from `tankcal.load`.
    progress : callable, optional
        Called with a line of text at the start of each step.
    part_progress : callable, optional
        Called with (text, done, total) during a long step.
    simulated : bool, optional
        Whether the table is also simulated by Monte Carlo; None: according to the job. A table
        without any uncertainty is never simulated.
    cluster : int or str, optional
        Processes that read point clouds. None: this process; an integer: number of local workers;
        "local": as many as this machine has cores; "auto": local workers for large clouds; an
        address: the scheduler of a dask cluster. The result does not depend on it.

    Returns
    -------
    Result

    Raises
    ------
    InputError
        If a course has too few points, if clouds cannot be read, or if a cluster does not answer.
    SolutionError
        If the survey does not determine the points, the vertical or the scale, or if the points
        show no wall.
    TypeError
        If `job` is not a `Job`.

    Examples
    --------
    >>> import tankcal
    >>> result = tankcal.run(tankcal.load("examples/silva-1995"))
    >>> print(result.at(9.5))
    1249.7 m3, U = 1.5 m3 (k = 1.96)
    """
    _require_job(job, "run")
    with _problems_placed(job):
        return _run(job, progress or (lambda text: None), part_progress, simulated, cluster)


def _run(job, progress, part_progress, simulated, cluster):
    """`Result` of a job; parameters as `run`."""
    if job.tank is None:
        raise InputError(
            Problem(
                "job.toml",
                message("no_tank", "the job has no tank: only its survey can be adjusted"),
            )
        )
    original_job = job
    survey_result = find_survey(job, progress, cluster=cluster, part_progress=part_progress)
    job, survey, adjustment = survey_result.job, survey_result.survey, survey_result.adjustment
    # The table may be that of a supplement, such as metered liquid, which is adjusted first.
    method, supplement = supplement_of(job), None
    if method is not None:
        supplement = method.supplement(job, survey, progress)
    tabulation = compute_table(job, survey, progress, supplement and supplement.body)
    body, zero, table = tabulation.body, tabulation.zero_m, tabulation.table
    # Effect of overruled readings on the volume and the level of the top row.
    top = float(table.volume_m3[-1]), float(tabulation.levels_m[-1])
    overruled = effect_of(original_job, survey_result, *top, progress)
    progress(message("stating", "stating volumes and deliveries"))
    stated = statements(job, table, tabulation.straightness.largest_m3)
    simulation = None
    # The intervals of the law of propagation hold unless a simulation replaces them.
    intervals = gum_intervals(table.volume_m3, table.u_m3, table.U_m3)
    is_simulated = job.table.monte_carlo if simulated is None else simulated
    if is_simulated and table.sources:
        progress(SIMULATING)
        pairs = pairs_to_simulate(stated, job, body, table)
        simulation = simulate_table(job, survey, body, zero, table, pairs, progress=part_progress)
        intervals = simulation.intervals(table)
    supplemented = supplement and supplement.result(tabulation.levels_m)
    by_method = (
        method.correction_tables(job, survey, body, table, part_progress)
        for method in given_methods(job)
    )
    ship = next((tables for tables in by_method if tables is not None), None)
    surveys = (survey, getattr(survey, "surveyed", None), supplemented)
    return Result(
        job=job,
        surveys={found.surveyed_as: found for found in surveys if found is not None},
        body=body,
        zero_m=zero,
        table=table,
        straightness=tabulation.straightness,
        proportional_parts=_proportional_parts(job, tabulation, intervals.U_m3),
        corrections=_list_corrections(job, survey, tabulation, supplement),
        by_density=_volumes_by_density(job, survey, tabulation.levels_m, zero, supplement),
        on_high_legs=_table_on_high_legs(job, survey),
        stated=stated,
        simulation=simulation,
        intervals=intervals,
        rule=verdict_of(job, body, table, intervals, simulation),
        warnings=_collect_warnings(
            job,
            adjustment,
            survey_result.sighting,
            survey,
            tabulation,
            supplemented,
            overruled,
        ),
        adjustment=adjustment,
        sights=survey_result.sights,
        ship=ship,
        overrulings=overruled,
    )


def _collect_warnings(job, adjustment, sighting, survey, tabulation, supplemented, overruled):
    """All warnings of a job, each with its place in the input."""
    adjustment_warnings = of_supplement = ()
    if adjustment is not None:
        questions = open_questions(job, adjustment.datum, adjustment.causes)
        adjustment_warnings = (*adjustment.warnings, *questions, *_base_warnings(job, adjustment))
    if supplemented is not None:
        of_supplement = supplement_of(job).warnings(job, supplemented)
    warnings = (
        *job.warnings,
        *adjustment_warnings,
        *warn_of_overrulings(job, overruled),
        *check_table(job, survey, tabulation, sighting),
        *of_supplement,
        *incomplete_certificate(job),
    )
    return locate_in_book(job, warnings)


def _base_warnings(job, adjustment):
    """Warnings of the bases measured by stadia."""
    from tankcal.pipeline.checks import check_bases, check_rejected_bases

    rejected = check_rejected_bases(job.measurements, adjustment.readings)
    return (*check_bases(job.measurements), *rejected)


@contextmanager
def _problems_placed(job):
    """Add the place in the input to the problems of an InputError."""
    try:
        yield
    except InputError as error:
        raise InputError(locate_in_book(job, error.problems)) from error


def adjust_job(job: Job, progress: Callable[[str], None] | None = None) -> "Adjustment":
    """Adjust the survey of a job, with or without a tank.

    Parameters
    ----------
    job : Job
        Job from `tankcal.load`; `tankcal.load(path, only="adjustment")` for a job without a tank.
    progress : callable, optional
        Called with a line of text at the start of each step.

    Returns
    -------
    survey.Adjustment

    Raises
    ------
    InputError
        If the job has no measurements.
    SolutionError
        If the measurements do not determine the points.
    TypeError
        If `job` is not a `Job`.

    Examples
    --------
    >>> import tankcal
    >>> survey = tankcal.load("examples/total-station", only="adjustment")
    >>> adjusted = tankcal.adjust_job(survey)
    >>> len(adjusted.names), adjusted.xyz_m.shape == (len(adjusted.names), 3)
    (167, True)
    """
    _require_job(job, "adjust_job")
    if not job.has_network:
        raise InputError(
            Problem(
                "job.toml",
                message(
                    "no_measurements", "the job has no measurements: there is nothing to adjust"
                ),
            )
        )
    with _problems_placed(job):
        adjustment = adjust_decided(job, progress or (lambda text: None))
    warnings = (*adjustment.warnings, *_base_warnings(job, adjustment))
    return replace(adjustment, warnings=locate_in_book(job, warnings))


def _require_job(job, name):
    """Raise TypeError if `job` is not a `Job`; name: the function that was called."""
    if not isinstance(job, Job):
        raise TypeError(f"found {type(job).__name__}; expected a Job: {name}(tankcal.load(path))")


def _proportional_parts(job, tabulation, U_m3):
    """Proportional parts of a centimetre table, if their error is a small part of U.

    Only vertical tanks have proportional parts; other tanks give ().
    """
    spec = job.table
    is_centimetres = spec.step_m is not None and abs(spec.step_m - PARTS * MILLIMETRE) <= 1e-9
    if job.tank.kind != "vertical" or not is_centimetres:
        return ()
    # Interpolation must not cross a break of the volume curve: each part ends at a breakpoint.
    edges = np.unique(np.round([0.0, *tabulation.breakpoints_m, tabulation.top_m], 3))
    allowed = np.maximum(PARTS_OF_U * np.minimum(U_m3, UNBOUNDED_U_M3), PARTS_M3)

    def bound_m3(dips_m):
        return np.interp(dips_m, tabulation.table.height_m, allowed)

    return proportional_parts(tabulation.volume_m3, edges, spec.step_m, PARTS, bound_m3)


def _list_corrections(job, survey, tabulation, supplement):
    """Corrections of the table; the effect of a supplement is the last."""
    corrections = corrections_of(job, survey, tabulation.over_m)
    if supplement is None:
        return corrections
    gross = gross_at_top(job, survey, tabulation.over_m)
    top = float(tabulation.table.volume_m3[-1])
    by_supplement = supplement.correction(corrections, gross, top)
    return corrections if by_supplement is None else (*corrections, by_supplement)


def _table_on_high_legs(job, survey):
    """`Capacity` with the legs of a floating roof in their high position, or None."""
    roof = job.roof
    if roof is None or not job.switches.roof or roof.high_critical_bottom_m is None:
        return None
    raised = replace(
        roof,
        critical_bottom_m=roof.high_critical_bottom_m,
        critical_top_m=roof.high_critical_top_m,
    )
    return compute_table(replace(job, roof=raised), survey).table


def _volumes_by_density(job, survey, levels, zero_m, supplement):
    """Volumes at the rows of the table for each further density of the liquid.

    Density changes the liquid head and the draught of a floating roof.
    """
    volumes = {}
    for density in job.table.other_densities_kg_m3:
        filled = filled_with(job, density)
        if supplement is None:
            body = body_of(filled, survey, uncertain=False)
        else:
            body = supplement.body_for(density)
        volumes[density] = body.volume_m3(levels)
        refuse_falling(filled, body, zero_m, levels - zero_m, volumes[density])
    return volumes
