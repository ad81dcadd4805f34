"""The main job on one screen: a checked job in; wall, parts and the capacity table out."""

from dataclasses import dataclass, replace

import numpy as np
import pandas as pd

from tankcal import dips
from tankcal.body import Body
from tankcal.capacity import Capacity
from tankcal.corrections import Correction, corrections_of
from tankcal.dips import (
    HEIGHT_STEPS_M,
    LADDERS_M,
    ProportionalParts,
    Straightness,
    choose_rows,
    interpolation_errors,
    proportional_parts,
    table_heights,
)
from tankcal.doubts import incomplete, of_adjustment, refuse_undetermined
from tankcal.errors import HeightError, InputError, Problem, SolutionError
from tankcal.job import Job
from tankcal.meshes import parse_mesh
from tankcal.scan import Scan, scanned
from tankcal.service import shell_factor, shell_temperature_c
from tankcal.surveys import Adjustment, adjust_survey, wall_points
from tankcal.tanks import body_of, critical_zone, shell_volume, zero_height
from tankcal.wall import Wall, among_themselves, find_wall, warnings_of

MILLIMETRE, PARTS = 0.001, 10  # of a step of the tables that proportional parts are for
TOLD = 10  # warnings of the adjustment that are told when there is no wall
NOMINAL_MISS = 0.05  # of the nominal volume, from which on one of the two is in doubt


@dataclass(frozen=True, repr=False)
class Result:
    """Everything that a job gave; `capacity` is the table as a DataFrame.

    job          as it was computed: the points are in it, too, where they came from an adjustment
    wall         the surveyed wall of a vertical tank (`wall.Wall`); None for other kinds
    scan         what points say of a lying cylinder or a sphere (`scan.Scan`), else None
    body         the tank as the sum of its parts, with all corrections that are on (`body.Body`)
    zero_m       level of the table's zero: dip 0 in the frame of the parts
    straightness how far linear interpolation between the rows is from the exact volume
    proportional_parts  what millimetres add to a row, zone by zone; () for no centimetre table
    corrections  each with its size at the top row
    by_density   {density kg/m3: (rows,) volumes}: the same table for other densities
    adjustment   the adjusted survey (`surveys.Adjustment`); None where points were handed in
    """

    job: Job
    wall: Wall | None
    scan: Scan | None
    body: Body
    zero_m: float
    table: Capacity
    straightness: Straightness
    proportional_parts: tuple[ProportionalParts, ...]
    corrections: tuple[Correction, ...]
    by_density: dict
    warnings: tuple[Problem, ...]
    adjustment: Adjustment | None = None

    def __repr__(self):
        top = self.at(self.table.height_m[-1])
        points = ""
        if self.accepted is not None:
            points = f", {len(self.accepted)} of {len(self.job.points.names)} points"
        return (
            f"<tankcal.Result of {self.job.tank.id}: {top.value_m3:.3f} m3 at "
            f"{self.table.height_m[-1]:.3f} m, U = {top.U_m3:.3f} m3 (k = {top.k:.2f}){points}>"
        )

    @property
    def accepted(self):
        """(m,) indices of the points that are of the wall; None where none were surveyed."""
        found = self.wall or self.scan
        return None if found is None else found.accepted

    @property
    def gross(self):
        """The shell as surveyed, without any correction (`volumes.ShellVolume`); else None."""
        if self.wall is None:
            return None
        return shell_volume(self.job.courses, self.wall.joints_m, self.wall.sections)

    @property
    def capacity(self):
        """The capacity table: height_m, volume_m3, u_m3, k, U_m3; with a floating roof for_use."""
        table = self.table
        columns = {
            "height_m": table.height_m,
            "volume_m3": table.volume_m3,
            "u_m3": table.u_m3,
            "k": table.k,
            "U_m3": table.U_m3,
        }
        if table.critical_m is not None:
            columns["for_use"] = table.for_use(table.height_m)
        return pd.DataFrame(columns)

    def at(self, height_m):
        """Volume at a dip, with its uncertainty (`capacity.Quantity`); HeightError outside."""
        return self.table.at(height_m)

    def in_service_m3(self, height_m, liquid_c, ambient_c=None, *, insulated=False):
        """Volume at a dip of a shell that the liquid keeps at another temperature: V times CTSh.

        ambient_c  needed for a shell that is not insulated (`service.shell_temperature_c`)
        """
        shell_c = shell_temperature_c(liquid_c, ambient_c, insulated=insulated)
        reference, expansion = self.job.table.reference_temperature_c, self.job.material
        factor = shell_factor(shell_c, reference, expansion.expansion_per_k)
        return self.at(height_m).value_m3 * factor

    def dip_of(self, volume_m3):
        """(n,) dips of volumes, with their standard uncertainties (`dips.Dips`); HeightError."""
        table = self.table
        return dips.dips_of(table.height_m, table.volume_m3, table.factor_m3, volume_m3)

    def at_ullage(self, ullage_m):
        """Volume at an ullage, measured down from the reference point of the gauge.

        Raises HeightError outside the table, and without a reference height in the job.
        """
        reference = self.job.datum.reference_height_m
        if reference is None:
            raise HeightError("no ullage without datum.reference_height_m in the job")
        return self.at(float(dips.ullage_m(reference, ullage_m)))

    def delivery(self, low_m, high_m):
        """Volume between two dips, with its own uncertainty; HeightError outside."""
        return self.table.delivery(low_m, high_m)


