"""Warnings about offsets and scales of instruments that range on the wall: hits and clouds."""

import numpy as np

from tankcal.errors import Problem
from tankcal.messages import message
from tankcal.pipeline.checks.survey_limits import limits_of

RULES = "wall_hits"
UNLIKE_SDS = 3.0  # largest deviation of an offset or scale from its certificate, in sds


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
    most = limits_of(RULES)["most_offset_mm"] / 1000
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
