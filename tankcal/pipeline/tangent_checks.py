"""How tangents agree with the wall and with each other, and what is to be said about it."""

from dataclasses import dataclass

import numpy as np

from tankcal.adjust import noncentrality
from tankcal.errors import Problem
from tankcal.geometry.shell import course_of
from tankcal.messages import message
from tankcal.pipeline.cause_correlations import noise_of_wall
from tankcal.pipeline.level_checks import (
    check_nominal,
    check_size_told,
    courses_with_few,
    girth_m,
    levels_with_few,
)
from tankcal.pipeline.moved_setups import moved_setups, tested, worst_setup
from tankcal.pipeline.survey_limits import limit_at, limits_of
from tankcal.pipeline.wall import joints_of

RULES = "tangents"
SHOWN = 5
SUSPECT = 2.0  # test quantity of the worst set-up, from which it is tested by all others
MANY_LEVELS = 0.5  # of them, off: it is the heights as a whole
TOGETHER = 0.5  # of what one sight may be off its level: all those of a set-up
LOST = 0.5  # of the tangents of a set-up, rejected: the set-up is to blame
WAVES = np.arange(2, 9)  # round a wall: longer than a plate


@dataclass(frozen=True)
class TangentTests:
    """What became of tangents; n sights, in the order of their file.

    Attributes
    ----------
    used : ndarray of bool, shape (n,)
        The wall is known from them.
    departure_m : ndarray, shape (n,)
        Outwards, from the wall as all others have it; nan: only compared.
    w : ndarray, shape (n,)
        That over its standard deviation; nan: no test was made.
    redundancy : ndarray, shape (n,)
        Share of a change of the reading that shows in it; nan: no test was made.
    mdb_m : ndarray, shape (n,)
        Smallest blunder of the tangent's distance that the test finds; nan: no test was made.
    setups : dict
        {set-up: (w of a disturbed set-up, its turn rad, or its shift (2,) m)} (`moved_setups`).
    """

    used: np.ndarray
    departure_m: np.ndarray
    w: np.ndarray
    redundancy: np.ndarray
    mdb_m: np.ndarray
    setups: dict


def least_tangents(job):
    """How many tangents a level of a tank of that circumference should have."""
    return limit_at(RULES, "tangents", "least", girth_m(job))


def judge_tangents(job, wall, touching):
    """`TangentTests` of the tangents of a wall."""
    n = len(job.tangents)
    counted = np.flatnonzero(~job.tangents.check)  # the order of the job's points
    departure, w, redundancy, mdb = np.full((4, n), np.nan)
    departure[counted], w[counted] = wall.shell.residual_m, wall.shell.w
    used = np.zeros(n, dtype=bool)
    used[counted[wall.accepted]] = True
    order = np.concatenate([section.group.members for section in wall.sections])
    sites = len(wall.field.radius_m) - len(wall.readings)
    if sites != len(order):  # several in a cell
        return TangentTests(used, departure, w, redundancy, mdb, {})
    at = counted[wall.accepted[order]]  # of each reading of the field, among all sights
    field = wall.field
    whole = field.covariance_m2 + noise_of_wall(wall) - field.noise_m2
    precision, pull = tested(field, whole, sites)
    weight = np.maximum(np.diag(precision), 1e-300)
    departure[at], w[at] = pull / weight, pull / np.sqrt(weight)
    own = (job.tangents.sd_rad * touching.length_m) ** 2 + touching.hull.own_sd_m**2
    redundancy[at] = np.clip(own[at] * weight, 0, 1)
    mdb[at] = noncentrality() / np.sqrt(weight)
    setups = moved_setups(
        field, whole, np.array(job.tangents.setup)[at], _columns(touching, at), SUSPECT
    )
    return TangentTests(used, departure, w, redundancy, mdb, setups)


def _columns(touching, at):
    """(k, 3) derivative of tangents by the turn of the circle and the shift of the station."""
    f = touching.normal_rad[at]
    length = np.where(touching.seen_right[at], 1.0, -1.0) * touching.length_m[at]
    return np.column_stack([length, np.sin(f), np.cos(f)])


def check_tangents(job, wall, touching):
    """`Problem`s of the tangents of a wall."""
    tests = judge_tangents(job, wall, touching)
    return (
        *_of_levels(job, wall),
        *_of_places(job, touching),
        *_of_heights(job, touching),
        *_of_setups(job, tests),
        *check_nominal(job, wall, job.tangents.file),
        *_of_scale(job),
    )


def _of_scale(job):
    """A traverse whose distances one instrument measured, without a tape or a bar."""
    read = () if job.measurements is None else job.measurements.readings
    names = {setup.instrument for setup in job.tangents.setups.values()}
    is_alone = len(names) == 1 and "distances" not in {table.table for table in read}
    return check_size_told(job, [*names]) if is_alone else ()


