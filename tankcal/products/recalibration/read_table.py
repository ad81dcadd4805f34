"""Estimate the tank geometry from a former table and its courses: checks and dispatch."""

from dataclasses import dataclass, replace

import numpy as np

from tankcal.errors import InputError, Problem, SolutionError, TankcalError
from tankcal.job.tables import Log
from tankcal.messages import message
from tankcal.products.recalibration.former import read_courses
from tankcal.products.recalibration.reading import read_former
from tankcal.products.recalibration.seams import find_seams, find_seams_within
from tankcal.products.recalibration.solid_geometry import fit_lying, fit_sphere
from tankcal.products.recalibration.table_fit import find_computed_rows, row_sds
from tankcal.products.recalibration.table_job import (
    make_record_job,
    make_solid_job,
    make_upright_job,
    read_recorded,
)
from tankcal.products.recalibration.upright_geometry import (
    DECLARED_SD_KG_M3,
    STEEL_PA,
    is_possible,
    read_upright,
)
from tankcal.products.recalibration.upright_shell import largest_bulge_m

FEWEST_ROWS = 8
SOLIDS = "horizontal", "sphere"
# Ratio of residuals of equally good fits, and smallest distance of a seam from a declared one.
AS_GOOD, OTHER_PLACE_M = 1.05, 0.1
LONG_M = 1.0  # height above which a fitting may be a misplaced seam
ABOVE_M = 0.02  # largest height of a table above its courses
WORST_FIT = 5e-3  # largest rms residual over the highest volume of a table of this tank
LARGE_SHARE = 2e-3  # smallest share of the volume of a fitting that may be a roof


@dataclass(frozen=True)
class TableRead:
    """Geometry estimated from a table.

    Attributes
    ----------
    former : FormerTable
    geometry : UprightGeometry, RecordedRadii, LyingGeometry or SolidFit
    names : tuple of str
        Names of the courses.
    job : JobFiles
    warnings : tuple of Message
    """

    former: object
    geometry: object
    names: tuple[str, ...]
    job: object
    warnings: tuple


def read_table(
    path, courses_path=None, former_toml=None, *, kind=None, e_pa=STEEL_PA, bottom_m=None
):
    """Estimate the geometry of a tank from a former table.

    Parameters
    ----------
    path : path
        The table. The radii of a record.json are used as they are in the record.
    courses_path : path or None
        courses.csv: course, height_m (blank: estimated from the table), thickness_mm. None for a
        record, a lying tank and a sphere.
    former_toml : path or None
        former.toml with other facts about the table.
    kind : {"vertical", "horizontal", "sphere"} or None
        None: the kind in former.toml or in the record, else upright.
    e_pa : float
        Young's modulus of the shell.
    bottom_m : float or None
        Dip of the highest point of the bottom; None: estimated.

    Returns
    -------
    TableRead

    Raises
    ------
    InputError
        With all problems of table and courses.
    SolutionError
        If the table does not determine its tank.

    Examples
    --------
    >>> import tempfile
    >>> from pathlib import Path
    >>> import numpy as np
    >>> from tankcal.products.recalibration.read_table import read_table
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     table, courses = Path(folder, "old.csv"), Path(folder, "courses.csv")
    ...     rows = [f"{dip / 100:.2f},{np.pi * 36 * dip / 100:.3f}" for dip in range(301)]
    ...     size = table.write_text("\\n".join(["height_m,volume_m3", *rows]))
    ...     size = courses.write_text("course,height_m,thickness_mm\\n1,1.5,8\\n2,1.5,6\\n")
    ...     read = read_table(table, courses)
    >>> read.geometry.radii_m.round(4).tolist(), read.geometry.head
    ([6.0, 6.0], 'without')
    """
    log = Log()
    former = _read_former(path, former_toml, log)
    kind = kind or (former.kind if former else None) or "vertical"
    if kind in SOLIDS:  # no courses are needed, whether or not the table can be read
        log.stop_if_problems()
        return _read_solid(former, kind)
    if former is not None and former.record is not None:
        log.stop_if_problems()
        radii = read_recorded(former)
        job = make_record_job(former, radii, tank_id=_tank_id(former))
        return TableRead(
            former, radii, radii.names, job, tuple(_missing_value_warnings(former, 0.0))
        )
    courses = None
    if courses_path is None:
        expected = message("read_no_courses_file", "missing; expected --courses courses.csv")
        log.problem("--courses", expected)
    else:
        courses = read_courses(courses_path, log)
    if former is not None:
        _check_kind(former, kind, log)
        _check_bottom(former, bottom_m, log)
    log.stop_if_problems()
    _check_heights(former, courses)
    computed = find_computed_rows(former)
    if computed is not None:
        read = _read_computed_rows(former, computed, courses, e_pa, bottom_m)
        if read is not None:
            return read
    return _read_rows(former, former, courses, e_pa, bottom_m)


