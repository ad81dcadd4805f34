"""Warnings: what a sound survey of a sound tank hardly has. None of them stops a job."""

from itertools import pairwise

import numpy as np

from tankcal.body import OWN_SCALE
from tankcal.errors import Problem, SolutionError
from tankcal.shell import VAGUE_TILT

FEWEST_POINTS, ADVISED_POINTS = 5, 10  # of a section
WIDE_GAP_DEG = 45
SHOWN = 5  # names in a message
CERTIFICATE_NEEDS = ("number", "laboratory", "customer", "method")
LARGE_NOISE_M, LARGE_JUMP_M, MANY_SNOOPED = 0.010, 0.020, 0.03
VAGUE = 5.0  # times the median sd: what a point with one poor ray too few has
OF_VERTICAL = (
    "plumb lines, height differences, vertical or zenith angles, or control points with known "
    "heights give it"
)
OF_SCALE = "distances, or control points that lie apart, give it"


def noise_is_estimated(job):
    """Whether the points' covariance is scaled by what their residuals say.

    That of an adjustment has been scaled there, by all its residuals.
    """
    points = job.points
    given = points.sd_m is not None or points.covariance_m2 is not None
    return not given or (job.scale == "a_posteriori" and not points.from_adjustment)


def origin_of(points):
    """Where points come from, as messages name it."""
    return "adjusted points" if points.from_adjustment else "points.csv"


def refuse_undetermined(datum):
    """Raise SolutionError while a survey's vertical or scale is not determined.

    datum  `surveys.DatumReport`
    """
    missing = []
    if not datum.vertical:
        missing.append(f"the vertical is not determined by any observation: {OF_VERTICAL}")
    if not datum.scale:
        missing.append(f"the scale is not determined by any observation: {OF_SCALE}")
    if missing:
        raise SolutionError("no capacity: " + "; ".join(missing))


def of_adjustment(job, adjustment):
    """What a survey that was adjusted along leaves open: heights of the frame, a scale twice."""
    problems, datum = [], adjustment.datum
    if (
        datum.choice in ("inner", "fixed_photo")
        and datum.defect
        and job.datum.bottom_z_m is not None
    ):
        text = (
            f"datum = {datum.choice}: nothing measured fixes the heights of the frame. bottom_z_m "
            f"is taken in the frame of the results, held by {_listed(datum.held)}: check it there"
        )
        problems.append(Problem("job.toml", text, column="datum.bottom_z_m"))
    scales = [
        f"{one.name} ({one.u:g} {one.unit})" for one in adjustment.causes if one.what == OWN_SCALE
    ]
    if scales and any(one.name == "scale" for one in job.inputs):
        text = (
            f"scale is declared beside that of {_listed(scales)} in instruments.toml, which the "
            "points contain: both count, which is right only for different causes"
        )
        problems.append(Problem("uncertainty.csv", text, column="input"))
    return tuple(problems)


def vague_vertical(points):
    """A vertical that adjusted points have, but hardly know: the sd of their common lean."""
    if not points.from_adjustment:
        return []
    x, y, z = (points.xyz_m - points.xyz_m.mean(axis=0)).T
    lean = np.zeros((len(x), 3, 2))
    lean[:, 0, 0], lean[:, 2, 0] = z, -x
    lean[:, 1, 1], lean[:, 2, 1] = z, -y
    angle = np.linalg.pinv(lean.reshape(-1, 2))
    sd = np.sqrt(np.linalg.eigvalsh(angle @ points.covariance_m2 @ angle.T)[-1])
    if sd <= VAGUE_TILT:
        return []
    text = f"the vertical is known to {1000 * sd:.1f} mm/m only (sd), so is the tilt: {OF_VERTICAL}"
    return _problems(points, [text])


def _listed(names):
    """Names in a row, the first few of many."""
    shown = ", ".join(map(str, names[:SHOWN]))
    return f"{shown} and {len(names) - SHOWN} more" if len(names) > SHOWN else shown


def vague_points(points, accepted, sds_m):
    """Points of the wall that the survey hardly determines, and a wall of such points.

    accepted (m,) indices of the points of the wall; sds_m (n,) in plan, or None.
    """
    if sds_m is None:
        return []
    own = sds_m[accepted]
    middle, texts = np.median(own), []
    vague = np.flatnonzero(own > VAGUE * middle)
    if len(vague):
        worst = vague[np.argsort(-own[vague])]
        names = _listed([f"{points.names[accepted[i]]} ({1000 * own[i]:.1f} mm)" for i in worst])
        texts.append(
            f"the sd of {len(vague)} points of the wall is over {VAGUE:g} times the median "
            f"({1000 * middle:.1f} mm): {names}; more or better rays are needed there"
        )
    if middle > LARGE_NOISE_M:
        texts.append(
            f"the points of the wall are known to {1000 * middle:.1f} mm (median sd in plan): "
            "dents and ovality of that size are not told from noise"
        )
    return _problems(points, texts)


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
    return _problems(job.points, texts)


def doubts(job, shell, sections, given_sd_m):
    """A tilt that is not determined, large scatter, many outliers, radii that jump.

    given_sd_m (n,) standard deviations of the points in plan, or None. Those of an adjustment are
    tested there, by all its residuals: a wall whose courses differ proves nothing against them.
    """
    texts = _of_scatter(shell, None if job.points.from_adjustment else given_sd_m)
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
    return _problems(job.points, texts)


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


def _problems(points, texts):
    return [Problem(origin_of(points), text) for text in texts]
