"""The wall from tangents, and warnings about it.

Tangents to a wall as its points, from the stations of an adjusted traverse.

A tangent touches the convex hull. The mean excess of the hull over the wall follows from the
amplitudes of the wall (`geometry.girth`) and is subtracted; its uncertainty is an input of U.
The amplitudes follow from the tangents in turn, so both are iterated until they agree.

Tangents that touch a circle only if their readings are interpreted otherwise.

The checks try other units of direction, anticlockwise directions and exchanged limbs, for all
set-ups together and for each. They report an interpretation that reduces the residuals
sufficiently.
"""

from dataclasses import replace

import numpy as np
from scipy.stats import norm

from tankcal.errors import InputError, Problem, SolutionError
from tankcal.geometry.field.sites import free_design
from tankcal.geometry.girth import support_of, tangent_excess
from tankcal.geometry.shell import course_of
from tankcal.messages import message
from tankcal.methods.moved_setups import (
    TANGENT_LIMITS,
    judge_tangents,
    least_tangents,
    worst_setup,
)
from tankcal.pipeline.checks import limits_of
from tankcal.pipeline.checks.wall import (
    check_nominal,
    check_size_measured,
    courses_with_few,
    girth_m,
    levels_with_few,
)
from tankcal.pipeline.wall.finding import find_wall, joints_of, take_points
from tankcal.pipeline.wall.surveyed import s_transform
from tankcal.pipeline.wall_straps import rings_of
from tankcal.survey.diagnosis.misread_files import OTHER_UNITS
from tankcal.survey.poses import poses_in_network
from tankcal.survey.tangents import Hull, circle_of_sights, halfway, round_hull, touch
from tankcal.survey.wall_hits import WALL
from tankcal.units import DEG_IN_GON, FULL_TURN, GON_IN_DEG

ROUNDS = 6  # rounds of wall and excess; two suffice unless the hull dominates the form
# Largest change of the mean excess at the end: a length, and a share of its uncertainty.
SETTLED_M, SETTLED_PART = 2e-5, 0.25
# Bound of the deviations of a wall: a multiple of those of the limbs, but at least a length.
ROUGHER, LEAST_ROUGH_M = 3.0, 0.010
# Factors of a direction: read as degrees but given in gon, the reverse, and anticlockwise.
BACKWARDS = -1.0
CLOSER = 0.2  # largest ratio of residuals to those as read, to report another interpretation
LEAST = 0.004  # median residual over the radius that needs no explanation
OFF_LEVEL_M = 0.3  # discrepancy between a sight and its level that needs no explanation
NEAR_NOMINAL = 0.1  # largest relative difference between the circle and the nominal radius
MANY = 0.5  # share of wrong limbs above which all limbs are reported as exchanged


def find_tangent_wall(job, adjustment, progress, dof=np.inf, *, amplitudes=None):
    """Job with its tangents as points, their `Touching`, and the `Wall` fitted to them.

    Parameters
    ----------
    job : Job
    adjustment : Adjustment
        Adjusted network of the set-ups.
    progress : callable
        Called with a line of text as each step begins.
    dof, amplitudes
        As in `find_wall`.

    Returns
    -------
    job : Job
    touching : Touching
    wall : Wall
    """
    progress(
        message(
            "touching",
            "computing {count} tangents of the wall from {setups} set-ups",
            count=len(job.tangents),
            setups=len(set(job.tangents.setup)),
        )
    )
    poses, tools = poses_in_network(job.tangents, adjustment)
    _refuse_untied(job.tangents, poses)
    return touch_wall(job, poses, tools, progress, dof, amplitudes)