def _check_heights(former, courses):
    """Refuse courses within which the table shows several seams."""
    heights = courses.heights_m
    if np.isnan(heights).any():
        return
    within = find_seams_within(former.height_m, former.volume_m3, row_sds(former), heights)
    problems = []
    for number, seams in within.items():
        expected = message(
            "read_seams_within",
            "course {name}: found {height:g} m, but the cross-section of the table changes at "
            "{seams} m, within this course; expected the height of one course",
            name=courses.names[number],
            height=float(heights[number]),
            seams=[f"{seam:.2f}" for seam in seams],
        )
        problems.append(Problem(courses.file, expected, number + 2, "height_m"))
    if problems:
        raise InputError(problems)


def _read_computed_rows(former, computed, courses, e_pa, bottom_m):
    """Return the TableRead of computed rows; None if each row may have been computed."""
    try:
        read = _read_rows(former, computed.table(former), courses, e_pa, bottom_m)
    except TankcalError:
        if computed.is_certain:
            raise
        return None
    if not computed.is_confirmed(former, read.geometry.state, row_sds(former)):
        return None
    text = message(
        "read_proportional_parts",
        "the rows between multiples of {step:g} m are linear (proportional parts): only the rows "
        "every {step:g} m are read ({count} of {rows})",
        step=round(computed.step_m, 6),
        count=len(computed.rows),
        rows=len(former.height_m),
    )
    return replace(read, warnings=(text, *read.warnings))


def _read_former(path, former_toml, log):
    try:
        return read_former(path, former_toml)
    except InputError as error:
        log.problems += error.problems
        return None


def _read_solid(former, kind):
    geometry = fit_sphere(former) if kind == "sphere" else fit_lying(former, former.dip_from_a_m)
    fit = geometry if kind == "sphere" else geometry.best
    share = fit.rms_m3 / former.volume_m3[-1]
    if fit.variance_factor > 1 and share > WORST_FIT:
        raise SolutionError(
            message(
                "read_other_solid",
                "the rows of {name} depart by {percent:.2g} % of the highest volume (rms) from any "
                "tank of kind {kind}; expected a table of such a tank (--kind)",
                name=str(former.name),
                percent=100 * share,
                kind=kind,
            )
        )
    job = make_solid_job(former, fit, tank_id=_tank_id(former))
    return TableRead(
        former,
        geometry,
        (),
        job,
        (*_solid_warnings(geometry), *_missing_value_warnings(former, 0.0)),
    )


def _solid_warnings(geometry):
    fit = getattr(geometry, "best", geometry)
    if fit.variance_factor > 1:
        yield message(
            "read_rough_solid",
            "the rows depart by {rms:.3g} L (rms) from such a tank, more than rounding leaves; u "
            "is by what they leave",
            rms=1000 * fit.rms_m3,
        )
    if fit.zero_depth_m:
        yield message(
            "read_below_bottom",
            "dips of the table count from {below:.3g} mm below the inside bottom; those of the job "
            "count from the bottom: they are less by that",
            below=1000 * fit.zero_depth_m,
        )
    others = getattr(geometry, "equally_good_ends", ())
    if others:
        yield message(
            "read_other_ends",
            "these ends fit as well: {ends}",
            ends=[name.replace("_", " ") for name in others],
        )


def _check_kind(former, kind, log):
    if kind != "vertical":
        expected = message(
            "read_other_kind",
            "of a tank of kind {kind}; expected an upright or lying one, or a sphere",
            kind=kind,
        )
        log.problem(former.name, expected)
    if len(former.height_m) < FEWEST_ROWS:
        expected = message(
            "read_few_rows",
            "{count} rows; expected {fewest} or more to read radii from",
            count=len(former.height_m),
            fewest=FEWEST_ROWS,
        )
        log.problem(former.name, expected)


def _check_bottom(former, bottom_m, log):
    above = 0 if bottom_m is None else np.count_nonzero(former.height_m >= bottom_m)
    if bottom_m is not None and above < FEWEST_ROWS:
        expected = message(
            "read_high_bottom",
            "{bottom:.6g} m: {count} rows from there on; expected {fewest} or more",
            bottom=bottom_m,
            count=int(above),
            fewest=FEWEST_ROWS,
        )
        log.problem("--bottom", expected)


