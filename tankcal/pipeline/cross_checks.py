"""Cross-checks that need what was computed: the fitted shape, its top, where it was seen from."""

import numpy as np

from tankcal.errors import InputError, Problem
from tankcal.job.plausibility import (
    CIRCUMFERENCE_MISS,
    CIRCUMFERENCE_SDS,
    IMPOSSIBLE_MISFIT,
    MISFIT,
    MISFIT_M,
    MISFIT_SDS,
    NEAR_WALL,
    OFF_SHELL,
    OFF_SHELL_M,
    OFF_SHELL_POINTS,
    PLATE_ON_BOTTOM,
    PLATE_ON_BOTTOM_M,
    reference_doubt,
    side_doubt,
)
from tankcal.messages import message
from tankcal.pipeline.survey_warnings import origin_of

NEAR_FOOT_M = 0.3  # of the dip's foot: as wide as a dent; what is farther off says little of it


def refuse_misfit(points, noise_m, diameter_m):
    """Raise InputError for points that lie on no such shape: one axis in another unit, say.

    noise_m  rms of the residuals        diameter_m  of the fitted shape
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
    """Warnings of the points of a lying cylinder or a sphere."""
    diameter = float(dict(zip(scan.names, scan.values, strict=True))["diameter"])
    given = job.horizontal or job.sphere
    plate = given.thickness_m if job.survey.side == "outside" else 0.0
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
    elif given_sd_m(job.points) is not None and not job.points.from_adjustment:
        given = given_sd_m(job.points)
        if scan.noise_m > MISFIT_SDS * given:
            text = message(
                "points_beyond_sd",
                "the points scatter by {noise_mm:.1f} mm (rms) about the best shape of"
                " {diameter_m:.4g} m diameter, their given sd is {given_mm:.1f} mm: are the sds too"
                " small, or is it another shape?",
                noise_mm=1000 * scan.noise_m,
                diameter_m=diameter,
                given_mm=1000 * given,
            )
            problems.append(Problem(origin_of(job.points), text))
    return [*problems, *_of_foot(job, scan), *_of_reference(job, top_m)]


def _of_foot(job, scan):
    """A wall that nobody measured where the dip meets it: of the zero a dent there is all of U."""
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


def given_sd_m(points):
    """Median standard deviation of a coordinate as handed in, m; None: not given."""
    if points.covariance_m2 is not None:
        return float(np.sqrt(np.median(points.covariance_m2.diagonal())))
    return None if points.sd_m is None else float(np.median(points.sd_m))


def check_mesh(job, top_m):
    """Warnings of a tank that is given as a mesh."""
    return _of_reference(job, top_m)


def check_wall(job, wall):
    """Warnings of a vertical wall: its side, its diameter against a tape, its bottom's slope."""
    radius = float(np.mean([section.circle.radius_m for section in wall.sections]))
    return [
        *_against_plates(job, wall),
        *_against_tape(job, wall),
        *_beyond_ends(job, wall, radius),
        *_plate_on_bottom(job, wall, radius),
    ]


def _first_course(wall, course):
    """Radius of the first course as surveyed, its sd, thickness of plate and paint, m."""
    circles = [one.circle for one in wall.sections if one.group.course == 0]
    radius = float(np.mean([one.radius_m for one in circles]))
    sd = float(np.sqrt(np.mean([one.cofactor_m2[2, 2] for one in circles])))
    return radius, sd, course.thickness_m + course.paint_m


def _against_plates(job, wall):
    radius, sd, plate = _first_course(wall, job.courses[0])
    inside = 2 * (radius - (plate if job.survey.side == "outside" else 0.0))
    return check_side(job, inside, plate, 2 * sd)


def check_side(job, inside_m, plate_m, sd_m):
    """Warnings of an inside diameter of the first course against the drawing's, to the plate."""
    nominal, side = job.tank.nominal_diameter_m, job.survey.side
    text = side_doubt(inside_m, nominal, job.diameter_is, plate_m, side, sd_m)
    return [] if text is None else [Problem("job.toml", text, column="checks.diameter_is")]


def is_size_declared(job):
    """Whether a drawing, or a circumference beside the survey, says how large the tank is."""
    return job.diameter_is is not None or job.circumference_m is not None


def _against_tape(job, wall):
    measured = job.circumference_m
    if measured is None:
        return []
    radius, sd, plate = _first_course(wall, job.courses[0])
    radius += plate if job.survey.side == "inside" else 0.0
    sd /= radius
    miss = 2 * np.pi * radius / measured - 1
    if abs(miss) <= CIRCUMFERENCE_MISS + CIRCUMFERENCE_SDS * sd:
        return []
    text = message(
        "circumference_off",
        "{measured_m:.4f} m by tape, {found_m:.4f} m from the points of the first course "
        "with survey.side = {side}: they differ by {miss_mm:+.0f} mm. Is it the right side, "
        "unit and scale?",
        measured_m=measured,
        found_m=2 * np.pi * radius,
        side=job.survey.side,
        miss_mm=1000 * measured * miss,
    )
    return [Problem("job.toml", text, column="checks.circumference_m")]


