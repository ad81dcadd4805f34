"""Warnings about a fitted wall: sections, arrangement of the readings and rejected points.

Tests whether the noise of the sections is homogeneous and agrees with its stated covariance.

The table uses the stated covariance of the points and amplitudes common to all courses. The scatter
of a section about its circle or about the wall enters U of no row. Two tests show where this is not
justified:

- Bartlett's test of all sections together, on the variance factors of their noise apart from the
  form of the wall. A section takes part if noise is at least half of the scatter of its points.
  Otherwise form that the model lacks would count as noise.
- A two-sided chi-square test of each section against its stated covariance. A small scatter is
  judged about the circle, because form can only add to it. A large scatter is judged apart from the
  form.
"""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from scipy.special import chdtr

from tankcal.errors import Problem
from tankcal.geometry.field.amplitudes import bartlett
from tankcal.geometry.field.components import COMPONENTS
from tankcal.messages import list_some, message
from tankcal.methods.base import given_methods, is_size_measured
from tankcal.pipeline.checks import LARGE_NOISE_M, SHOWN, locate_at_points, noise_is_estimated
from tankcal.pipeline.checks.size import (
    allowed_departure_m,
    inside_radii,
    is_size_declared,
    nominal_radius_m,
)
from tankcal.pipeline.wall.surveyed import tell_undecided

FEWEST_POINTS, ADVISED_POINTS = 5, 10  # least and recommended number of points of a section
WIDE_GAP_DEG = 45
LARGE_JUMP_M, MANY_SNOOPED = 0.020, 0.03
TOLD_ALONE = 3  # largest number of sections that get a warning each
# Relative to a course: range of one height; mean distance from the middle that matters.
ONE_HEIGHT, OFF_MIDDLE = 0.2, 0.1
# Keys of the warnings that only measured points, not planned points, can cause.
OF_SCATTER = ("sections_inhomogeneous", "sections_off_stated")
LEVEL = 0.01  # significance of both tests; rejects 3 of 500 valid simulated surveys
LEAST_SHARE = 0.5  # least share of noise; without it 9 % of the surveys with 0.3 mm fail


def weak_sections(job, groups, azimuth_rad):
    """Warnings of sections with few points or with a large gap.

    Sections are named individually, or together if there are more than `TOLD_ALONE` of a kind.
    """
    sparse, gaps = [], []
    for group in groups:
        ordered = np.sort(azimuth_rad[group.members])
        gap = np.degrees(np.max(np.diff(ordered, append=ordered[0] + 2 * np.pi)))
        named = {"section": _section_name(job, group), "course": job.courses[group.course].name}
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
    return locate_at_points(job.points, texts)


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
        sections=_list_sections(sections),
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
        sections=_list_sections(sections),
    )


def _list_sections(sections):
    """Names of the first sections, with those of their courses."""
    names = [
        message("section_of_course", "{section} (course {course})", **named)
        for _, named in sections
    ]
    return list_some(names, SHOWN)


def _section_name(job, group):
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
    return locate_at_points(job.points, [text])


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
                    below=_section_name(job, below.group),
                    above=_section_name(job, above.group),
                )
            )
    return locate_at_points(job.points, texts)


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


# ---- tests whether the noise of the sections is homogeneous and agrees with its stated


@dataclass(frozen=True)
class SectionTest:
    """Tests of one section.

    Attributes
    ----------
    section : str
        Name of the section.
    factor : float
        Variance of the noise apart from the form, divided by the stated variance.
    dof : float
        Degrees of freedom of `factor`.
    share : float
        Share of noise in the redundancy of the circle; the rest is form.
    chi2, chi2_dof : float, int
        v'Pv about the circle, and n - 3.
    p : float or None
        Two-sided p value of the stated covariance; None if the covariance was estimated.
    is_compared : bool
        Whether the section takes part in Bartlett's test.
    differs : bool
        Whether the section disagrees with its stated covariance (Holm 1979, all sections at 1 %).
    """

    section: str
    factor: float
    dof: float
    share: float
    chi2: float
    chi2_dof: int
    p: float | None
    is_compared: bool
    differs: bool


