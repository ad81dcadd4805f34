"""Warnings that are unlikely for a valid survey of a tank without defects; none stops a job.

`size` compares the surveyed size with the drawing, `wall` examines sections and rejected points.
"""

import tomllib
from functools import cache
from importlib.resources import files
from itertools import chain

import numpy as np
from scipy.special import ndtri

from tankcal.errors import Problem, SolutionError
from tankcal.geometry.shell import VAGUE_TILT
from tankcal.job.certificate_entries import missing_entries
from tankcal.job.contract.registers import KIND
from tankcal.job.plausibility import VOLUME_MISS
from tankcal.messages import list_some, message
from tankcal.tank.body import OWN_SCALE

SHOWN = 5  # names listed in a message
LARGE_NOISE_M = 0.010  # median standard deviation in plan that causes a warning
CONFIRMED = 0.5  # least ratio of scatter and stated standard deviation, either way, to agree
VAGUE = 5.0  # standard deviation of a poorly determined point, relative to the median
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
    """Whether the covariance of the points is scaled by their residuals.

    An adjustment scales its covariance itself, by all its residuals.
    """
    points = job.points
    has_covariance = points.sd_m is not None or points.covariance_m2 is not None
    return not has_covariance or (job.scale == "a_posteriori" and not points.from_adjustment)


def origin_of(points):
    """Origin of the points, as named in messages."""
    if points.file:
        return points.file
    return "adjusted points" if points.from_adjustment else "points.csv"


def refuse_undetermined(datum):
    """Raise SolutionError while the vertical or the scale of a survey is not determined.

    Parameters
    ----------
    datum : DatumReport
        Datum of the adjusted survey.

    Raises
    ------
    SolutionError
        Its message names observations that would determine the vertical or the scale.
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
    """Questions about an adjusted survey that the user must decide: heights and scale.

    Parameters
    ----------
    job : Job
    datum : DatumReport
        Datum of the adjusted survey.
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
            held=_list_points(datum.held),
        )
        problems.append(Problem("job.toml", text, column="datum.bottom_z_m"))
    scales = [
        message("with_u", "{name} ({u:g} {unit})", name=cause.name, u=cause.u, unit=cause.unit)
        for cause in causes
        if cause.what == OWN_SCALE
    ]
    if scales and any(declared_input.name == "scale" for declared_input in job.inputs):
        text = message(
            "scale_twice",
            "scale is declared, and that of {instruments} in instruments.toml is already in "
            "the points: both count, which is right only if their causes are different",
            instruments=list_some(scales, SHOWN),
        )
        problems.append(Problem("uncertainty.csv", text, column="input"))
    return tuple(problems)


def _list_points(names):
    if "all" in names:
        return message("all_points", "all points")
    return list_some(names, SHOWN)


def warn_of_vague_vertical(points):
    """Warning of adjusted points whose common tilt has a large standard deviation."""
    if not points.from_adjustment:
        return []
    x, y, z = (points.xyz_m - points.xyz_m.mean(axis=0)).T
    lean = np.zeros((len(x), 3, 2))
    lean[:, 0, 0], lean[:, 2, 0] = z, -x
    lean[:, 1, 1], lean[:, 2, 1] = z, -y
    # The common tilt is the least squares estimate from the displacements of the points.
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
    return locate_at_points(points, [text])


def warn_of_vague_points(points, accepted, sds_m, noise_m):
    """Warnings of wall points with large standard deviations.

    Large standard deviations of supplied points that the scatter confirms cause no warning. They
    describe the survey, and U includes them.

    Parameters
    ----------
    points : Points
    accepted : ndarray of int, shape (m,)
        Indices of the wall points.
    sds_m : ndarray, shape (n,), or None
        Standard deviations of all points in plan, m.
    noise_m : float
        Scatter of the points about the form of the shell, m.

    Returns
    -------
    list of Problem
    """
    if sds_m is None:
        return []
    sds_of_wall = sds_m[accepted]
    median_m, texts = np.median(sds_of_wall), []
    vague = np.flatnonzero(sds_of_wall > VAGUE * median_m)
    if len(vague):
        worst = vague[np.argsort(-sds_of_wall[vague])]
        texts.append(
            message(
                "points_vague",
                "the sd of {count} points of the wall is over {times:g} times the median"
                " ({median_mm:.1f} mm): {points}; more or better rays are needed there",
                count=len(vague),
                times=VAGUE,
                median_mm=1000 * median_m,
                points=list_some(
                    [
                        message(
                            "with_sd",
                            "{name} ({sd_mm:.1f} mm)",
                            name=points.names[accepted[i]],
                            sd_mm=1000 * sds_of_wall[i],
                        )
                        for i in worst
                    ],
                    SHOWN,
                ),
            )
        )
    is_confirmed = CONFIRMED * median_m < noise_m < median_m / CONFIRMED
    if median_m > LARGE_NOISE_M and (points.from_adjustment or not is_confirmed):
        texts.append(
            message(
                "points_noisy",
                "the points of the wall are known to {sd_mm:.1f} mm (median sd in plan): "
                "dents and ovality of that size cannot be told from noise",
                sd_mm=1000 * median_m,
            )
        )
    return locate_at_points(points, texts)