def run(job, progress=None):
    """Compute a job: adjusted points, wall and axis, parts of the tank, table with covariance.

    progress  called with a line of text as each step begins
    Raises InputError when a course is left with too few points, SolutionError when the survey does
    not determine the points, the vertical or the scale or when there is no wall, TypeError for
    anything but a `Job`.
    """
    _refuse_other(job, "run")
    if job.tank is None:
        raise InputError(Problem("job.toml", "no tank: only its survey can be adjusted"))
    tell = progress or (lambda text: None)
    adjustment = None
    if job.measurements is not None:
        job, adjustment = _adjusted(job, tell)
    try:
        survey = _survey(job, tell, np.inf if adjustment is None else adjustment.dof)
    except SolutionError as error:
        if adjustment is None or not adjustment.warnings:
            raise
        told = map(str, adjustment.warnings[:TOLD])
        raise SolutionError("\n".join([str(error), *told])) from error
    wall = survey if isinstance(survey, Wall) else None
    tell("integrating volumes")
    body = body_of(job, survey)
    zero = zero_height(job, survey)
    tell("propagating the covariance to every row of the table")

    def exact(dips_m):
        return body.volume_m3(_levels(dips_m, zero, body))

    top = body.highest_m - zero
    kinks = np.unique([kink - zero for kink in body.kinks_m if 0 < kink - zero < top])
    heights = _rows(job.table, exact, top, kinks)
    levels = _levels(heights, zero, body)
    volume, area, sources = body.rows(levels)
    table = Capacity(
        height_m=heights,
        volume_m3=volume,
        area_m2=area,
        sources=sources,
        probability=job.table.coverage_probability,
        critical_m=critical_zone(job),
    )
    return Result(
        job=job,
        wall=wall,
        scan=survey if isinstance(survey, Scan) else None,
        body=body,
        zero_m=zero,
        table=table,
        straightness=interpolation_errors(exact, heights, kinks),
        proportional_parts=() if wall is None else _parts(job.table, exact, top, kinks),
        corrections=corrections_of(job, survey),
        by_density=_by_density(job, survey, levels),
        warnings=(
            *job.warnings,
            *(
                ()
                if adjustment is None
                else (*adjustment.warnings, *of_adjustment(job, adjustment))
            ),
            *(warnings_of(job, wall) if wall is not None else ()),
            *incomplete(job, body.undeclared()),
            *_against_nominal(job, table),
        ),
        adjustment=adjustment,
    )