@dataclass(frozen=True)
class Homogeneity:
    """Tests of the sections of a wall.

    Attributes
    ----------
    sections : tuple of SectionTest
        From the bottom up.
    statistic, dof, p : float or None, int or None, float or None
        Result of Bartlett's test; None if fewer than two sections take part.
    """

    sections: tuple[SectionTest, ...]
    statistic: float | None = None
    dof: int | None = None
    p: float | None = None

    @property
    def compared(self):
        """Sections that take part in Bartlett's test."""
        return [section for section in self.sections if section.is_compared]


def homogeneity_of(job, wall):
    """`Homogeneity` of the sections of a wall surveyed by points.

    Returns
    -------
    Homogeneity or None
        None if points share unknowns of instruments (hits, clouds, tangents) or were averaged in
        cells, because sections then have no separate noise.
    """
    is_sighted = any(method.is_sighted for method in given_methods(job))
    shares_unknowns = is_sighted or job.points.unbound
    if shares_unknowns or wall.points_read != len(wall.accepted):
        return None
    noise = wall.section_noise
    is_stated = not noise_is_estimated(job)
    p = [
        _two_sided(section.circle, section_noise) if is_stated else None
        for section, section_noise in zip(wall.sections, noise, strict=True)
    ]
    differs = _rejected_by_holm(p) if is_stated else np.zeros(len(p), dtype=bool)
    tests = tuple(_test_of(*parts) for parts in zip(wall.sections, noise, p, differs, strict=True))
    compared = [(test.factor, test.dof) for test in tests if test.is_compared]
    if len(compared) < 2:
        return Homogeneity(tests)
    return Homogeneity(tests, *bartlett(*zip(*compared, strict=True)))


def _is_noisy(circle, noise):
    """Whether noise is at least half of the scatter of the points of a section."""
    return noise.redundancy >= LEAST_SHARE * circle.dof


def _two_sided(circle, noise):
    """Two-sided p value of the scatter of a section under its stated covariance."""
    lower = float(chdtr(circle.dof, circle.dof * circle.variance_factor))
    upper = noise.upper_p if _is_noisy(circle, noise) else 1.0
    # Doubling the smaller tail gives a two-sided p value; its bound of 1 keeps it a probability.
    return min(2 * min(lower, upper), 1.0)


def _rejected_by_holm(p):
    """Mask (k,) of the hypotheses rejected at a joint significance `LEVEL` (Holm 1979)."""
    p, order = np.array(p), np.argsort(p)
    passed = p[order] > LEVEL / np.arange(len(p), 0, -1)
    rejected = np.zeros(len(p), dtype=bool)
    rejected[order] = np.cumsum(passed) == 0  # from the first that passes on, all pass
    return rejected


def _test_of(section, noise, p, differs):
    """`SectionTest` of a section."""
    circle = section.circle
    return SectionTest(
        section=section.group.name,
        factor=noise.factor,
        dof=noise.dof,
        share=noise.redundancy / circle.dof,
        chi2=circle.dof * circle.variance_factor,
        chi2_dof=circle.dof,
        p=p,
        is_compared=_is_noisy(circle, noise),
        differs=bool(differs),
    )


def warn_of_sections(job, wall):
    """Warnings of sections whose noise differs, or disagrees with the stated covariance.

    Returns
    -------
    list of Problem
    """
    homogeneity = homogeneity_of(job, wall)
    if homogeneity is None:
        return []
    texts = []
    if homogeneity.p is not None and homogeneity.p < LEVEL:
        quiet, *_, loud = sorted(homogeneity.compared, key=lambda test: test.factor)
        texts.append(
            message(
                "sections_inhomogeneous",
                "the noise of the sections is not homogeneous: Bartlett's statistic is"
                " {statistic:.1f} with {dof} degrees of freedom (p = {p:.1g}); the variance factor"
                " is {least:.2f} in section {low} and {most:.2f} in section {high}. U does not take"
                " the scatter of each section: for the whole tank it averages, of a row or delivery"
                " near section {low} the part by the points is too large (the true sd is"
                " {quiet:.1f} times the one taken), near section {high} too small ({loud:.1f}"
                " times): find the cause, or give the points of each section their own sd",
                statistic=homogeneity.statistic,
                dof=homogeneity.dof,
                p=homogeneity.p,
                least=quiet.factor,
                low=quiet.section,
                most=loud.factor,
                high=loud.section,
                quiet=np.sqrt(quiet.factor),
                loud=np.sqrt(loud.factor),
            )
        )
    differing = [section for section in homogeneity.sections if section.differs]
    if differing:
        texts_of_sections = [
            message(
                "section_off_stated",
                "{section} ({times:.2f} times, p = {p:.1g})",
                section=test.section,
                times=np.sqrt(_ratio(test)),
                p=test.p,
            )
            for test in sorted(differing, key=lambda test: test.p)
        ]
        texts.append(
            message(
                "sections_off_stated",
                "sections whose points scatter more or less than their stated standard deviations"
                " allow (chi-square, all sections together at 1 %): {sections}; U takes the"
                " stated standard deviations: correct them",
                sections=list_some(texts_of_sections, SHOWN),
            )
        )
    return locate_at_points(job.points, texts)


