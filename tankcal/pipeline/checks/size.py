"""Comparison of the surveyed size of a tank with its drawing, by one rule for all methods.

An offset, a scale or a unit that is wrong in all readings of a survey affects only the size.
"""

from dataclasses import dataclass

import numpy as np

from tankcal.errors import InputError, Problem
from tankcal.job.plausibility import (
    CIRCUMFERENCE_MISS,
    CIRCUMFERENCE_SDS,
    IMPOSSIBLE_MISFIT,
    IMPOSSIBLE_MISS,
    INSIDE,
    MISFIT,
    MISFIT_M,
    MISFIT_SDS,
    NEAR_WALL,
    OFF_SHELL,
    OFF_SHELL_M,
    OFF_SHELL_POINTS,
    PLATE_ON_BOTTOM,
    PLATE_ON_BOTTOM_M,
    PLATES_TO_INSIDE,
    reference_doubt,
    side_doubt,
    unit_guess,
)
from tankcal.messages import list_some, message
from tankcal.methods.base import given_methods, method_of
from tankcal.pipeline.checks import limits_of, origin_of
from tankcal.pipeline.wall_straps import mean_radii

SHOWN = 5  # courses named in a message
NEAR_FOOT_M = 0.3  # largest distance of a point that represents the wall at the foot of the dip


@dataclass(frozen=True)
class InsideRadii:
    """Surveyed inside radii to compare with a drawing.

    Attributes
    ----------
    names : tuple of str
        Names of the n courses or rings; a single "" for a shape with one radius.
    radius_m : ndarray, shape (n,)
        Inside radii, m.
    plate_m : ndarray, shape (n,)
        Plate thicknesses including paint, m.
    sd_m : ndarray, shape (n,)
        Standard uncertainties of the radii, m; 0 where negligible beside the allowance of a
        drawing.
    has_single_checks : bool
        Whether single courses are compared if the whole tank agrees with the drawing.
    """

    names: tuple[str, ...]
    radius_m: np.ndarray
    plate_m: np.ndarray
    sd_m: np.ndarray
    has_single_checks: bool = False


def allowed_departure_m(job, sd_m=0.0):
    """Largest accepted difference between a surveyed and a nominal inside radius, m.

    Parameters
    ----------
    job : Job
        Job with a nominal diameter.
    sd_m : float
        Standard uncertainty of the surveyed radius, m.
    """
    limits, within = limits_of("nominal_size"), job.diameter_within_m
    share = limits["share"] * job.tank.nominal_diameter_m
    return max(share, within or 0.0) / 2 + limits["sds"] * sd_m


def nominal_radius_m(job, plate_m):
    """Nominal inside radius, m, for a first course of thickness `plate_m` including paint.

    A nominal diameter of unstated kind is taken as the inside diameter.
    """
    return job.tank.nominal_diameter_m / 2 - PLATES_TO_INSIDE[job.diameter_is or INSIDE] * plate_m


def departure_of_size(job, inside_m, plate_m, sd_m=0.0):
    """Difference between an inside radius and the nominal one, m; 0 within the allowance.

    A nominal diameter of unstated kind may be the outside diameter. The difference is then taken to
    the nearer of the two.

    Parameters
    ----------
    job : Job
        Job with a nominal diameter.
    inside_m, plate_m, sd_m : float
        Inside radius, plate thickness including paint, and standard uncertainty of the radius, m.

    Returns
    -------
    float
    """
    nominal = nominal_radius_m(job, plate_m)
    # An unstated diameter may be inside or outside, so any radius between the two is accepted.
    least = nominal if job.diameter_is is not None else nominal - plate_m
    miss = inside_m - min(max(inside_m, least), nominal)
    return miss if abs(miss) > allowed_departure_m(job, sd_m) else 0.0


def inside_radii(job, survey):
    """`InsideRadii` of a survey; None if the survey determines no size.

    Parameters
    ----------
    job : Job
    survey : Wall, StrappedWall, RingedWall, RadiiWall, Scan, mesh, survey of a method, or None
        Object whose `surveyed_as` names the kind of survey.
    """
    kind = None if survey is None else survey.surveyed_as
    if kind == "wall":
        plates = np.array([course.thickness_m + course.paint_m for course in job.courses])
        radius = mean_radii(survey.field) - plates * (job.survey.side == "outside")
        return radii_of_courses(job, radius, _sds_of_courses(survey, len(radius)))
    if kind == "scan":
        plate = (job.horizontal or job.sphere).thickness_m
        diameter = dict(zip(survey.names, survey.values, strict=True))["diameter"]
        return single_radius(diameter / 2 - plate * (job.survey.side == "outside"), plate)
    method = method_of(survey)
    return None if method is None else method.inside_radii(job, survey)


