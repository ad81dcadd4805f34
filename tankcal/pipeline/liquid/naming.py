"""Possible causes of the misclosures between liquid and geometry, as columns for tests."""

import numpy as np

from tankcal.messages import join_with_or, message
from tankcal.tank.liquid import Alternative, reduce_steps
from tankcal.tank.liquid.reduction import as_fahrenheit, swapped

MOST_TOLD = 3  # largest number of kinds of causes in a sentence
# Largest plausible errors: relative, of a meter factor; in m, of a zero, a dip or a radius.
MOST_FACTOR, MOST_LENGTH_M = 0.1, 0.5


def alternatives_of(adjustment):
    """Return the possible causes of the misclosures of adjusted runs.

    The causes are meter, radii, dip zero, single dips and batches, leak, bottom, and temperatures.

    Parameters
    ----------
    adjustment : LiquidFound

    Returns
    -------
    tuple of Alternative
    """
    geometry, fill, reduced = adjustment.known.geometry, adjustment.fill, adjustment.reduced
    metering, loaded = geometry.job.liquid, adjustment.loaded
    over = fill.differences(reduced.carried)
    rows = metering.row[fill.dip_row]
    area = over * loaded.area_m2
    causes = [
        Alternative("meter", column, name, most=MOST_FACTOR)
        for name, column in zip(fill.meters, _meter_columns(metering, fill, reduced), strict=True)
    ]
    length = {"unit": "m", "most": MOST_LENGTH_M}
    causes.append(Alternative("radii", over @ loaded.by_offset, **length))
    causes.append(Alternative("dip_zero", area.sum(axis=1), **length))
    causes += [Alternative("dip", column, int(row), **length)
             for row, column in zip(rows, area.T, strict=True)]  # fmt: skip
    filled = float(np.sum(np.abs(reduced.metered_m3)))
    causes += [Alternative("batch", column, int(row), "m3", most=filled)
             for row, column in zip(rows[fill.end], -np.eye(len(fill)), strict=True)]  # fmt: skip
    causes += _leak_causes(metering, fill)
    empty = fill.from_empty.astype(float)
    causes.append(Alternative("bottom", empty, unit="m3", most=filled))
    causes += _temperature_causes(metering, fill, loaded, reduced)
    return tuple(
        cause for cause in causes if np.any(cause.column) and np.all(np.isfinite(cause.column))
    )


def _meter_columns(metering, fill, reduced):
    """Effect (n,) of each meter factor on the misclosures."""
    meters = np.array(metering.meter)
    return [-reduced.by_row_m3[:, meters == name].sum(axis=1) for name in fill.meters]


def _leak_causes(metering, fill):
    """Leaks of a valve at a steady rate, in all runs and in each run.

    The rate is in m3/h if all rows have times, otherwise in m3 per step.
    """
    hours = _step_hours(metering, fill)
    leaks = [Alternative("leak", hours, None, "m3/h" if _is_timed(metering) else "m3")]
    if len(fill.runs) > 1:
        leaks += [
            Alternative("leak", np.where(fill.run == number, hours, 0.0), name, leaks[0].unit)
            for number, name in enumerate(fill.runs)
        ]
    return leaks


def _is_timed(metering):
    """Whether all rows have a time."""
    return all(time is not None for time in metering.time)


def _step_hours(metering, fill):
    """Duration of each step, h, shape (n,); 1 without times."""
    if not _is_timed(metering):
        return np.ones(len(fill))
    moments = np.array(metering.time, dtype="datetime64[s]").astype(float) / 3600
    starts = {}
    for place, run in enumerate(metering.run):
        starts.setdefault(run, moments[place])
    first = np.array([starts[fill.runs[run]] for run in fill.run])
    ends = moments[fill.dip_row]
    # A step from the empty tank begins at the first row of its run.
    before = np.where(fill.from_empty, first, ends[fill.start])
    return ends[fill.end] - before


def _temperature_causes(metering, fill, loaded, reduced):
    """Confused temperatures: in degrees Fahrenheit, or of meter and tank exchanged."""
    causes = []
    for kind, rows in (("fahrenheit", as_fahrenheit(metering)), ("swapped", swapped(metering))):
        changed = reduce_steps(rows, fill, loaded.volume_m3, loaded.growth)
        column = reduced.misclosure_m3 - changed.misclosure_m3
        causes.append(Alternative(kind, column, unit="", is_whole=True))
    return causes


def causes_in_words(named):
    """Return named causes in one sentence: the likeliest of each kind.

    Parameters
    ----------
    named : sequence of Verdict
        Verdicts, the likeliest first.

    Returns
    -------
    Message
    """
    by_kind = {}
    for verdict in named:
        by_kind.setdefault(verdict.cause.kind, verdict)
    return join_with_or([_cause(verdict) for verdict in list(by_kind.values())[:MOST_TOLD]])


def _cause(verdict):
    """A cause in words, with its size."""
    size, name = verdict.size, verdict.cause.of
    if verdict.cause.kind == "meter":
        return message("cause_meter", "the factor of meter {name}, off by {size:+.3f} %",
                       name=name, size=-100 * size)  # fmt: skip
    if verdict.cause.kind == "radii":
        return message("cause_radii", "the radii of the geometry, off by {size:+.1f} mm",
                       size=-1000 * size)  # fmt: skip
    if verdict.cause.kind == "dip_zero":
        return message("cause_dip_zero", "the zero of all dips, off by {size:+.1f} mm",
                       size=-1000 * size)  # fmt: skip
    if verdict.cause.kind == "dip":
        return message("cause_dip", "the dip of row {row}, off by {size:+.1f} mm",
                       row=name, size=-1000 * size)  # fmt: skip
    if verdict.cause.kind == "batch":
        return message("cause_batch", "the batch of row {row}, which lacks {size:+.3f} m3: is a "
                       "batch missing, or counted twice?", row=name, size=size)  # fmt: skip
    if verdict.cause.kind == "bottom":
        return message("cause_bottom", "the volume of the bottom, off by {size:+.3f} m3",
                       size=-size)  # fmt: skip
    return _other_cause(verdict, size)


def is_steady_leak(verdict):
    """Whether a `Verdict` is about a leak in all runs."""
    return verdict.cause.kind == "leak" and verdict.cause.of is None


def leak_unit(cause):
    """Return the unit of the size of a leak for a message."""
    return cause.unit if cause.unit != "m3" else message("m3_a_step", "m3 a step")


def _other_cause(verdict, size):
    """Cause of kind leak, Fahrenheit or exchanged temperatures, in words."""
    if verdict.cause.kind == "leak":
        return message("cause_leak", "a valve that passes, {size:+.3f} {unit}", size=size,
                       unit=leak_unit(verdict.cause))  # fmt: skip
    if verdict.cause.kind == "fahrenheit":
        return message("cause_fahrenheit", "temperatures in degrees Fahrenheit")
    return message("cause_swapped", "temperatures at the meter and in the tank that changed places")