def warn_of_undeclared(undeclared):
    """Warning that names the inputs without a declared uncertainty, which U does not include.

    The names in `undeclared` are those of the inputs that affect the tank.
    """
    if not undeclared:
        return ()
    text = message("undeclared", "not declared, so not in U: {inputs}", inputs=list(undeclared))
    return (Problem("uncertainty.csv", text),)


def incomplete_certificate(job, has_letterhead=False):
    """Warning that names the missing entries of a certificate, with or without a letterhead."""
    location = job.tank.details.get("location")
    missing = missing_entries(job.certificate, location, has_letterhead)
    if not missing:
        return ()
    text = message(
        "certificate_incomplete",
        "not given: {entries}; ISO/IEC 17025, 7.8.2 and 7.8.4, requires them: the certificate is a"
        " draft",
        entries=missing,
    )
    return (Problem("job.toml", text, column="certificate"),)


def compare_with_nominal(tank, capacity_m3):
    """Warning of a capacity far from the nominal volume."""
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


def locate_at_points(points, texts):
    """`Problem`s with the given texts, located at the points."""
    return [Problem(origin_of(points), text) for text in texts]


# ---- instruments

BY_CHANCE = 0.01  # share of valid surveys with an apparent movement due to scatter
UNLIKE_SDS = 3.0  # largest difference of two readings of a base, in standard deviations
HIT_LIMITS = "wall_hits"


def limits_of(survey):
    """Limits of a kind of survey, by the name of its file in limits/."""
    return _read_limits("tankcal.pipeline", f"limits/{survey}.toml")


def limits_of_method(package):
    """Limits of a method, from limits.toml in its package."""
    return _read_limits(package, "limits.toml")


@cache
def _read_limits(package, path):
    return tomllib.loads(files(package).joinpath(path).read_text("utf-8"))


def limit_at(survey, table, figure, circumference_m):
    """Limit that depends on the circumference, from the first applicable row of a rule file.

    Parameters
    ----------
    survey, table, figure : str
        Name of the rule file, of its table, and of the limit in a row.
    circumference_m : float
        Circumference of the tank, m.

    Returns
    -------
    float
    """
    rows = limits_of(survey)[table]
    return next(row[figure] for row in rows if circumference_m <= row.get("up_to_m", np.inf))


def repeat_factor(count):
    """Difference between `count` repeats and their first readings, in standard deviations.

    At least one repeat exceeds it in one of a hundred valid surveys.
    """
    return np.sqrt(2) * -ndtri(BY_CHANCE / 2 / count)


# ---- check of a stadia base: both ends and repeated readings must give the same length


def check_bases(measurements):
    """`Problem`s of the bases measured with stadia bars."""
    if measurements is None:
        return ()
    bars = {instrument.name for instrument in measurements.instruments if instrument.kind == KIND}
    bases = {}
    for table in measurements.readings:
        if table.table != "distances":
            continue
        for i, name in enumerate(table.instrument):
            if name in bars:
                key = tuple(sorted((table.start[i], table.end[i])))
                row = table.rows[i] if table.rows else None
                reading = table.start[i], float(table.value[i]), row, table.file, float(table.sd[i])
                bases.setdefault(key, []).append(reading)
    return tuple(chain.from_iterable(_check_base(*item) for item in bases.items()))