def radii_of_courses(job, radius_m, sd_m=0.0):
    """`InsideRadii` of the courses of a job, with radii (courses,) and their uncertainties, m."""
    plates = np.array([course.thickness_m + course.paint_m for course in job.courses])
    names = tuple(course.name for course in job.courses)
    sds = np.broadcast_to(sd_m, plates.shape)
    return InsideRadii(names, radius_m, plates, sds, has_single_checks=True)


def single_radius(radius_m, plate_m):
    """`InsideRadii` of a shape with one radius of negligible uncertainty."""
    values = (np.array([float(value)]) for value in (radius_m, plate_m, 0.0))
    return InsideRadii(("",), *values)


def _sds_of_courses(wall, count):
    """Standard uncertainty of the mean radius of each course from its circles, m."""
    sd_m = np.zeros(count)
    for course in range(count):
        circles = [section.circle for section in wall.sections if section.group.course == course]
        if circles:
            sd_m[course] = np.sqrt(np.mean([circle.cofactor_m2[2, 2] for circle in circles]))
    return sd_m


def refuse_other_size(job, survey):
    """Raise InputError for a surveyed size so far from the drawing that a unit must be wrong."""
    surveyed, nominal = inside_radii(job, survey), job.tank.nominal_diameter_m
    if surveyed is None or nominal is None:
        return
    ratio = 2 * surveyed.radius_m / nominal
    wrong = np.flatnonzero((ratio > 1 + IMPOSSIBLE_MISS) | (ratio < 1 / (1 + IMPOSSIBLE_MISS)))
    if len(wrong) == 0:
        return
    names = [surveyed.names[place] for place in wrong]
    is_whole = len(wrong) == len(ratio)
    worst = wrong[int(np.argmax(np.abs(np.log(np.maximum(ratio[wrong], 1e-6)))))]
    text = message(
        "size_in_other_unit",
        "found {nominal_m:g} m, but the survey gives {found_m:.4g} m {where}; expected diameters"
        " within {percent:g} %{guess}",
        nominal_m=nominal,
        found_m=2 * float(np.median(surveyed.radius_m) if is_whole else surveyed.radius_m[worst]),
        where=_where([] if is_whole else names),
        percent=100 * IMPOSSIBLE_MISS,
        guess=unit_guess(float(np.median(ratio) if is_whole else ratio[worst])),
    )
    raise InputError(Problem("job.toml", text, column="tank.nominal_diameter_m"))


def _where(names):
    if not names:
        return message("size_inside", "inside")
    return message("size_of_course", "inside course {course!r}", course=names[0])


def check_size(job, survey):
    """`Problem`s for a surveyed size that differs from the drawing by more than the allowance.

    Straps, sights to a bare wall and great circles have checks of their own for the whole tank, by
    the same rule.
    """
    surveyed = inside_radii(job, survey)
    if surveyed is None or job.tank.nominal_diameter_m is None:
        return
    plate = float(surveyed.plate_m[0])
    median_m = float(np.median(surveyed.radius_m))
    miss = departure_of_size(job, median_m, plate, float(np.median(surveyed.sd_m)))
    if miss:
        if not _has_own_line(job, survey):
            yield _unlike_drawing(job, median_m, miss)
        return
    if not surveyed.has_single_checks or len(surveyed.names) == 1:
        return
    radii_and_sds = zip(surveyed.radius_m, surveyed.sd_m, strict=True)
    # Single courses are compared only when the tank as a whole agrees with the drawing.
    departures_m = np.array(
        [departure_of_size(job, float(r), plate, float(sd)) for r, sd in radii_and_sds]
    )
    if np.any(departures_m):
        yield _courses_unlike_drawing(job, surveyed.names, departures_m)


def _has_own_line(job, survey):
    """Whether another check compares the whole tank of this survey with the drawing."""
    found_by = method_of(survey)
    compared = [method for method in given_methods(job) if method.compares_size]
    return any(method.is_sighted or method is found_by for method in compared)