def _ratio(test):
    """Variance over the stated one: about the circle if too small, else apart from the form."""
    # Form can only add to the scatter about the circle, so a ratio below 1 there is due to noise.
    about_circle = test.chi2 / test.chi2_dof
    return about_circle if about_circle < 1 else test.factor


# ---- checks of the number of bare hits or tangents per level and course, and of the wall's size


def levels_with_few(wall, least):
    """Return the names of the first sections with fewer than `least` points, or None."""
    names = [section.group.name for section in wall.sections if len(section.group.members) < least]
    return list_some(names, SHOWN) if names else None


def courses_with_few(job, wall, least, *, slopes_count=False):
    """Return the names of the first courses with fewer than `least` levels, or None.

    A course without any level is not listed: straps or lines determine it.

    Parameters
    ----------
    job : Job
    wall : Wall
    least : int
        Smallest number of levels.
    slopes_count : bool, optional
        Whether a section with a slope counts as evidence of a taper.

    Returns
    -------
    Message or None
    """
    groups = [section.group for section in wall.sections]
    courses = [group.course for group in groups]
    sloped = {group.course for group in groups if slopes_count and group.degree}
    names = [
        course.name
        for index, course in enumerate(job.courses)
        if 0 < courses.count(index) < least and index not in sloped
    ]
    return list_some(names, SHOWN) if names else None


def girth_m(job):
    """Return the nominal circumference, m, on which the number of hits or tangents depends."""
    return np.pi * job.tank.nominal_diameter_m


def check_nominal(job, wall, file):
    """Yield a warning of a shell whose radius differs from the drawing.

    An offset or a scale without other control changes the radius, and only this check can detect
    it.

    Parameters
    ----------
    job : Job
    wall : Wall
    file : str
        File of the hits or tangents.

    Yields
    ------
    Problem
    """
    radii = inside_radii(job, wall)
    deviation_m = float(np.median(radii.radius_m)) - nominal_radius_m(job, float(radii.plate_m[0]))
    if abs(deviation_m) > allowed_departure_m(job):
        text = message(
            "wall_unlike_nominal",
            "the courses come out {miss_mm:+.0f} mm of radius from the nominal one: is the offset"
            " or the scale of the instrument wrong, or the length of the bar?",
            miss_mm=1000 * deviation_m,
        )
        yield Problem(file, text)


def check_size_measured(job, instruments):
    """Yield a warning of a wall whose size only the distances of instruments determine.

    A wrong constant or scale in all of them changes every radius without any contradiction in the
    readings. An error up to 1 in 500 of the nominal radius, many times U, remains undetected.

    Parameters
    ----------
    job : Job
    instruments : sequence of str
        Names of the instruments.

    Yields
    ------
    Problem
    """
    if is_size_measured(job) or is_size_declared(job):
        return
    text = message(
        "size_told_by_distances",
        "blank, and nothing but the distances of {instruments} tells how large the tank is: the"
        " constant of a prism or a wrong scale would not show; say what the nominal diameter is on"
        " the drawing, or strap a course",
        instruments=list_some(instruments, SHOWN),
    )
    yield Problem("job.toml", text, column="checks.diameter_is")
