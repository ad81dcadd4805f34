"""Warnings: what a sound survey of a sound tank hardly has. None of them stops a job."""

from itertools import pairwise

import numpy as np

from tankcal.errors import Problem

FEWEST_POINTS, ADVISED_POINTS = 5, 10  # of a section
WIDE_GAP_DEG = 45
CERTIFICATE_NEEDS = ("number", "laboratory", "customer", "method")
LARGE_NOISE_M, LARGE_JUMP_M, MANY_SNOOPED = 0.010, 0.020, 0.03


def weak_sections(job, groups, azimuth_rad):
    """Sections with few points, or with a part of the turn that nobody measured."""
    texts = []
    for group in groups:
        ordered = np.sort(azimuth_rad[group.members])
        gap = np.degrees(np.max(np.diff(ordered, append=ordered[0] + 2 * np.pi)))
        name = f"section {group.name} (course {job.courses[group.course].name})"
        if len(ordered) < ADVISED_POINTS:
            texts.append(
                f"{name} stands on {len(ordered)} points, {ADVISED_POINTS} or more are advised"
            )
        if gap > WIDE_GAP_DEG:
            texts.append(f"{name} has no point over {gap:.0f} deg of its turn: measure there")
    return _problems(texts)


def doubts(job, shell, sections, given_sd_m):
    """A tilt that is not determined, large scatter, many outliers, radii that jump.

    given_sd_m (n,) standard deviations of the points in plan, or None.
    """
    texts = _of_scatter(shell, given_sd_m)
    if not shell.tilt_known:
        texts.append("the points do not determine a tilt: the shell is taken as upright")
    snooped = np.sum(shell.reason == "snooping")
    tested = snooped + np.sum(shell.reason == "")
    if snooped > max(MANY_SNOOPED * tested, 3):
        texts.append(
            f"{snooped} of {tested} points near the wall were rejected as outliers: are they dents "
            "of the wall, or something before it? The working papers list them"
        )
    for below, above in pairwise(sections):
        plates = [job.courses[section.group.course].thickness_m for section in (below, above)]
        jump = abs(above.circle.radius_m - below.circle.radius_m)
        if jump > LARGE_JUMP_M + abs(plates[1] - plates[0]):
            texts.append(
                f"the radius changes by {1000 * jump:.0f} mm from section {below.group.name} to "
                f"section {above.group.name}: is one of them not the wall?"
            )
    return _problems(texts)


def incomplete(job, undeclared):
    """A warning that names what U does not contain, and one for an incomplete certificate.

    undeclared  names of the inputs that bear on the tank and have no declared uncertainty
    """
    problems = []
    if undeclared:
        problems.append(
            Problem("uncertainty.csv", f"not declared, so not in U: {', '.join(undeclared)}")
        )
    lacking = [key for key in CERTIFICATE_NEEDS if not job.certificate.get(key)]
    if lacking:
        text = f"not given: {', '.join(lacking)}; ISO/IEC 17025, 7.8.2, asks for them"
        problems.append(Problem("job.toml", text, column="certificate"))
    return problems


def _of_scatter(shell, given_sd_m):
    scatter = f"the points scatter by {1000 * shell.noise_m:.1f} mm (sd) about the shell's form"
    if given_sd_m is not None:
        given = np.median(given_sd_m)
        if shell.noise_m > 2 * given:
            return [f"{scatter}, their given sd is {1000 * given:.1f} mm: are the sds too small?"]
    elif shell.noise_m > LARGE_NOISE_M:
        return [f"{scatter}: is there a second surface (insulation, pipes) near the wall?"]
    return []


def _problems(texts):
    return [Problem("points.csv", text) for text in texts]