def _unlike_drawing(job, radius_m, miss_m):
    """Problem of a tank whose median diameter differs from the drawing."""
    text = message(
        "points_unlike_drawing",
        "{nominal_m:g} m, but the survey gives {found_m:.4f} m inside, {miss_mm:+.0f} mm from the"
        " drawing: is the side, the scale or an offset of the survey wrong, or is the drawing's"
        " figure rounded (by how much: checks.diameter_within_mm)?",
        nominal_m=job.tank.nominal_diameter_m,
        found_m=2 * radius_m,
        miss_mm=2000 * miss_m,
    )
    return Problem("job.toml", text, column="tank.nominal_diameter_m")


def _courses_unlike_drawing(job, names, departures_m):
    """Problem of single courses whose diameters differ from the drawing."""
    text = message(
        "course_unlike_drawing",
        "{nominal_m:g} m, but the survey gives diameters of courses {courses} up to {miss_mm:+.0f}"
        " mm from the drawing, and of the others not: is a plate or a reading of them wrong?",
        nominal_m=job.tank.nominal_diameter_m,
        courses=list_some([names[place] for place in np.flatnonzero(departures_m)], SHOWN),
        miss_mm=2000 * float(departures_m[np.argmax(np.abs(departures_m))]),
    )
    return Problem("job.toml", text, column="tank.nominal_diameter_m")


# ---- plausibility checks of computed results


def refuse_misfit(points, noise_m, diameter_m):
    """Raise InputError for points far from any shape of the tank.

    A possible reason is a coordinate in another unit.

    Parameters
    ----------
    points : Points
    noise_m : float
        Root mean square of the residuals.
    diameter_m : float
        Diameter of the fitted shape.
    """
    if noise_m <= IMPOSSIBLE_MISFIT * diameter_m:
        return
    text = message(
        "points_make_no_shape",
        "the points scatter by {noise_m:.3g} m (rms) about the best shape of "
        "{diameter_m:.4g} m diameter; expected points of its wall: is one axis in another "
        "unit, or are they points of something else?",
        noise_m=noise_m,
        diameter_m=diameter_m,
    )
    raise InputError(Problem(origin_of(points), text))


def check_scan(job, scan, top_m):
    """Return warnings of the points of a horizontal cylinder or a sphere.

    Parameters
    ----------
    job : Job
    scan : Scan
    top_m : float
        Height of the top of the tank, m.

    Returns
    -------
    list of Problem
    """
    diameter = float(dict(zip(scan.names, scan.values, strict=True))["diameter"])
    solid = job.horizontal or job.sphere
    plate = solid.thickness_m if job.survey.side == "outside" else 0.0
    inside = diameter - 2 * plate
    problems = [*check_side(job, inside, plate, 0.0)]
    if scan.noise_m > MISFIT * diameter + MISFIT_M:
        text = message(
            "points_misfit",
            "the points scatter by {noise_mm:.0f} mm (rms) about the best shape of {diameter_m:.4g}"
            " m diameter: is one axis in another unit, or is it another shape?",
            noise_mm=1000 * scan.noise_m,
            diameter_m=diameter,
        )
        problems.append(Problem(origin_of(job.points), text))
    elif scan.noise_m > MISFIT_SDS * declared_sd_m(job.points):
        text = message(
            "points_beyond_sd",
            "the points scatter by {noise_mm:.1f} mm (rms) about the best shape of"
            " {diameter_m:.4g} m diameter, their given sd is {given_mm:.1f} mm: are the sds too"
            " small, or is it another shape?",
            noise_mm=1000 * scan.noise_m,
            diameter_m=diameter,
            given_mm=1000 * declared_sd_m(job.points),
        )
        problems.append(Problem(origin_of(job.points), text))
    return [*problems, *_check_foot(job, scan), *check_reference(job, top_m)]


def _check_foot(job, scan):
    """Warning of a dip foot without measured points: a dent there shifts the zero of the table."""
    if scan.foot_m is None or scan.foot_m <= NEAR_FOOT_M:
        return []
    text = message(
        "dip_foot_unseen",
        "the point nearest to where the dip meets the bottom is {away_m:.2f} m from it, and a dent"
        " or a weld there moves the zero of the table: measure three points of the wall there,"
        " 50 mm apart",
        away_m=scan.foot_m,
    )
    return [Problem(origin_of(job.points), text)]