def touch_wall(job, poses, tools, progress, dof=np.inf, amplitudes=None):
    """Fit a wall to tangents as in `find_tangent_wall`, from known poses.

    Parameters
    ----------
    job : Job
    poses : Poses
        Positions and orientations of the set-ups.
    tools
        As in `tangents.touch`.
    progress, dof, amplitudes
        As in `find_tangent_wall`.

    Returns
    -------
    job : Job
    touching : Touching
    wall : Wall

    Raises
    ------
    SolutionError
        If wall and excess do not settle within the uncertainty of the excess.
    """
    radius = job.tank.nominal_diameter_m / 2
    arguments = {
        "zero_z_m": job.datum.bottom_z_m + job.datum.plate_level_m,
        "nominal_m": radius,
        "tools": tools,
    }
    refuse_misread(job.tangents, poses, radius)
    touching = touch(job.tangents, poses, **arguments)
    refuse_limbs(job.tangents, touching)
    refuse_misread_zeniths(job.tangents, poses, touching, arguments["zero_z_m"])
    hull = round_hull(len(job.tangents))
    for number in range(ROUNDS + 1):
        touching = touch(job.tangents, poses, **arguments, hull=hull)
        # Job with its adjusted tangents as points.
        points = take_points(touching.points, np.flatnonzero(~job.tangents.check))
        job_of_points = replace(job, points=s_transform(points))
        wall = find_wall(job_of_points, progress, dof, amplitudes)
        former_hull, hull = hull, _hull_of(job, touching, wall)
        if number and _is_settled(former_hull, hull):
            return job_of_points, touching, wall
        if number:  # damps an oscillation by a tangent rejected in every second round
            hull = halfway(former_hull, hull)
        progress = _be_silent  # do not report the same steps again
    if abs(_mean_change(former_hull, hull)) > former_hull.common_sd_m.mean():
        raise SolutionError(
            message(
                "excess_not_settled",
                "no capacity: the convex hull that the tangents touch stands {before_mm:.1f} mm"
                " outside the wall in one pass and {after_mm:.1f} mm in the next, so the tangents"
                " do not determine the form of this wall; sight more limbs (stations at other"
                " distances), strap a course (circumferences.csv), or measure points of the wall",
                before_mm=1000 * float(former_hull.excess_m.max()),
                after_mm=1000 * float(hull.excess_m.max()),
            )
        )
    return job_of_points, touching, wall  # oscillates within the uncertainty of the excess


def _is_settled(before, after):
    """Whether the last round changed the excess little, on average and at each tangent."""
    change_m = np.abs(after.excess_m - before.excess_m)
    of_mean = max(SETTLED_M, SETTLED_PART * before.common_sd_m.mean())
    of_each = np.maximum(SETTLED_M, np.hypot(before.common_sd_m, before.own_sd_m))
    return abs(_mean_change(before, after)) <= of_mean and bool(np.all(change_m <= of_each))


def _mean_change(before, after):
    return float(np.mean(after.excess_m - before.excess_m))


def _hull_of(job, touching, wall):
    """`Hull` of a wall at the tangents from which the wall was fitted.

    The excess at a tangent has two parts: the excess of the estimated outline at its azimuth, and
    the mean excess of the form that the tangents do not show.
    """
    field, joints = wall.field, wall.joints_m
    heights = touching.points.xyz_m[:, 2] - job.datum.bottom_z_m
    relative_height = np.clip(heights / joints[-1], 0.0, 1.0)
    most_m = max(ROUGHER * _departure_of_limbs(field), LEAST_ROUGH_M)
    unseen_excess = tangent_excess(
        field.amplitudes, field.nominal_m, relative_height, rings_of(field), most_m
    )
    excess_m, slope_m = np.zeros(len(heights)), np.zeros(len(heights))
    place, levels = job.tangents.levels
    height = np.array([np.median(heights[place == number]) for number in range(len(levels))])
    course = course_of(height, joints)
    low, high = joints[course], joints[course + 1]
    # A single call for all levels: the outlines of all courses are computed at each height.
    outlines = field.outlines_at(2 * (height - low) / (high - low) - 1)
    for number in range(len(levels)):
        is_of_level = place == number
        outline = outlines[course[number], number]
        # Radii at equally spaced azimuths without their first harmonic, about their own centre.
        waves = np.fft.rfft(outline)
        waves[1] = 0.0
        outline = np.fft.irfft(waves, len(outline))
        support = support_of(outline)
        step = FULL_TURN / len(outline)
        index = np.rint(touching.normal_rad[is_of_level] / step).astype(int) % len(outline)
        # The support function is the distance of the tangent from the centre; its excess is over
        # the radius.
        excess_m[is_of_level] = (support - outline)[index]
        # Central difference of the support function with respect to azimuth.
        slope_m[is_of_level] = (np.roll(support, -1) - np.roll(support, 1))[index] / (2 * step)
    return Hull(excess_m + unseen_excess[:, 0], unseen_excess[:, 1], unseen_excess[:, 2], slope_m)