def _beyond_ends(job, wall, radius_m):
    """Points of the wall that lie where the courses and the bottom leave no wall."""
    xyz, (low, high) = job.points.xyz_m, _ends(job)
    axis = _axis_at(wall.shell, xyz[:, 2])
    away = np.abs(np.hypot(*(xyz[:, :2] - axis).T) - radius_m)
    is_near = away < NEAR_WALL * radius_m
    for end, beyond in (("bottom", low - xyz[:, 2]), ("top", xyz[:, 2] - high)):
        off = is_near & (beyond > OFF_SHELL_M)
        if off.sum() < max(OFF_SHELL_POINTS, OFF_SHELL * is_near.sum()):
            continue
        text = message(
            "points_off_shell",
            "{count} points of the wall lie up to {most_m:.3g} m beyond the {end} of the "
            "shell, which goes from z = {low_m:.6g} to {high_m:.6g} m: is datum.bottom_z_m "
            "right, and are all courses given?",
            count=int(off.sum()),
            most_m=float(beyond[off].max()),
            end=message("end_bottom", "bottom") if end == "bottom" else message("end_top", "top"),
            low_m=low,
            high_m=high,
        )
        return [Problem("job.toml", text, column="datum.bottom_z_m")]
    return []


def _ends(job):
    bottom = job.datum.bottom_z_m
    return bottom, bottom + sum(course.height_m for course in job.courses)


def _axis_at(shell, z_m):
    """(n, 2) places of the axis of a vertical wall."""
    return np.array(shell.axis_m) + np.outer(z_m - shell.z_m, shell.slope)


def _plate_on_bottom(job, wall, radius_m):
    """A dip plate lies on the cone or dish, where the place of the dip point is known."""
    datum, bottom, shell = job.datum, job.bottom, wall.shell
    if bottom.form not in ("cone", "dish") or None in (datum.dip_plate_z_m, datum.dip_x_m):
        return []
    axis = np.array(shell.axis_m) + (datum.bottom_z_m - shell.z_m) * np.array(shell.slope)
    part = np.hypot(datum.dip_x_m - axis[0], datum.dip_y_m - axis[1]) / radius_m
    power = 1 if bottom.form == "cone" else 2
    rise = (bottom.centre_z_m - datum.bottom_z_m) * max(1 - part**power, 0.0)
    miss = datum.dip_plate_z_m - datum.bottom_z_m - rise
    if abs(miss) <= PLATE_ON_BOTTOM_M + PLATE_ON_BOTTOM * abs(rise):
        return []
    text = message(
        "dip_plate_off_bottom",
        "{miss_m:+.3f} m from the bottom of form {form} at the dip point: is "
        "datum.dip_plate_z_m right, and does the bottom slope up or down to its centre?",
        miss_m=float(miss),
        form=bottom.form,
    )
    return [Problem("job.toml", text, column="bottom.centre_z_m")]


def refuse_other_side(job, is_within, adjustment):
    """Raise InputError when everything was seen from the other side of the wall than was said.

    is_within  function from places (n, 3) to whether each lies within the wall
    """
    seen_from = stations_of(adjustment, job.measurements)
    if len(seen_from) == 0:
        return
    is_inside = is_within(seen_from)
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
    """(n,) whether places lie within the mean radius of a vertical wall, at any height."""
    axis = _axis_at(wall.shell, places_m[:, 2])
    radius = float(np.mean([section.circle.radius_m for section in wall.sections]))
    return np.hypot(*(places_m[:, :2] - axis).T) < radius


def stations_of(adjustment, measurements):
    """(n, 3) places that the survey was made from: set-ups, photographs."""
    place = dict(zip(adjustment.names, adjustment.xyz_m, strict=True))
    stations = [one.station for one in measurements.setups]
    found = [place[one] for one in dict.fromkeys(stations) if one in place]
    if adjustment.adjusted.survey.photos is not None:
        found += list(adjustment.adjusted.photos[0])
    found = np.array(found, dtype=float).reshape(-1, 3)
    return found[np.isfinite(found).all(axis=1)]


def _of_reference(job, top_m):
    """Where the top is known only now; of other tanks it was compared when the job was read."""
    reference = job.datum.reference_height_m
    text = None
    if reference is not None:
        text = reference_doubt(reference, top_m, job.tank.nominal_diameter_m)
    return [] if text is None else [Problem("job.toml", text, column="datum.reference_height_m")]