def declared_sd_m(points):
    """Return the median declared standard deviation of a coordinate, m; infinite without one."""
    if points.from_adjustment:
        return np.inf
    if points.covariance_m2 is not None:
        return float(np.sqrt(np.median(points.covariance_m2.diagonal())))
    return np.inf if points.sd_m is None else float(np.median(points.sd_m))


def check_wall(job, wall):
    """Return warnings of a vertical wall: its side, its diameter, its ends and its dip plate."""
    radius = float(np.mean([section.circle.radius_m for section in wall.sections]))
    return [
        *_check_plates(job, wall),
        *_check_tape(job, wall),
        *_check_ends(job, wall, radius),
        *_check_dip_plate(job, wall, radius),
    ]


def _first_course(wall, course):
    """Surveyed radius of the first course, its standard deviation, and plate with paint, m."""
    circles = [section.circle for section in wall.sections if section.group.course == 0]
    radius = float(np.mean([circle.radius_m for circle in circles]))
    sd = float(np.sqrt(np.mean([circle.cofactor_m2[2, 2] for circle in circles])))
    return radius, sd, course.thickness_m + course.paint_m


def _check_plates(job, wall):
    """Warning of an inside diameter that differs from the nominal one by the plates."""
    radius, sd, plate = _first_course(wall, job.courses[0])
    inside = 2 * (radius - (plate if job.survey.side == "outside" else 0.0))
    return check_side(job, inside, plate, 2 * sd)


def check_side(job, inside_m, plate_m, sd_m):
    """Return warnings of an inside diameter that differs from the drawing by the plates.

    Parameters
    ----------
    job : Job
    inside_m : float
        Inside diameter of the first course, m.
    plate_m : float
        Thickness of the plate with paint, m.
    sd_m : float
        Standard deviation of the diameter, m.

    Returns
    -------
    list of Problem
    """
    nominal, side = job.tank.nominal_diameter_m, job.survey.side
    text = side_doubt(inside_m, nominal, job.diameter_is, plate_m, side, sd_m)
    return [] if text is None else [Problem("job.toml", text, column="checks.diameter_is")]


def is_size_declared(job):
    """Whether the job declares the meaning of the nominal diameter, or a control circumference."""
    return job.diameter_is is not None or job.circumference_m is not None


def _check_tape(job, wall):
    """Warning of a first course that differs from the circumference measured by tape."""
    taped_m = job.circumference_m
    if taped_m is None:
        return []
    radius, sd, plate = _first_course(wall, job.courses[0])
    # The tape measures the outside: add the plate to a radius of the inside.
    radius += plate if job.survey.side == "inside" else 0.0
    sd /= radius
    deviation = 2 * np.pi * radius / taped_m - 1
    if abs(deviation) <= CIRCUMFERENCE_MISS + CIRCUMFERENCE_SDS * sd:
        return []
    text = message(
        "circumference_off",
        "{measured_m:.4f} m by tape, {found_m:.4f} m from the points of the first course "
        "with survey.side = {side}: they differ by {miss_mm:+.0f} mm. Is it the right side, "
        "unit and scale?",
        measured_m=taped_m,
        found_m=2 * np.pi * radius,
        side=job.survey.side,
        miss_mm=1000 * taped_m * deviation,
    )
    return [Problem("job.toml", text, column="checks.circumference_m")]


def _check_ends(job, wall, radius_m):
    """Warning of points of the wall above the top or below the bottom of the shell."""
    xyz, low = job.points.xyz_m, job.datum.bottom_z_m
    high = low + sum(course.height_m for course in job.courses)
    axis = _axis_at(wall.shell, xyz[:, 2])
    distance = np.abs(np.hypot(*(xyz[:, :2] - axis).T) - radius_m)
    is_near = distance < NEAR_WALL * radius_m
    for end, excess in (("bottom", low - xyz[:, 2]), ("top", xyz[:, 2] - high)):
        is_off = is_near & (excess > OFF_SHELL_M)
        if is_off.sum() < max(OFF_SHELL_POINTS, OFF_SHELL * is_near.sum()):
            continue
        text = message(
            "points_off_shell",
            "{count} points of the wall lie up to {most_m:.3g} m beyond the {end} of the "
            "shell, which goes from z = {low_m:.6g} to {high_m:.6g} m: is datum.bottom_z_m "
            "right, and are all courses given?",
            count=int(is_off.sum()),
            most_m=float(excess[is_off].max()),
            end=message("end_bottom", "bottom") if end == "bottom" else message("end_top", "top"),
            low_m=low,
            high_m=high,
        )
        return [Problem("job.toml", text, column="datum.bottom_z_m")]
    return []