def _departure_of_limbs(field):
    """Standard deviation of the radii about the circles of their levels, m."""
    design = free_design(field.sites)[0]
    residuals = field.radius_m - design @ np.linalg.lstsq(design, field.radius_m, rcond=None)[0]
    return float(
        np.sqrt(np.sum(residuals**2) / max(len(residuals) - np.linalg.matrix_rank(design), 1))
    )


def _be_silent(text):
    """Progress callback that does nothing."""


def _refuse_untied(tangents, poses):
    """Raise InputError for set-ups whose position or orientation the network does not determine."""
    names = [name for (name, _), tie in zip(poses.keys, poses.ties, strict=True) if tie == WALL]
    if names:
        text = message(
            "untied_tangents",
            "the network does not have the place of its station and the zero of its circle;"
            " expected directions to other stations in directions.csv",
        )
        raise InputError(
            [
                Problem("setups.csv", text, tangents.setups[name].row, "setup")
                for name in dict.fromkeys(names)
            ]
        )


# ---- tangents that touch a circle only if their readings are interpreted otherwise


def refuse_misread(tangents, poses, nominal_m):
    """Raise InputError for directions that touch a circle only in another unit or sense.

    Parameters
    ----------
    tangents : Tangents
    poses : Poses
        Positions and orientations of the set-ups.
    nominal_m : float
        Nominal radius, m.
    """
    pose = poses.place_of(tangents)
    station = poses.xyz_m[pose][:, :2]
    station = station - station.mean(axis=0)
    zero, setup = poses.orientation_rad[pose], np.array(tangents.setup)

    def residuals(factor):
        azimuth = zero + factor * tangents.direction_rad
        curve, _, residuals_m = circle_of_sights(station, azimuth, nominal_m)
        if abs(curve.radius_m - nominal_m) > NEAR_NOMINAL * nominal_m:
            return np.full(len(residuals_m), np.inf)
        return np.abs(residuals_m)

    ones, names = np.ones(len(tangents)), tuple(dict.fromkeys(tangents.setup))
    residuals_as_read = residuals(ones)
    if np.median(residuals_as_read) > LEAST * nominal_m:
        candidates = [(np.ones(len(setup), dtype=bool), names[0])]
    else:
        candidates = [
            (setup == name, name)
            for name in names
            if np.median(residuals_as_read[setup == name]) > LEAST * nominal_m
        ]
    problems = []
    for is_of_setup, name in candidates:
        median_as_read = np.median(residuals_as_read[is_of_setup])
        median_by_factor = {
            factor: np.median(residuals(np.where(is_of_setup, factor, 1.0))[is_of_setup])
            for factor in (GON_IN_DEG, DEG_IN_GON, BACKWARDS)
        }
        best = min(median_by_factor, key=median_by_factor.get)
        most = CLOSER * median_as_read if np.isfinite(median_as_read) else LEAST * nominal_m
        if np.isfinite(median_by_factor[best]) and not median_by_factor[best] > most:
            row = tangents.rows[tangents.setup.index(name)] if tangents.rows else None
            problems.append(Problem(tangents.file, _text(best), row, "direction"))
    if problems:
        raise InputError(problems)
    if not np.isfinite(np.median(residuals_as_read)):
        azimuth = zero + tangents.direction_rad
        curve, _, residuals_m = circle_of_sights(station, azimuth, nominal_m)
        _refuse_other_length(tangents, curve.radius_m, nominal_m, np.median(np.abs(residuals_m)))
        text = message(
            "tangents_show_no_circle",
            "the tangents touch no circle of about the nominal diameter {diameter_m:.3f} m: check"
            " the set-ups, the zeros of their circles and tank.nominal_diameter_m",
            diameter_m=2 * nominal_m,
        )
        raise InputError(Problem(tangents.file, text))


def _refuse_other_length(tangents, radius_m, nominal_m, residual_m):
    """Raise InputError if the circle has the nominal size in another unit of the traverse."""
    for factor, unit in OTHER_UNITS:
        is_close = abs(radius_m * factor - nominal_m) < NEAR_NOMINAL * nominal_m
        if is_close and residual_m < LEAST * radius_m:
            text = message(
                "tangents_of_other_length",
                "the tangents touch a circle of {diameter_m:.3f} m, which is the nominal"
                " {nominal_m:.3f} m if the distances of the traverse, or its bar, are in {unit}: is"
                " it so?",
                diameter_m=2 * radius_m,
                nominal_m=2 * nominal_m,
                unit=unit,
            )
            raise InputError(Problem("slope_distances.csv", text, None, "distance_m"))


