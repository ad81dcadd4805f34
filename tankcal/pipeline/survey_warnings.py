"""Warnings: what a sound survey of a sound tank hardly has. None of them stops a job."""

from itertools import pairwise

import numpy as np

from tankcal.errors import Problem, SolutionError
from tankcal.geometry.shell import VAGUE_TILT
from tankcal.job.plausibility import VOLUME_MISS
from tankcal.messages import list_some, message
from tankcal.pipeline.undecided_columns import tell_undecided
from tankcal.tank.body import OWN_SCALE

FEWEST_POINTS, ADVISED_POINTS = 5, 10  # of a section
WIDE_GAP_DEG = 45
SHOWN = 5  # names in a message
CERTIFICATE_NEEDS = ("number", "laboratory", "customer", "method")
LARGE_NOISE_M, LARGE_JUMP_M, MANY_SNOOPED = 0.010, 0.020, 0.03
CONFIRMED = 0.5  # scatter over given sds, or the other way round, from which on they agree
ONE_HEIGHT, OFF_MIDDLE = 0.2, 0.1  # of a course's height: within one height; off its middle
VAGUE = 5.0  # times the median sd: what a point with one poor ray too few has
OF_VERTICAL = message(
    "gives_vertical",
    "plumb lines, height differences, vertical or zenith angles, or control points with "
    "known heights determine it",
)
OF_SCALE = message(
    "gives_scale",
    "distances, a stadia bar, or control points in different places, determine it",
)


def noise_is_estimated(job):
    """Whether the points' covariance is scaled by what their residuals say.

    That of an adjustment has been scaled there, by all its residuals.
    """
    points = job.points
    given = points.sd_m is not None or points.covariance_m2 is not None
    return not given or (job.scale == "a_posteriori" and not points.from_adjustment)


def origin_of(points):
    """Where points come from, as messages name it."""
    if points.file:
        return points.file
    return "adjusted points" if points.from_adjustment else "points.csv"


def refuse_undetermined(datum):
    """Refuse a capacity while the vertical or the scale of a survey is not determined.

    Parameters
    ----------
    datum : DatumReport
        Of the adjusted survey.

    Raises
    ------
    SolutionError
        With what would determine them.
    """
    missing = []
    if not datum.vertical:
        missing.append(
            message(
                "no_vertical",
                "no capacity: the vertical is not determined by any observation: {remedy}",
                remedy=OF_VERTICAL,
            )
        )
    if not datum.scale:
        missing.append(
            message(
                "no_scale",
                "no capacity: the scale is not determined by any observation: {remedy}",
                remedy=OF_SCALE,
            )
        )
    if missing:
        raise SolutionError(*missing)


def open_questions(job, datum, causes):
    """What a user must decide about an adjusted survey: its heights, a scale given twice.

    Parameters
    ----------
    job : Job
    datum : DatumReport
        Of the adjusted survey.
    causes : sequence of Cause
        Causes of uncertainty of its points.

    Returns
    -------
    tuple of Problem
    """
    problems = []
    if (
        datum.choice in ("inner", "fixed_photo")
        and datum.defect
        and job.datum.bottom_z_m is not None
    ):
        text = message(
            "heights_not_fixed",
            "datum = {choice}: no observation fixes the heights of the frame; bottom_z_m is taken "
            "in the frame of the results, which is held by {held}: check its value in that frame",
            choice=datum.choice,
            held=_held(datum.held),
        )
        problems.append(Problem("job.toml", text, column="datum.bottom_z_m"))
    scales = [
        message("with_u", "{name} ({u:g} {unit})", name=one.name, u=one.u, unit=one.unit)
        for one in causes
        if one.what == OWN_SCALE
    ]
    if scales and any(one.name == "scale" for one in job.inputs):
        text = message(
            "scale_twice",
            "scale is declared, and that of {instruments} in instruments.toml is already in "
            "the points: both count, which is right only if their causes are different",
            instruments=list_some(scales, SHOWN),
        )
        problems.append(Problem("uncertainty.csv", text, column="input"))
    return tuple(problems)


def _held(names):
    if "all" in names:
        return message("all_points", "all points")
    return list_some(names, SHOWN)