def _axis_at(shell, z_m):
    """Axis of a vertical wall at given heights, shape (n, 2), m."""
    return np.array(shell.axis_m) + np.outer(z_m - shell.z_m, shell.slope)


def _check_dip_plate(job, wall, radius_m):
    """Warning of a dip plate off the surface of a conical or dished bottom.

    The check needs the position of the dip point.
    """
    datum, bottom, shell = job.datum, job.bottom, wall.shell
    if bottom.form not in ("cone", "dish") or None in (datum.dip_plate_z_m, datum.dip_x_m):
        return []
    axis = np.array(shell.axis_m) + (datum.bottom_z_m - shell.z_m) * np.array(shell.slope)
    part = np.hypot(datum.dip_x_m - axis[0], datum.dip_y_m - axis[1]) / radius_m
    # A cone rises linearly with the radius, a shallow dish with its square.
    power = 1 if bottom.form == "cone" else 2
    rise = (bottom.centre_z_m - datum.bottom_z_m) * max(1 - part**power, 0.0)
    deviation_m = datum.dip_plate_z_m - datum.bottom_z_m - rise
    if abs(deviation_m) <= PLATE_ON_BOTTOM_M + PLATE_ON_BOTTOM * abs(rise):
        return []
    text = message(
        "dip_plate_off_bottom",
        "{miss_m:+.3f} m from the bottom of form {form} at the dip point: is "
        "datum.dip_plate_z_m right, and does the bottom slope up or down to its centre?",
        miss_m=float(deviation_m),
        form=bottom.form,
    )
    return [Problem("job.toml", text, column="bottom.centre_z_m")]


def refuse_other_side(job, is_within, adjustment):
    """Raise InputError if all stations lie on the other side of the wall than declared.

    Parameters
    ----------
    job : Job
    is_within : callable
        Function from places (n, 3), m, to whether each lies within the wall (n,).
    adjustment : Adjustment
    """
    stations = stations_of(adjustment, job.measurements)
    if len(stations) == 0:
        return
    is_inside = is_within(stations)
    side, other = job.survey.side, "inside" if job.survey.side == "outside" else "outside"
    if np.all(is_inside) if side == "outside" else not np.any(is_inside):
        text = message(
            "stations_on_other_side",
            "found {side}, but all {count} set-ups and photographs are {other} the wall; "
            "expected {other}",
            side=side,
            other=other,
            count=len(is_inside),
        )
        raise InputError(Problem("job.toml", text, column="survey.side"))


def is_within_wall(wall, places_m):
    """Whether each place (n, 3) lies within the mean radius of a vertical wall, at any height."""
    axis = _axis_at(wall.shell, places_m[:, 2])
    radius = float(np.mean([section.circle.radius_m for section in wall.sections]))
    return np.hypot(*(places_m[:, :2] - axis).T) < radius


def stations_of(adjustment, measurements):
    """Return the places of all set-ups and photographs, shape (n, 3), m."""
    place = dict(zip(adjustment.names, adjustment.xyz_m, strict=True))
    stations = [setup.station for setup in measurements.setups]
    places = [place[name] for name in dict.fromkeys(stations) if name in place]
    if adjustment.adjusted.survey.photos is not None:
        places += list(adjustment.adjusted.photos[0])
    places = np.array(places, dtype=float).reshape(-1, 3)
    return places[np.isfinite(places).all(axis=1)]


def check_reference(job, top_m):
    """Warning of a reference height that differs from the top of the tank.

    Only for tanks whose top is computed; for other tanks the check belongs to reading the job.
    """
    reference = job.datum.reference_height_m
    text = None
    if reference is not None:
        text = reference_doubt(reference, top_m, job.tank.nominal_diameter_m)
    return [] if text is None else [Problem("job.toml", text, column="datum.reference_height_m")]
