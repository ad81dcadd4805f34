"""Comparison of the surveyed size of a tank with its drawing, by one rule for all methods.

An offset, a scale or a unit that is wrong in all readings of a survey affects only the size.
"""

from dataclasses import dataclass

import numpy as np

from tankcal.errors import InputError, Problem
from tankcal.job.plausibility import IMPOSSIBLE_MISS, INSIDE, PLATES_TO_INSIDE, unit_guess
from tankcal.messages import list_some, message
from tankcal.methods.base import given_methods, method_of
from tankcal.pipeline.checks.survey_limits import limits_of
from tankcal.pipeline.wall_straps import mean_radii

SHOWN = 5  # courses named in a message


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

    Returns
    -------
    InsideRadii or None
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