def refuse_misread_zeniths(tangents, poses, touching, zero_z_m):
    """Raise InputError for zenith angles that reach the stated levels only in another unit.

    Parameters
    ----------
    tangents : Tangents
    poses : Poses
        Positions of the set-ups.
    touching : Touching
        Points of tangency; their plan coordinates do not depend on zenith angles.
    zero_z_m : float
        Height of the zero of the levels, m.
    """
    station = poses.xyz_m[poses.place_of(tangents)]
    length = np.linalg.norm(touching.points.xyz_m[:, :2] - station[:, :2], axis=1)
    level, setup = zero_z_m + tangents.level_m, np.array(tangents.setup)
    problems = []
    for name in dict.fromkeys(tangents.setup):
        is_of_setup = (setup == name) & np.isfinite(tangents.zenith_rad) & np.isfinite(level)
        if not is_of_setup.any():
            continue
        misfit_m = {}
        for factor in (1.0, GON_IN_DEG, DEG_IN_GON):
            elevation = np.pi / 2 - factor * tangents.zenith_rad[is_of_setup]
            z = station[is_of_setup, 2] + length[is_of_setup] * np.tan(elevation)
            misfit_m[factor] = np.median(np.abs(z - level[is_of_setup]))
        best = min(misfit_m, key=misfit_m.get)
        if misfit_m[1.0] > OFF_LEVEL_M and misfit_m[best] <= CLOSER * misfit_m[1.0]:
            row = tangents.rows[int(np.argmax(is_of_setup))] if tangents.rows else None
            problems.append(Problem(tangents.file, _text_of_zenith(best), row, "zenith"))
    if problems:
        raise InputError(problems)


def _text_of_zenith(factor):
    """Message that proposes the unit of zenith angles of the given factor."""
    if factor == GON_IN_DEG:
        return message(
            "tangent_zeniths_in_gon",
            "the sights are at the levels given if these are gon: is it so?",
        )
    return message(
        "tangent_zeniths_in_degrees",
        "the sights are at the levels given if these are degrees: is it so?",
    )


def _text(factor):
    """Message that proposes the unit or sense of directions of the given factor."""
    if factor == GON_IN_DEG:
        return message("tangents_in_gon", "the sights touch one circle if these are gon: is it so?")
    if factor == DEG_IN_GON:
        return message(
            "tangents_in_degrees", "the sights touch one circle if these are degrees: is it so?"
        )
    return message(
        "tangents_backwards",
        "the sights touch one circle if directions grow anticlockwise; expected clockwise ones",
    )


def refuse_limbs(tangents, touching):
    """Raise InputError for sights that pass the tank on the limb opposite to the stated limb."""
    wrong = np.flatnonzero(touching.seen_right != tangents.is_right)
    if not len(wrong):
        return
    rows = tangents.rows or tuple(range(1, len(tangents) + 1))
    if len(wrong) > MANY * len(tangents):
        text = message(
            "limbs_exchanged",
            "{count} of {all} sights pass the tank at the other side: are left and right exchanged?"
            " Expected sides as seen from the set-up",
            count=len(wrong),
            all=len(tangents),
        )
        raise InputError(Problem(tangents.file, text, rows[wrong[0]], "side"))
    texts = {
        True: message("limb_is_right", "found left, but the sight passes the tank at its right"),
        False: message("limb_is_left", "found right, but the sight passes the tank at its left"),
    }
    raise InputError(
        [
            Problem(tangents.file, texts[bool(touching.seen_right[row])], rows[row], "side")
            for row in wrong
        ]
    )


TOGETHER = 0.5  # limit of a whole set-up, relative to the limit of a single sight
SLIDES = 3.0  # standard deviations by which a wave of the wall may move a point of contact
LEAST_SLOPE = 0.1  # of a sight; flatter sights do not show where they touch
LOST = 0.5  # share of used tangents below which a set-up is reported
WAVES = np.arange(2, 9)  # numbers of waves round a wall, longer than a plate


def check_tangents(job, wall, touching):
    """`Problem`s of the tangents of a wall."""
    tests = judge_tangents(job, wall, touching)
    return (
        *_check_levels(job, wall),
        *_check_limbs(job, touching),
        *_check_heights(job, touching),
        *_check_setups(job, tests),
        *check_nominal(job, wall, job.tangents.file),
        *_check_scale(job),
    )