def warn_of_vague_vertical(points):
    """A vertical that adjusted points have, but hardly know: the sd of their common lean."""
    if not points.from_adjustment:
        return []
    x, y, z = (points.xyz_m - points.xyz_m.mean(axis=0)).T
    lean = np.zeros((len(x), 3, 2))
    lean[:, 0, 0], lean[:, 2, 0] = z, -x
    lean[:, 1, 1], lean[:, 2, 1] = z, -y
    angle = np.linalg.pinv(lean.reshape(-1, 2))
    sd = np.sqrt(np.linalg.eigvalsh(angle @ (points.covariance_m2 @ angle.T))[-1])
    if sd <= VAGUE_TILT:
        return []
    text = message(
        "vertical_vague",
        "the vertical, and with it the tilt, is known only to {sd_mm_per_m:.1f} mm/m (sd): "
        "{remedy}",
        sd_mm_per_m=1000 * sd,
        remedy=OF_VERTICAL,
    )
    return _problems(points, [text])


def warn_of_vague_points(points, accepted, sds_m, noise_m):
    """Points of the wall that the survey hardly determines, and a wall of such points.

    accepted (m,) indices of the points of the wall; sds_m (n,) in plan, or None; noise_m scatter
    of the points about the shell's form. Large standard deviations that were handed in and that the
    scatter confirms are no doubt: they are what the survey is, and U has them.
    """
    if sds_m is None:
        return []
    own = sds_m[accepted]
    middle, texts = np.median(own), []
    vague = np.flatnonzero(own > VAGUE * middle)
    if len(vague):
        worst = vague[np.argsort(-own[vague])]
        texts.append(
            message(
                "points_vague",
                "the sd of {count} points of the wall is over {times:g} times the median"
                " ({median_mm:.1f} mm): {points}; more or better rays are needed there",
                count=len(vague),
                times=VAGUE,
                median_mm=1000 * middle,
                points=list_some(
                    [_with_sd(points.names[accepted[i]], own[i]) for i in worst], SHOWN
                ),
            )
        )
    is_confirmed = CONFIRMED * middle < noise_m < middle / CONFIRMED
    if middle > LARGE_NOISE_M and (points.from_adjustment or not is_confirmed):
        texts.append(
            message(
                "points_noisy",
                "the points of the wall are known to {sd_mm:.1f} mm (median sd in plan): "
                "dents and ovality of that size cannot be told from noise",
                sd_mm=1000 * middle,
            )
        )
    return _problems(points, texts)


def _with_sd(name, sd_m):
    return message("with_sd", "{name} ({sd_mm:.1f} mm)", name=name, sd_mm=1000 * sd_m)


def _shown(job, group):
    """Name of a section; of tangents, which have that of their course and level, the level."""
    level = group.name.removeprefix(f"{job.courses[group.course].name} ")
    if job.tangents is None or level == group.name:
        return group.name
    return message("section_at_level", "at {level_m:.3f} m", level_m=float(level))


def weak_sections(job, groups, azimuth_rad):
    """Sections with few points, or with a part of the turn that nobody measured."""
    texts = []
    for group in groups:
        ordered = np.sort(azimuth_rad[group.members])
        gap = np.degrees(np.max(np.diff(ordered, append=ordered[0] + 2 * np.pi)))
        named = {"section": _shown(job, group), "course": job.courses[group.course].name}
        if len(ordered) < ADVISED_POINTS:
            texts.append(
                message(
                    "section_weak",
                    "section {section} (course {course}) has only {count} points; {advised} "
                    "or more are advised",
                    **named,
                    count=len(ordered),
                    advised=ADVISED_POINTS,
                )
            )
        if gap > WIDE_GAP_DEG:
            texts.append(
                message(
                    "section_gap",
                    "section {section} (course {course}) has no point over {gap_deg:.0f} deg "
                    "of its circumference: measure there",
                    **named,
                    gap_deg=gap,
                )
            )
    return _problems(job.points, texts)


def warn_of_taper(job, sites):
    """Courses that were measured at one height each, all off their middles to the same side.

    A taper that all courses share, as lapped plates have it, moves the table then, and U knows only
    of tapers that each course has by itself.
    """
    if any(one.name == "taper" for one in job.inputs):
        return []
    parts = [(sites.zeta[members] + 1) / 2 for members in sites.members if len(members)]
    flat = [np.ptp(part) < ONE_HEIGHT for part in parts]
    off = np.mean([np.median(part) for part in parts]) - 0.5
    if np.mean(flat) <= 0.5 or abs(off) < OFF_MIDDLE:
        return []
    text = message(
        "taper_unseen",
        "{count} of {all} courses were measured at one height, in the mean {percent:+.0f} % of a"
        " course's height from the middle: a taper that all courses share would move the table, and"
        " U has none of it; measure a second height, or declare taper in uncertainty.csv",
        count=sum(flat),
        all=len(parts),
        percent=100 * off,
    )
    return _problems(job.points, [text])


