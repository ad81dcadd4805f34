"""Warnings about a fitted wall: sections, arrangement of the readings and rejected points."""

from itertools import pairwise

import numpy as np

from tankcal.geometry.field.components import COMPONENTS
from tankcal.messages import list_some, message
from tankcal.methods.base import given_methods
from tankcal.pipeline.checks.survey import LARGE_NOISE_M, SHOWN, of_points
from tankcal.pipeline.wall.undecided_columns import tell_undecided

FEWEST_POINTS, ADVISED_POINTS = 5, 10  # least and recommended number of points of a section
WIDE_GAP_DEG = 45
LARGE_JUMP_M, MANY_SNOOPED = 0.020, 0.03
TOLD_ALONE = 3  # largest number of sections that get a warning each
# Relative to a course: range of one height; mean distance from the middle that matters.
ONE_HEIGHT, OFF_MIDDLE = 0.2, 0.1


def weak_sections(job, groups, azimuth_rad):
    """Warnings of sections with few points or with a large gap.

    Sections are named individually, or together if there are more than `TOLD_ALONE` of a kind.
    """
    sparse, gaps = [], []
    for group in groups:
        ordered = np.sort(azimuth_rad[group.members])
        gap = np.degrees(np.max(np.diff(ordered, append=ordered[0] + 2 * np.pi)))
        named = {"section": _shown(job, group), "course": job.courses[group.course].name}
        if len(ordered) < ADVISED_POINTS:
            sparse.append((len(ordered), named))
        if gap > WIDE_GAP_DEG:
            gaps.append((gap, named))
    kinds = (sparse, _with_few, _all_with_few), (gaps, _with_gap, _all_with_gaps)
    texts = []
    for sections, text_of_section, text_of_sections in kinds:
        texts += (
            [text_of_sections(sections)]
            if len(sections) > TOLD_ALONE
            else [text_of_section(*section) for section in sections]
        )
    return of_points(job.points, texts)


def _with_few(count, named):
    """Message about a section with few points."""
    return message(
        "section_weak",
        "section {section} (course {course}) has only {count} points; {advised} or more are "
        "advised",
        **named,
        count=count,
        advised=ADVISED_POINTS,
    )


def _all_with_few(sections):
    """Message about all sections with few points."""
    return message(
        "sections_weak",
        "{all} sections have fewer than {advised} points, {count} at least: {sections}; {advised} "
        "or more are advised",
        all=len(sections),
        count=min(count for count, _ in sections),
        sections=_listed(sections),
        advised=ADVISED_POINTS,
    )


def _with_gap(gap_deg, named):
    """Message about a section with a gap."""
    return message(
        "section_gap",
        "section {section} (course {course}) has no point over {gap_deg:.0f} deg of its "
        "circumference: measure there",
        **named,
        gap_deg=gap_deg,
    )


def _all_with_gaps(sections):
    """Message about all sections with a gap."""
    return message(
        "sections_gap",
        "{all} sections have no point over a part of their circumference, {gap_deg:.0f} deg at "
        "most: {sections}; measure there",
        all=len(sections),
        gap_deg=max(gap_deg for gap_deg, _ in sections),
        sections=_listed(sections),
    )


def _listed(sections):
    """Names of the first sections, with those of their courses."""
    names = [
        message("section_of_course", "{section} (course {course})", **named)
        for _, named in sections
    ]
    return list_some(names, SHOWN)


def _shown(job, group):
    """Name of a section in messages; the level for a section that is named by it."""
    level = group.name.removeprefix(f"{job.courses[group.course].name} ")
    names_levels = any(method.names_levels for method in given_methods(job))
    if not names_levels or level == group.name:
        return group.name
    return message("section_at_level", "at {level_m:.3f} m", level_m=float(level))


def warn_of_taper(job, field):
    """Warning of courses measured at one height each, mostly off their middles to the same side.

    A taper common to all courses would then change the table. U includes the taper of butt-welded
    plates; lapped plates have more.
    """
    if any(declared_input.name == "taper" for declared_input in job.inputs):
        return []
    sites = field.sites
    heights = [(sites.zeta[members] + 1) / 2 for members in sites.members if len(members)]
    is_flat = [np.ptp(height) < ONE_HEIGHT for height in heights]
    mean_offset = np.mean([np.median(height) for height in heights]) - 0.5
    if np.mean(is_flat) <= 0.5 or abs(mean_offset) < OFF_MIDDLE:
        return []
    text = message(
        "taper_unseen",
        "{count} of {all} courses were measured at one height, in the mean {percent:+.0f} % of a"
        " course's height from the middle: a taper that all courses share would move the table, and"
        " U has one of {taper_mm:.1f} mm (sd, from the middle to an end); lapped plates have more:"
        " measure a second height, or declare taper in uncertainty.csv",
        count=sum(is_flat),
        all=len(heights),
        percent=100 * mean_offset,
        taper_mm=1000 * np.sqrt(3 * _variance_m2(field, "common taper")),
    )
    return of_points(job.points, [text])


def _variance_m2(field, component):
    """Variance of a component of the form by its name, m2."""
    names = [entry.name for entry in COMPONENTS]
    return field.amplitudes.variances_m2[names.index(component)]


def check_shell(job, shell, sections, given_sd_m):
    """Warnings of an undetermined tilt, large scatter, many outliers, or jumps of the radius.

    Standard deviations from an adjustment are tested there, by all residuals. The form of a wall
    with different courses is no evidence against them.

    Parameters
    ----------
    job : Job
    shell : Shell
    sections : sequence of Section
    given_sd_m : ndarray, shape (n,), or None
        Standard deviations of the points in plan, m.

    Returns
    -------
    list of Problem
    """
    texts = _texts_of_scatter(shell, None if job.points.from_adjustment else given_sd_m)
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


def _texts_of_scatter(shell, given_sd_m):
    """Warning of a large scatter about the form, against stated standard deviations if given."""
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