def _select_courses(former, courses):
    """Return the courses within the table, warnings, and whether the seams are known."""
    heights = courses.heights_m
    unknown = np.isnan(heights)
    last = float(former.height_m[-1])
    if unknown.any() and not unknown.all():
        expected = message(
            "read_some_heights",
            "given for some courses; expected the heights of all of them, or of none",
        )
        raise InputError(Problem(courses.file, expected, None, "height_m"))
    if unknown.all():
        return _find_course_heights(former, courses), (), False
    total = float(np.sum(heights))
    if total < last - (0.35 + ABOVE_M if former.height_m[0] == 0 else ABOVE_M):
        expected = message(
            "read_courses_end",
            "the courses reach {total:.4g} m, the table {last:.4g} m; expected courses up to the "
            "last row",
            total=total,
            last=last,
        )
        raise InputError(Problem(courses.file, expected, None, "height_m"))
    tops = np.cumsum(heights)
    step = float(np.median(np.diff(former.height_m)))
    reached = int(np.searchsorted(tops - heights, last - 2.5 * step, "right"))
    if reached == len(heights):
        return courses, (), True
    text = message(
        "read_not_reached",
        "the table ends at {last:.4g} m: nothing can be read of the courses above number {count}, "
        "and the job ends there",
        last=last,
        count=reached,
    )
    return courses.first(reached), (text,), True


def _find_course_heights(former, courses):
    """Return the courses with heights from the seams that the table shows."""
    count = len(courses.names)
    seams = find_seams(former.height_m, former.volume_m3, row_sds(former), count - 1)
    if len(seams) < count - 1:
        expected = message(
            "read_seams_missing",
            "the table shows {found} of {wanted} seams; expected the heights of the courses",
            found=len(seams),
            wanted=count - 1,
        )
        raise InputError(Problem(courses.file, expected, None, "height_m"))
    edges = np.concatenate([[0.0], seams, [former.height_m[-1]]])
    return replace(courses, heights_m=np.diff(edges))


def _read_rows(former, chosen, courses, e_pa, bottom_m):
    """Return the TableRead of a FormerTable from selected rows, given as a FormerTable."""
    courses, warnings, seams_known = _select_courses(chosen, courses)
    geometry = read_upright(
        chosen,
        courses.heights_m,
        courses.thickness_m,
        modulus_pa=e_pa,
        lowest_m=bottom_m,
        seams_known=seams_known,
    )
    u_common = _u_common_m(former, geometry)
    job = make_upright_job(
        former, geometry, courses.names, u_common_m=u_common, e_pa=e_pa, tank_id=_tank_id(former)
    )
    if seams_known:
        warnings = (*warnings, *_seam_warnings(chosen, courses, geometry, e_pa, bottom_m))
    messages = (
        *warnings,
        *_geometry_warnings(former, geometry, seams_known),
        *_missing_value_warnings(former, u_common),
    )
    return TableRead(former, geometry, courses.names, job, messages)


def _seam_warnings(former, courses, geometry, e_pa, bottom_m):
    """Warn if other seams explain the residuals with fewer fittings than the declared seams."""
    declared = np.cumsum(geometry.heights_m)[:-1]
    doubtful = [
        fitting
        for fitting in geometry.fittings
        if _may_be_seams(fitting, declared + geometry.zero_m.value)
    ]
    is_bulged = geometry.state.bulges_m is not None  # profiles absorb the effect of displaced seams
    is_doubtful = is_bulged or doubtful or geometry.roughness > 1
    if geometry.seams_source == "found" or not is_doubtful:
        return
    try:
        alternative = read_upright(
            former,
            _find_course_heights(former, courses).heights_m,
            courses.thickness_m,
            modulus_pa=e_pa,
            lowest_m=bottom_m,
            seams_known=False,
        )
    except TankcalError:  # no solution with other seams: the declared seams are kept
        return
    seams = np.cumsum(alternative.heights_m)[:-1]
    is_simpler = (
        len(alternative.fittings) < len(geometry.fittings)
        or geometry.roughness > alternative.roughness
    )
    if is_bulged:
        is_simpler = alternative.state.bulges_m is None
    is_as_good = alternative.rms_m3 <= AS_GOOD * max(geometry.rms_m3, geometry.expected_m3)
    if is_simpler and is_as_good and np.any(abs(seams - declared) > OTHER_PLACE_M):
        yield message(
            "read_doubtful_seams",
            "the seams of courses.csv ({declared} m above the bottom) do not fit the table: with "
            "seams at {seams} m less is left over, or in the tank; check the heights of the "
            "courses, what is told of things in the tank may be none",
            declared=[f"{seam:.2f}" for seam in declared],
            seams=[f"{seam:.2f}" for seam in seams],
        )