def adjust_job(job, progress=None):
    """Adjust the survey of a job, whether it has a tank or not: a `surveys.Adjustment`.

    progress  called with a line of text as each step begins
    Raises InputError when nothing was measured, SolutionError when the measurements do not
    determine the points, TypeError for anything but a `Job`.
    """
    _refuse_other(job, "adjust_job")
    if job.measurements is None:
        raise InputError(Problem("job.toml", "no measurements: there is nothing to adjust"))
    return adjust_survey(job.measurements, progress or (lambda text: None))


def _refuse_other(job, name):
    if not isinstance(job, Job):
        raise TypeError(f"found {type(job).__name__}; expected a Job: {name}(tankcal.load(path))")


def _adjusted(job, tell):
    """The job with the points of its adjusted survey, and the adjustment."""
    if job.points is not None and not job.points.from_adjustment:
        expected = "given beside a survey; expected one of them: the points are adjusted from it"
        raise InputError(Problem("points.csv", expected))
    adjustment = adjust_survey(job.measurements, tell)
    refuse_undetermined(adjustment.datum)
    points = wall_points(adjustment, job.measurements, job.survey.side)
    return replace(job, points=among_themselves(points)), adjustment


def _survey(job, tell, dof):
    """What was surveyed: a wall of courses, a mesh, the scan of another wall; None: sizes alone."""
    if job.tank.kind == "vertical":
        return find_wall(job, tell, dof)
    if job.mesh is not None:
        tell(f"checking the mesh {job.mesh.file}")
        return parse_mesh(job.mesh.file, job.mesh.data, job.mesh.unit_m)
    if job.points is not None:
        tell(f"fitting the wall to {len(job.points.names)} points")
        return scanned(job, dof)
    return None


def _levels(heights_m, zero_m, body):
    """Levels of dips in the frame of the parts; the top is the top, whatever its last bit is."""
    return np.minimum(heights_m + zero_m, body.highest_m)


def _rows(spec, exact, top_m, kinks_m):
    """Dips of the rows: by the step asked for, or by the bound on linear interpolation."""
    step = spec.step_m
    if step is None and spec.height_unit != "m":
        step = float(HEIGHT_STEPS_M[spec.height_unit])
    if spec.max_interpolation_error_m3 is not None:
        return choose_rows(
            exact,
            top_m,
            spec.max_interpolation_error_m3,
            kinks_m,
            step_m=step,
            ladder_m=LADDERS_M[spec.height_unit],
        ).height_m
    return table_heights(step, top_m, spec.fine_step_m, spec.fine_zones)


def _parts(spec, exact, top_m, kinks_m):
    if spec.step_m is None or abs(spec.step_m - PARTS * MILLIMETRE) > 1e-9:
        return ()
    return proportional_parts(exact, [0.0, *kinks_m, top_m], spec.step_m, PARTS)


def _by_density(job, survey, levels):
    """The same rows for each further density of the liquid."""
    return {
        density: body_of(
            replace(job, table=replace(job.table, liquid_density_kg_m3=density)),
            survey,
            uncertain=False,
        ).volume_m3(levels)
        for density in job.table.other_densities_kg_m3
    }


def _against_nominal(job, table):
    """A warning when the capacity is far from the nominal volume."""
    nominal = job.tank.nominal_volume_m3
    if nominal is None or abs(table.volume_m3[-1] / nominal - 1) <= NOMINAL_MISS:
        return ()
    text = (
        f"the capacity is {table.volume_m3[-1]:.6g} m3, tank.nominal_volume_m3 is {nominal:g}: "
        f"they differ by {100 * abs(table.volume_m3[-1] / nominal - 1):.0f} %"
    )
    return (Problem("job.toml", text, column="tank.nominal_volume_m3"),)