def check_shell(job, shell, sections, given_sd_m):
    """A tilt that is not determined, large scatter, many outliers, radii that jump.

    given_sd_m (n,) standard deviations of the points in plan, or None. Those of an adjustment are
    tested there, by all its residuals: a wall whose courses differ proves nothing against them.
    """
    texts = _of_scatter(shell, None if job.points.from_adjustment else given_sd_m)
    if not shell.tilt_known:
        texts.append(
            message(
                "tilt_unknown", "the points do not determine a tilt: the shell is taken as upright"
            )
        )
    snooped = np.sum(shell.reason == "snooping")
    tested = snooped + np.sum(shell.reason == "")
    if snooped > max(MANY_SNOOPED * tested, 3):
        texts.append(
            message(
                "many_outliers",
                "{rejected} of {tested} points near the wall were rejected as outliers: are they "
                "dents of the wall, or objects in front of it? The working papers list them",
                rejected=snooped,
                tested=tested,
            )
        )
    texts += tell_undecided(job.points.names, shell, SHOWN)
    for below, above in pairwise(sections):
        plates = [job.courses[section.group.course].thickness_m for section in (below, above)]
        jump = abs(above.circle.radius_m - below.circle.radius_m)
        if jump > LARGE_JUMP_M + abs(plates[1] - plates[0]):
            texts.append(
                message(
                    "radius_jumps",
                    "the radius changes by {jump_mm:.0f} mm from section {below} to section"
                    " {above}: is one of them not the wall?",
                    jump_mm=1000 * jump,
                    below=_shown(job, below.group),
                    above=_shown(job, above.group),
                )
            )
    return _problems(job.points, texts)


def warn_of_undeclared(undeclared):
    """A warning that names what U does not contain.

    undeclared  names of the inputs that bear on the tank and have no declared uncertainty
    """
    if not undeclared:
        return ()
    text = message("undeclared", "not declared, so not in U: {inputs}", inputs=list(undeclared))
    return (Problem("uncertainty.csv", text),)


def incomplete_certificate(job):
    """A warning that names what a certificate lacks."""
    lacking = [key for key in CERTIFICATE_NEEDS if not job.certificate.get(key)]
    if not lacking:
        return ()
    text = message(
        "certificate_incomplete",
        "not given: {entries}; ISO/IEC 17025, 7.8.2, requires them",
        entries=lacking,
    )
    return (Problem("job.toml", text, column="certificate"),)


def against_nominal(tank, capacity_m3):
    """A warning when the capacity is far from the nominal volume."""
    nominal = tank.nominal_volume_m3
    if nominal is None or abs(capacity_m3 / nominal - 1) <= VOLUME_MISS:
        return ()
    text = message(
        "not_nominal",
        "the capacity is {volume_m3:.6g} m3, tank.nominal_volume_m3 is {nominal_m3:g}: they differ"
        " by {percent:.0f} %",
        volume_m3=capacity_m3,
        nominal_m3=nominal,
        percent=100 * abs(capacity_m3 / nominal - 1),
    )
    return (Problem("job.toml", text, column="tank.nominal_volume_m3"),)


def _of_scatter(shell, given_sd_m):
    noise_mm = 1000 * shell.noise_m
    if given_sd_m is not None:
        given_mm = 1000 * np.median(given_sd_m)
        if noise_mm > 2 * given_mm:
            template = (
                "the points scatter by {noise_mm:.1f} mm (sd) about the shell's form, their given"
                " sd is {given_mm:.1f} mm: are the sds too small?"
            )
            return [message("sds_small", template, noise_mm=noise_mm, given_mm=given_mm)]
    elif shell.noise_m > LARGE_NOISE_M:
        template = (
            "the points scatter by {noise_mm:.1f} mm (sd) about the shell's form: is there a second"
            " surface (insulation, pipes) near the wall?"
        )
        return [message("points_scatter", template, noise_mm=noise_mm)]
    return []


def _problems(points, texts):
    return [Problem(origin_of(points), text) for text in texts]
