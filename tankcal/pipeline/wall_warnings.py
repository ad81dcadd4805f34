"""Warnings of the wall that was found: its sections, how it was measured, what was rejected."""

from itertools import pairwise

import numpy as np

from tankcal.geometry.field.components import COMPONENTS
from tankcal.messages import list_some, message
from tankcal.pipeline.survey_warnings import LARGE_NOISE_M, SHOWN, of_points
from tankcal.pipeline.undecided_columns import tell_undecided

FEWEST_POINTS, ADVISED_POINTS = 5, 10  # of a section
WIDE_GAP_DEG = 45
LARGE_JUMP_M, MANY_SNOOPED = 0.020, 0.03
TOLD_ALONE = 3  # sections of a kind that are told one by one
ONE_HEIGHT, OFF_MIDDLE = 0.2, 0.1  # of a course's height: within one height; off its middle


def weak_sections(job, groups, azimuth_rad):
    """Sections with few points, or with a part of the turn that nobody measured.

    Each is told by itself, or all of a kind at once where they are more than `TOLD_ALONE`.
    """
    few, gaps = [], []
    for group in groups:
        ordered = np.sort(azimuth_rad[group.members])
        gap = np.degrees(np.max(np.diff(ordered, append=ordered[0] + 2 * np.pi)))
        named = {"section": _shown(job, group), "course": job.courses[group.course].name}
        if len(ordered) < ADVISED_POINTS:
            few.append((len(ordered), named))
        if gap > WIDE_GAP_DEG:
            gaps.append((gap, named))
    kinds = (few, _with_few, _all_with_few), (gaps, _with_gap, _all_with_gaps)
    texts = []
    for found, of_one, of_all in kinds:
        texts += [of_all(found)] if len(found) > TOLD_ALONE else [of_one(*one) for one in found]
    return of_points(job.points, texts)


def _with_few(count, named):
    return message(
        "section_weak",
        "section {section} (course {course}) has only {count} points; {advised} or more are "
        "advised",
        **named,
        count=count,
        advised=ADVISED_POINTS,
    )


def _all_with_few(found):
    return message(
        "sections_weak",
        "{all} sections have fewer than {advised} points, {count} at least: {sections}; {advised} "
        "or more are advised",
        all=len(found),
        count=min(count for count, _ in found),
        sections=_listed(found),
        advised=ADVISED_POINTS,
    )


def _with_gap(gap_deg, named):
    return message(
        "section_gap",
        "section {section} (course {course}) has no point over {gap_deg:.0f} deg of its "
        "circumference: measure there",
        **named,
        gap_deg=gap_deg,
    )


def _all_with_gaps(found):
    return message(
        "sections_gap",
        "{all} sections have no point over a part of their circumference, {gap_deg:.0f} deg at "
        "most: {sections}; measure there",
        all=len(found),
        gap_deg=max(gap_deg for gap_deg, _ in found),
        sections=_listed(found),
    )


def _listed(found):
    """Names of sections with those of their courses, the first of them."""
    names = [
        message("section_of_course", "{section} (course {course})", **named) for _, named in found
    ]
    return list_some(names, SHOWN)


def _shown(job, group):
    """Name of a section; of tangents, which have that of their course and level, the level."""
    level = group.name.removeprefix(f"{job.courses[group.course].name} ")
    if job.tangents is None or level == group.name:
        return group.name
    return message("section_at_level", "at {level_m:.3f} m", level_m=float(level))


def warn_of_taper(job, field):
    """Courses that were measured at one height each, all off their middles to the same side.

    A taper that all courses share moves the table then. Lapped plates have more of it than U has,
    which knows how far butt-welded ones may taper.
    """
    if any(declared_input.name == "taper" for declared_input in job.inputs):
        return []
    sites = field.sites
    parts = [(sites.zeta[members] + 1) / 2 for members in sites.members if len(members)]
    flat = [np.ptp(part) < ONE_HEIGHT for part in parts]
    off = np.mean([np.median(part) for part in parts]) - 0.5
    if np.mean(flat) <= 0.5 or abs(off) < OFF_MIDDLE:
        return []
    text = message(
        "taper_unseen",
        "{count} of {all} courses were measured at one height, in the mean {percent:+.0f} % of a"
        " course's height from the middle: a taper that all courses share would move the table, and"
        " U has one of {taper_mm:.1f} mm (sd, from the middle to an end); lapped plates have more:"
        " measure a second height, or declare taper in uncertainty.csv",
        count=sum(flat),
        all=len(parts),
        percent=100 * off,
        taper_mm=1000 * np.sqrt(3 * _variance_m2(field, "common taper")),
    )
    return of_points(job.points, [text])


def _variance_m2(field, component):
    names = [component.name for component in COMPONENTS]
    return field.amplitudes.variances_m2[names.index(component)]


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
    return of_points(job.points, texts)


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
