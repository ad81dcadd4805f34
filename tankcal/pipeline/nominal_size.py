"""The size of a surveyed tank against its drawing: the rule that every method uses.

An offset, a scale or a unit that is wrong in all readings of a survey shows in its size alone.
"""

from dataclasses import dataclass

import numpy as np

from tankcal.errors import InputError, Problem
from tankcal.job.plausibility import IMPOSSIBLE_MISS, INSIDE, PLATES_TO_INSIDE, unit_guess
from tankcal.messages import list_some, message
from tankcal.pipeline.survey_limits import limits_of
from tankcal.pipeline.wall_straps import mean_radii

SHOWN = 5  # names in a message


@dataclass(frozen=True)
class InsideRadii:
    """Surveyed inside radii against which a drawing is compared.

    Attributes
    ----------
    names : tuple of str
        Of the courses or rings; one "" of a shape that has one radius.
    radius_m, plate_m, sd_m : ndarray, shape (n,)
        Inside radii, plates with their paint, and standard uncertainties of the radii (0 where
        they are far below what a drawing allows).
    """

    names: tuple[str, ...]
    radius_m: np.ndarray
    plate_m: np.ndarray
    sd_m: np.ndarray


def allowed_departure_m(job, sd_m=0.0):
    """By how much an inside radius of a standard uncertainty may differ from the nominal one, m."""
    limits, within = limits_of("nominal_size"), job.diameter_within_m
    share = limits["share"] * job.tank.nominal_diameter_m
    return max(share, within or 0.0) / 2 + limits["sds"] * sd_m


def nominal_radius_m(job, plate_m):
    """Inside radius by the drawing, m; the nominal one where the job does not say which it is.

    plate_m  of the first course, with its paint
    """
    return job.tank.nominal_diameter_m / 2 - PLATES_TO_INSIDE[job.diameter_is or INSIDE] * plate_m


def departure_of_size(job, inside_m, plate_m, sd_m=0.0):
    """Departure of an inside radius from the nominal one, m; 0 where the drawing allows it.

    Where the job does not say which diameter the nominal one is, it may be that of the outside:
    the departure counts from the nearer of the two.

    Parameters
    ----------
    job : Job
        With a nominal diameter.
    inside_m, plate_m, sd_m : float
        Radius, plate with its paint, and standard uncertainty of the radius, m.
    """
    nominal = nominal_radius_m(job, plate_m)
    least = nominal if job.diameter_is is not None else nominal - plate_m
    miss = inside_m - min(max(inside_m, least), nominal)
    return miss if abs(miss) > allowed_departure_m(job, sd_m) else 0.0


def inside_radii(job, survey):
    """`InsideRadii` of what was surveyed; None: of no size, or of one that only the drawing has.

    Parameters
    ----------
    job : Job
    survey : Wall, StrappedWall, RingedWall, RadiiWall, StrappedSphere, Scan, mesh or None
    """
    kind = None if survey is None else survey.surveyed_as
    if kind in ("wall", "strapped", "radii", "rings"):
        parts = job.rings if kind == "rings" else job.courses
        plates = np.array([one.thickness_m + one.paint_m for one in parts])
        names = tuple(getattr(one, "name", str(i)) for i, one in enumerate(parts, 1))
        if kind == "radii":
            radius = survey.radius_m
        elif kind == "rings":
            radius = survey.straps.radius_m - plates
        else:
            radius = mean_radii(survey.field) - plates * (job.survey.side == "outside")
        sd = _sds_of_courses(survey, len(parts)) if kind == "wall" else np.zeros(len(parts))
        return InsideRadii(names, radius, plates, sd)
    if kind in ("scan", "circles"):
        given = job.horizontal or job.sphere
        plate = given.thickness_m
        if kind == "circles":
            radius = survey.solid(plate).diameter_m / 2
        else:
            diameter = dict(zip(survey.names, survey.values, strict=True))["diameter"]
            radius = diameter / 2 - plate * (job.survey.side == "outside")
        return InsideRadii(("",), *(np.array([float(one)]) for one in (radius, plate, 0.0)))
    return None


def _sds_of_courses(wall, count):
    """(courses,) standard uncertainty of the mean radius of each course by its circles, m."""
    found = np.zeros(count)
    for course in range(count):
        circles = [one.circle for one in wall.sections if one.group.course == course]
        if circles:
            found[course] = np.sqrt(np.mean([one.cofactor_m2[2, 2] for one in circles]))
    return found


def refuse_other_size(job, survey):
    """Raise InputError for a surveyed size that cannot be that of the drawing: another unit."""
    found, nominal = inside_radii(job, survey), job.tank.nominal_diameter_m
    if found is None or nominal is None:
        return
    ratio = 2 * found.radius_m / nominal
    wrong = np.flatnonzero((ratio > 1 + IMPOSSIBLE_MISS) | (ratio < 1 / (1 + IMPOSSIBLE_MISS)))
    if len(wrong) == 0:
        return
    names = [found.names[place] for place in wrong]
    is_whole = len(wrong) == len(ratio)
    worst = wrong[int(np.argmax(np.abs(np.log(np.maximum(ratio[wrong], 1e-6)))))]
    text = message(
        "size_in_other_unit",
        "found {nominal_m:g} m, but the survey gives {found_m:.4g} m {where}; expected diameters"
        " within {percent:g} %{guess}",
        nominal_m=nominal,
        found_m=2 * float(np.median(found.radius_m) if is_whole else found.radius_m[worst]),
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
    """`Problem`s of a surveyed size that differs from the drawing's by more than it allows.

    Straps, sights to a bare wall and great circles have lines of their own for the whole of the
    tank, by the same rule.
    """
    found = inside_radii(job, survey)
    if found is None or job.tank.nominal_diameter_m is None:
        return
    plate = float(found.plate_m[0])
    whole = float(np.median(found.radius_m))
    miss = departure_of_size(job, whole, plate, float(np.median(found.sd_m)))
    if miss:
        if not _has_own_line(job, survey):
            yield _unlike_drawing(job, whole, miss)
        return
    if survey.surveyed_as not in ("wall", "radii") or len(found.names) == 1:
        return
    each = zip(found.radius_m, found.sd_m, strict=True)
    missed = np.array([departure_of_size(job, float(r), plate, float(sd)) for r, sd in each])
    if np.any(missed):
        yield _courses_unlike_drawing(job, found.names, missed)


def _has_own_line(job, survey):
    is_sighted = job.hits is not None or job.tangents is not None
    return is_sighted or survey.surveyed_as in ("strapped", "rings", "circles")


def _unlike_drawing(job, radius_m, miss_m):
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


def _courses_unlike_drawing(job, names, missed_m):
    text = message(
        "course_unlike_drawing",
        "{nominal_m:g} m, but the survey gives diameters of courses {courses} up to {miss_mm:+.0f}"
        " mm from the drawing, and of the others not: is a plate or a reading of them wrong?",
        nominal_m=job.tank.nominal_diameter_m,
        courses=list_some([names[place] for place in np.flatnonzero(missed_m)], SHOWN),
        miss_mm=2000 * float(missed_m[np.argmax(np.abs(missed_m))]),
    )
    return Problem("job.toml", text, column="tank.nominal_diameter_m")