def _of_levels(job, wall):
    least = least_tangents(job)
    few = levels_with_few(wall, least)
    if few:
        text = message(
            "few_tangents",
            "levels {levels} have fewer than {least} tangents, as many as a circumference of"
            " {girth_m:.0f} m asks for",
            levels=few,
            least=least,
            girth_m=girth_m(job),
        )
        yield Problem(job.tangents.file, text)
    least = limits_of(RULES)["levels_a_course"]
    short = courses_with_few(job, wall, least)
    if short:
        text = message(
            "few_levels_of_tangents",
            "courses {courses} were sighted at fewer than {least} levels: nothing shows a taper"
            " there",
            courses=short,
            least=least,
        )
        yield Problem(job.tangents.file, text)


def _of_places(job, touching):
    """Limbs that fall on the same places of the wall: a wave round it looks like its radius."""
    level, levels = job.tangents.levels
    least, found = least_tangents(job), []
    for one in range(len(levels)):
        normals = touching.normal_rad[(level == one) & ~job.tangents.check]
        if len(normals) >= least:  # of fewer another check tells
            found.append(wave_in_radius(normals))
    if not found:
        return
    wave, share = sorted(found, key=lambda each: each[1])[len(found) // 2]
    if share > limits_of(RULES)["wave_in_radius"]:
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
    """The wave round a wall that looks most like its radius to tangents, and by how much.

    Parameters
    ----------
    normal_rad : ndarray, shape (n,)
        Azimuths of their normals.

    Returns
    -------
    wave : int
    share : float
        Of its amplitude that may go into the mean of the tangents, |mean of exp(i k f)|.

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


def _of_heights(job, touching):
    """Tangents that touch the wall at another height than their level, or on another course."""
    tangents, names = job.tangents, [course.name for course in job.courses]
    above = touching.points.xyz_m[:, 2] - job.datum.bottom_z_m
    off = above - job.datum.plate_level_m - tangents.level_m
    there = course_of(above, joints_of(job))
    most, setup = limits_of(RULES)["level_m"], np.array(tangents.setup)
    far, high = np.abs(off) > most, _high_setups(setup, off, most)
    for name, by_m in high.items():
        text = message(
            "tangents_of_high_setup",
            "the tangents of set-up {setup!r} touch the wall {off:+.2f} m from their levels, those"
            " of the others at them: is the height of its instrument or its station wrong?",
            setup=name,
            off=by_m,
        )
        yield Problem("setups.csv", text, tangents.setups[name].row, "instrument_height_m")
    far &= ~np.isin(setup, list(high))
    wrong = {}
    for place in np.flatnonzero(far):
        key = tangents.course[place], float(tangents.level_m[place]), names[int(there[place])]
        wrong.setdefault(key, []).append(place)
    if len(wrong) > MANY_LEVELS * len(tangents.levels[1]):
        text = message(
            "tangents_off_levels",
            "the tangents touch the wall {off:+.2f} m from their levels: are bottom_z_m, the"
            " heights of the stations or those of the instruments wrong?",
            off=float(np.median(off[far])),
        )
        yield Problem(tangents.file, text, None, "level_m")
        return
    for (course, level, other), places in wrong.items():
        text = message(
            "tangents_at_other_level",
            "tangents of {level:g} m on course {course!r} ({count}) touch the wall {off:+.2f} m"
            " from there, on course {other!r}: is the level wrong, or the zenith angle, bottom_z_m"
            " or the height of the instrument?",
            count=len(places),
            level=level,
            course=course,
            off=float(np.median(off[places])),
            other=other,
        )
        yield Problem(tangents.file, text, _row(tangents, places[0]), "level_m")


def _high_setups(setup, off_m, most_m):
    """{set-up: by how much} of those whose sights all touch the wall so far from their levels, each
    by about as much; {}: most set-ups do, or none.

    setup, off_m  (n,) of each sight; nan: it has no zenith angle
    most_m        that one sight may
    """
    found, names = {}, np.unique(setup)
    for name in names:
        own = off_m[(setup == name) & np.isfinite(off_m)]
        by = float(np.median(own)) if len(own) else 0.0
        if abs(by) > TOGETHER * most_m and np.median(np.abs(own - by)) < abs(by) / 4:
            found[str(name)] = by
    return found if 2 * len(found) < len(names) else {}


def _row(tangents, place):
    return tangents.rows[place] if tangents.rows else None


def _of_setups(job, tests):
    """The set-up that contradicts all others most, where one does."""
    counts = {name: [] for name in dict.fromkeys(job.tangents.setup)}
    for name, check, used in zip(job.tangents.setup, job.tangents.check, tests.used, strict=True):
        if not check:
            counts[name].append(used)
    for name, kept in counts.items():
        if kept and np.mean(kept) < LOST:
            text = message(
                "setup_rejected",
                "{count} of the {all} tangents from set-up {setup!r} contradict all others: was it"
                " disturbed, or is its station or the zero of its circle wrong?",
                count=len(kept) - sum(kept),
                all=len(kept),
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
