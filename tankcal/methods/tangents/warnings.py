"""Warnings about tangents: few limbs, wrong heights, disturbed set-ups."""

import numpy as np
from scipy.stats import norm

from tankcal.errors import Problem
from tankcal.geometry.shell import course_of
from tankcal.messages import message
from tankcal.methods.moved_setups import (
    TANGENT_LIMITS,
    judge_tangents,
    least_tangents,
    worst_setup,
)
from tankcal.pipeline.checks.survey import limits_of
from tankcal.pipeline.checks.wall import (
    check_nominal,
    check_size_told,
    courses_with_few,
    girth_m,
    levels_with_few,
)
from tankcal.pipeline.wall.finding import joints_of

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
    readings = () if job.measurements is None else job.measurements.readings
    names = {setup.instrument for setup in job.tangents.setups.values()}
    is_alone = len(names) == 1 and "distances" not in {table.table for table in readings}
    return check_size_told(job, [*names]) if is_alone else ()


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