def _check_scale(job):
    """Problems of a traverse measured with one instrument, without a tape or a bar."""
    names = {setup.instrument for setup in job.tangents.setups.values()}
    is_alone = len(names) == 1 and "distances" not in {
        table.table for table in job.network.readings
    }
    return check_size_measured(job, [*names]) if is_alone else ()


def _check_levels(job, wall):
    """Problems of levels with few tangents and courses with few levels."""
    least = least_tangents(job)
    weak_levels = levels_with_few(wall, least)
    if weak_levels:
        text = message(
            "few_tangents",
            "levels {levels} have fewer than {least} tangents, as many as a circumference of"
            " {girth_m:.0f} m asks for",
            levels=weak_levels,
            least=least,
            girth_m=girth_m(job),
        )
        yield Problem(job.tangents.file, text)
    least = limits_of(TANGENT_LIMITS)["levels_a_course"]
    weak_courses = courses_with_few(job, wall, least)
    if weak_courses:
        text = message(
            "few_levels_of_tangents",
            "courses {courses} were sighted at fewer than {least} levels: nothing shows a taper"
            " there",
            courses=weak_courses,
            least=least,
        )
        yield Problem(job.tangents.file, text)


def _check_limbs(job, touching):
    """Problem of limbs that coincide on the wall, so that a wave looks like the radius."""
    level, levels = job.tangents.levels
    least, waves = least_tangents(job), []
    for number in range(len(levels)):
        normals = touching.normal_rad[(level == number) & ~job.tangents.check]
        if len(normals) >= least:  # otherwise another check warns
            waves.append(wave_in_radius(normals))
    if not waves:
        return
    wave, share = sorted(waves, key=lambda wave_and_share: wave_and_share[1])[len(waves) // 2]
    if share > limits_of(TANGENT_LIMITS)["wave_in_radius"]:
        text = message(
            "limbs_coincide",
            "the limbs of the set-ups fall on nearly the same places of the wall: of {wave} waves"
            " round the tank {percent:.0f} % of their height may go into the radius, and how high"
            " they are is assumed; stations nearer to the tank or farther off would spread them",
            wave=wave,
            percent=100 * share,
        )
        yield Problem("setups.csv", text, column="station")


def wave_in_radius(normal_rad):
    """Wave round a wall that tangents confuse most with the radius, and by how much.

    Parameters
    ----------
    normal_rad : ndarray, shape (n,)
        Azimuths of the normals of the tangents, rad.

    Returns
    -------
    wave : int
        Number of waves round the wall.
    share : float
        Share of its amplitude that may appear in the mean of the tangents, |mean of exp(i k f)|.

    Examples
    --------
    >>> pairs = np.radians([0, 0, 60, 60, 120, 120, 180, 180, 240, 240, 300, 300])
    >>> wave_in_radius(pairs)
    (6, 1.0)
    >>> round(wave_in_radius(np.radians(30) * np.arange(12))[1], 6)
    0.0
    """
    shares = np.abs(np.mean(np.exp(1j * np.outer(WAVES, normal_rad)), axis=1))
    return int(WAVES[np.argmax(shares)]), round(float(np.max(shares)), 12)


def _check_heights(job, touching):
    """Problems of tangents that touch the wall away from their level or on another course.

    The height of a contact is that of the sight at the tangency point of the circle. On a wall with
    waves the contact slides along the sight, so a steep sight touches at another height.
    """
    tangents, names = job.tangents, [course.name for course in job.courses]
    height = touching.points.xyz_m[:, 2] - job.datum.bottom_z_m
    off_m = height - job.datum.plate_level_m - tangents.level_m
    course_index = course_of(height, joints_of(job))
    most_m, setup = limits_of(TANGENT_LIMITS)["level_m"], np.array(tangents.setup)
    is_known = np.isfinite(off_m)
    if not is_known.any():
        return
    common_m = float(np.median(off_m[is_known]))
    if abs(common_m) > most_m:
        text = message(
            "tangents_off_levels",
            "the tangents touch the wall {off:+.2f} m from their levels: are bottom_z_m, the"
            " heights of the stations or those of the instruments wrong?",
            off=common_m,
        )
        yield Problem(tangents.file, text, None, "level_m")
        return
    rise_m = touching.points.xyz_m[:, 2] - touching.poses.xyz_m[touching.pose, 2]
    slope = np.maximum(np.abs(rise_m) / touching.length_m, LEAST_SLOPE)
    # The lowest quarter, because half of the levels may be exchanged.
    quarter_m = np.quantile(np.abs(off_m - common_m)[is_known] / slope[is_known], 0.25)
    slide_m = quarter_m / norm.ppf(0.625)
    is_far = np.abs(off_m) > most_m + SLIDES * slide_m * slope
    off_by_setup = _high_setups(setup, off_m, most_m)
    for name, by_m in off_by_setup.items():
        text = message(
            "tangents_of_high_setup",
            "the tangents of set-up {setup!r} touch the wall {off:+.2f} m from their levels, those"
            " of the others at them: is the height of its instrument or its station wrong?",
            setup=name,
            off=by_m,
        )
        yield Problem("setups.csv", text, tangents.setups[name].row, "instrument_height_m")
    is_far &= ~np.isin(setup, list(off_by_setup))
    places_by_key = {}
    for place in np.flatnonzero(is_far):
        key = (
            tangents.course[place],
            float(tangents.level_m[place]),
            names[int(course_index[place])],
        )
        places_by_key.setdefault(key, []).append(place)
    for (course, level, other_course), places in places_by_key.items():
        text = message(
            "tangents_at_other_level",
            "tangents of {level:g} m on course {course!r} ({count}) touch the wall {off:+.2f} m"
            " from there, on course {other!r}: is the level wrong, or the zenith angle, bottom_z_m"
            " or the height of the instrument?",
            count=len(places),
            level=level,
            course=course,
            off=float(np.median(off_m[places])),
            other=other_course,
        )
        yield Problem(
            tangents.file, text, tangents.rows[places[0]] if tangents.rows else None, "level_m"
        )


def _high_setups(setup, off_m, most_m):
    """Height errors {set-up: m} of set-ups whose sights are all off by about the same amount.

    The result is empty if at least half of the set-ups are concerned, or none.

    Parameters
    ----------
    setup : ndarray of str, shape (n,)
        Set-up of each sight.
    off_m : ndarray, shape (n,)
        Height of each sight above its level, m; nan without a zenith angle.
    most_m : float
        Largest accepted difference of a single sight, m.

    Returns
    -------
    dict
    """
    off_by_setup, names = {}, np.unique(setup)
    for name in names:
        off_of_setup = off_m[(setup == name) & np.isfinite(off_m)]
        median_m = float(np.median(off_of_setup)) if len(off_of_setup) else 0.0
        if (
            abs(median_m) > TOGETHER * most_m
            and np.median(np.abs(off_of_setup - median_m)) < abs(median_m) / 4
        ):
            off_by_setup[str(name)] = median_m
    return off_by_setup if 2 * len(off_by_setup) < len(names) else {}


def _check_setups(job, tests):
    """Problem of a set-up whose tangents were mostly rejected, or else that contradicts most."""
    counts = {name: [] for name in dict.fromkeys(job.tangents.setup)}
    for name, check, used in zip(job.tangents.setup, job.tangents.check, tests.used, strict=True):
        if not check:
            counts[name].append(used)
    for name, used_sights in counts.items():
        if used_sights and np.mean(used_sights) < LOST:
            text = message(
                "setup_rejected",
                "{count} of the {all} tangents from set-up {setup!r} contradict all others: was it"
                " disturbed, or is its station or the zero of its circle wrong?",
                count=len(used_sights) - sum(used_sights),
                all=len(used_sights),
                setup=name,
            )
            yield Problem("setups.csv", text, job.tangents.setups[name].row, "setup")
            return
    if not tests.setups:
        return
    worst = worst_setup(tests.setups)
    if worst is not None:
        text = message(
            "setup_disturbed",
            "the tangents from set-up {setup!r} contradict all others (w = {w:.1f}), as if its"
            " circle were turned by {turn_arcsec:+.0f} seconds of arc, or its station moved by"
            " {shift_mm:.1f} mm: was it disturbed after the traverse, or has the wall a seam"
            " there?",
            **worst,
        )
        row = job.tangents.setups[worst["setup"]].row
        yield Problem("setups.csv", text, row, "setup")