def check_rejected_bases(measurements, readings):
    """`Problem`s of bases that the adjustment rejected, because two scales contradict each other.

    A survey has few bases and many distances. The distances therefore prevail, whichever scale is
    wrong.
    """
    bars = {instrument.name for instrument in measurements.instruments if instrument.kind == KIND}
    bases = {
        (table.file, row)
        for table in measurements.readings
        if table.table == "distances" and table.rows
        for row, name in zip(table.rows, table.instrument, strict=True)
        if name in bars
    }
    for rejected in readings.where(readings.removed):
        if (rejected.file, rejected.row) in bases:
            text = message(
                "base_rejected",
                "the base {first} to {second} was rejected, {off_mm:+.1f} mm from the other"
                " distances (|w| = {w:.1f}): is the length of the bar or the scale of the"
                " distances wrong?",
                first=rejected.ids[0],
                second=rejected.ids[1],
                off_mm=-1000 * rejected.residual,
                w=abs(rejected.w),
            )
            yield Problem(rejected.file, text, rejected.row, "to")


def _check_base(ends, readings):
    """`Problem`s of one base, from its readings (start, length, row, file, standard deviation)."""
    starts, lengths, rows, files, sds = zip(*readings, strict=True)
    if len(set(starts)) < 2:
        text = message(
            "base_from_one_end",
            "the base {first} to {second} was read with the stadia at one end only; expected it"
            " again with theodolite and stadia exchanged",
            first=ends[0],
            second=ends[1],
        )
        yield Problem(files[0], text, rows[0], "to")
    scatter = UNLIKE_SDS * np.sqrt(2) * float(np.median(sds))  # exceeds the limit for long bases
    limit, spread = max(limits_of("tangents")["base_mm"] / 1000, scatter), float(np.ptp(lengths))
    if spread > limit * (1 + 1e-9):
        worst = int(np.argmax(np.abs(np.array(lengths) - np.median(lengths))))
        text = message(
            "base_differs",
            "the base {first} to {second} comes out {spread_mm:.1f} mm apart, over the limit of"
            " {limit_mm:.2g} mm: did the stadia or the theodolite move, or is an angle wrong?",
            first=ends[0],
            second=ends[1],
            spread_mm=1000 * spread,
            limit_mm=1000 * limit,
        )
        yield Problem(files[worst], text, rows[worst], "to")


# ---- warnings about offsets and scales of instruments that range on the wall: hits and clouds


def causes_unlike_certificates(wall, estimates, file="instruments.toml", *, taken_off_m):
    """Warn of offsets and scales that differ from their certificates, according to the wall.

    The wall controls them only with straps, or with hits from both sides.

    Parameters
    ----------
    wall : Wall
    estimates : sequence of EstimatedCause
    file : str
        File of the certificates.
    taken_off_m : dict
        {instrument: offset already corrected in its readings, m}.

    Yields
    ------
    Problem
    """
    if not estimates or (wall.straps is None and not wall.by_inputs):
        return
    for cause in estimates:
        if not np.isfinite(cause.u_before) and cause.what == "instrument_offset":
            yield from _strange_offset(cause, taken_off_m.get(cause.name, 0.0), file)
        if not np.isfinite(cause.u_before) or abs(cause.value) <= UNLIKE_SDS * cause.u_before:
            continue
        ratio = abs(cause.value) / cause.u_before
        if cause.what == "instrument_offset":
            key, text = (
                "u_offset_mm",
                message(
                    "offset_unlike_certificate",
                    "the wall makes the offset of {name} {value_mm:+.2f} mm, {ratio:.1f} times its"
                    " u_offset_mm: is that of another reflector, or a strap or a plate wrong?",
                    name=cause.name,
                    value_mm=1000 * cause.value,
                    ratio=ratio,
                ),
            )
        else:
            key, text = (
                "u_scale_ppm",
                message(
                    "scale_unlike_certificate",
                    "the wall makes the scale of {name} {value_ppm:+.0f} ppm, {ratio:.1f} times its"
                    " u_scale_ppm",
                    name=cause.name,
                    value_ppm=1e6 * cause.value,
                    ratio=ratio,
                ),
            )
        yield Problem(file, text, None, f"{cause.name}.{key}")


def _strange_offset(cause, taken_off_m, file):
    """Warn of an offset without certificate that is larger than usual for instruments."""
    most = limits_of(HIT_LIMITS)["most_offset_mm"] / 1000
    value = cause.value + taken_off_m
    if abs(value) > most + UNLIKE_SDS * cause.u_after:
        text = message(
            "offset_strange",
            "straps and wall make the offset of {name} {value_mm:+.2f} mm; on a bare wall it is"
            " seldom more than {most_mm:g} mm: was the constant of a reflector set, is a strap"
            " misread, or are circumferences those of the inside?",
            name=cause.name,
            value_mm=1000 * value,
            most_mm=1000 * most,
        )
        yield Problem(file, text, None, f"{cause.name}.u_offset_mm")