def _may_be_seams(thing, seams):
    """Whether a fitting is long or ends at a declared seam, so that it may be a displaced seam."""
    ends = np.array([thing.bottom_m.value, thing.top_m.value])
    return ends[1] - ends[0] > LONG_M or np.any(abs(ends[:, None] - seams) < OTHER_PLACE_M)


def _u_common_m(former, geometry):
    """Common standard uncertainty of all radii, from U of the former table, m; 0 if unknown."""
    if former.U_m3 is None:
        return 0.0
    upper = former.height_m > 0.5 * former.height_m[-1]
    relative = np.median(former.U_m3[upper] / former.volume_m3[upper]) / former.k
    return float(relative * np.mean(geometry.radii_m) / 2)


def _tank_id(former):
    if former.record is not None:
        return former.record["job"]["tank"]["id"]
    return str(former.name).partition(",")[0].rpartition(".")[0] or "tank"


def _geometry_warnings(former, geometry, seams_known):
    """Messages about the geometry that the user must consider before using the radii."""
    if geometry.roughness > 1:
        yield message(
            "read_rough",
            "the rows depart by {rms:.3g} L (rms) from such a tank, rounding leaves {expected:.3g} "
            "L: there is more in this table than courses, head and things in the tank; u is "
            "{factor:.3g} times that of rounding",
            rms=1000 * geometry.rms_m3,
            expected=1000 * geometry.expected_m3,
            factor=geometry.roughness,
        )
    yield from _density_warnings(former.liquid_density_kg_m3, geometry)
    if geometry.state.bulges_m is not None:
        yield message(
            "read_bulges",
            "the courses bulge, up to {largest:.2g} mm from their mean radius: profiles of the "
            "courses are estimated, too, and less is known of head, zero and things in the tank",
            largest=1000 * largest_bulge_m(geometry.state.bulges_m),
        )
    if geometry.seams_source == "found" and seams_known:
        yield message(
            "read_other_seams",
            "the seams are not where courses.csv has them; the radii are for the seams that were "
            "found",
        )
    total = float(former.volume_m3[-1])
    for fitting in geometry.fittings:
        if -fitting.volume_m3.value > LARGE_SHARE * total and former.roof is None:
            yield message(
                "read_like_roof",
                "{volume:.4g} m3 less from {bottom:.3f} to {top:.3f} m: is that a floating roof? "
                "Its mass is needed then ([roof] of former.toml)",
                volume=-fitting.volume_m3.value,
                bottom=fitting.bottom_m.value,
                top=fitting.top_m.value,
            )


def _density_warnings(declared, geometry):
    """Compare the estimated density of the head with liquids and with the declared density."""
    density = geometry.density_kg_m3
    held = geometry.state.density_kg_m3
    if not is_possible(density):
        yield message(
            "read_strange_density",
            "the rows alone give a head of {found:.0f} kg/m3, u {u:.2g} kg/m3, that of no liquid: "
            "check height_m and thickness_mm of courses.csv; the job has {held:.0f} kg/m3",
            found=density.value,
            u=density.u,
            held=held,
        )
    value = 0.0 if geometry.head == "without" else density.value
    if declared is None or abs(declared - value) <= 3 * density.u + 0.001 * declared:
        return
    if abs(held - declared) <= 3 * DECLARED_SD_KG_M3:
        yield message(
            "read_held_density",
            "declared is a head of {declared:g} kg/m3; the rows alone give {found:.0f}, u {u:.2g} "
            "kg/m3, but they have more in them than courses and head: the job has {held:.0f} kg/m3",
            declared=declared,
            found=value,
            u=density.u,
            held=held,
        )
        return
    yield message(
        "read_other_density",
        "declared is a head of {declared:g} kg/m3; the table was made with {found:.0f}, u "
        "{u:.2g} kg/m3",
        declared=declared,
        found=value,
        u=density.u,
    )


def _missing_value_warnings(former, u_common):
    """Messages about values that the job lacks because they are not declared."""
    if former.record is None and u_common == 0:
        yield message(
            "read_no_U",
            "the uncertainty of the former table is not known: the job has that of reading alone "
            "(u_common_mm in job.toml, or U and k in former.toml)",
        )
    if former.reference_temperature_c is None:
        yield message(
            "read_no_temperature",
            "the temperature of the former table is not known: job.toml has 20 degrees Celsius",
        )
    if former.date is None:
        yield message(
            "read_no_date",
            "the date of the former survey is not known: job.toml has the day of today",
        )
