"""Limits from rule files for valid surveys, and the allowed difference between repeats."""

import tomllib
from functools import cache
from importlib.resources import files
from itertools import chain

import numpy as np
from scipy.special import ndtri

from tankcal.errors import Problem
from tankcal.job.contract.registers import KIND
from tankcal.messages import message

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

    Parameters
    ----------
    measurements : Measurements
    readings : Readings
        Readings of the adjustment.
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
    estimates : sequence of ToldCause
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
