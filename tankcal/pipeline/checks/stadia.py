"""Check of a stadia base: both ends and repeated readings must give the same length."""

from itertools import chain

import numpy as np

from tankcal.errors import Problem
from tankcal.job.contract.stadia import KIND
from tankcal.messages import message
from tankcal.pipeline.checks.survey_limits import limits_of

UNLIKE_SDS = 3.0  # largest difference of two readings of a base, in standard deviations


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
