"""Causes that misclosures of liquid and geometry may have in a job, as columns to be tested."""

import numpy as np

from tankcal.messages import join_with_or, message
from tankcal.tank.liquid import Alternative, reduce_steps
from tankcal.tank.liquid.readings import as_fahrenheit, swapped

MOST_TOLD = 3  # kinds of causes in a sentence
MOST_FACTOR, MOST_LENGTH_M = 0.1, 0.5  # of a meter; of a zero, a dip or a radius


def alternatives_of(found):
    """`Alternative`s of adjusted runs: meter, radii, dips, batches, leak, bottom, temperatures.

    Parameters
    ----------
    found : LiquidFound
    """
    geometry, fill, reduced = found.known.geometry, found.fill, found.reduced
    metering, loaded = geometry.job.liquid, found.loaded
    over = fill.differences(reduced.carried)
    rows = metering.row[fill.dip_row]
    area = over * loaded.area_m2
    told = [
        Alternative("meter", column, name, most=MOST_FACTOR)
        for name, column in zip(fill.meters, _by_meter(metering, fill, reduced), strict=True)
    ]
    length = {"unit": "m", "most": MOST_LENGTH_M}
    told.append(Alternative("radii", over @ loaded.by_offset, **length))
    told.append(Alternative("dip_zero", area.sum(axis=1), **length))
    told += [Alternative("dip", column, int(row), **length)
             for row, column in zip(rows, area.T, strict=True)]  # fmt: skip
    filled = float(np.sum(np.abs(reduced.metered_m3)))
    told += [Alternative("batch", column, int(row), "m3", most=filled)
             for row, column in zip(rows[fill.end], -np.eye(len(fill)), strict=True)]  # fmt: skip
    told += _leaks(metering, fill)
    empty = fill.from_empty.astype(float)
    told.append(Alternative("bottom", empty, unit="m3", most=filled))
    told += _temperatures(metering, fill, loaded, reduced)
    return tuple(one for one in told if np.any(one.column) and np.all(np.isfinite(one.column)))


def _by_meter(metering, fill, reduced):
    of = np.array(metering.meter)
    return [-reduced.by_row_m3[:, of == name].sum(axis=1) for name in fill.meters]


def _leaks(metering, fill):
    """A valve that passes at a steady rate, m3/h by the times of the rows; without, by the step."""
    hours = _hours(metering, fill)
    told = [Alternative("leak", hours, None, "m3/h" if _is_timed(metering) else "m3")]
    if len(fill.runs) > 1:
        told += [
            Alternative("leak", np.where(fill.run == number, hours, 0.0), name, told[0].unit)
            for number, name in enumerate(fill.runs)
        ]
    return told


def _is_timed(metering):
    return all(time is not None for time in metering.time)


def _hours(metering, fill):
    """(n,) duration of each step, h; 1 where times are not known."""
    if not _is_timed(metering):
        return np.ones(len(fill))
    moments = np.array(metering.time, dtype="datetime64[s]").astype(float) / 3600
    starts = {}
    for place, run in enumerate(metering.run):
        starts.setdefault(run, moments[place])
    first = np.array([starts[fill.runs[run]] for run in fill.run])
    ends = moments[fill.dip_row]
    before = np.where(fill.from_empty, first, ends[fill.start])
    return ends[fill.end] - before


def _temperatures(metering, fill, loaded, reduced):
    told = []
    for kind, rows in (("fahrenheit", as_fahrenheit(metering)), ("swapped", swapped(metering))):
        other = reduce_steps(rows, fill, loaded.volume_m3, loaded.growth)
        column = reduced.misclosure_m3 - other.misclosure_m3
        told.append(Alternative(kind, column, unit="", is_whole=True))
    return told


def causes_in_words(named):
    """Named causes in one sentence: the likeliest of each kind.

    Parameters
    ----------
    named : sequence of Verdict
        The likeliest first.
    """
    first = {}
    for one in named:
        first.setdefault(one.cause.kind, one)
    return join_with_or([_cause(one) for one in list(first.values())[:MOST_TOLD]])


def _cause(one):
    """A cause in words, with its size."""
    size, of = one.size, one.cause.of
    if one.cause.kind == "meter":
        return message("cause_meter", "the factor of meter {name}, off by {size:+.3f} %",
                       name=of, size=-100 * size)  # fmt: skip
    if one.cause.kind == "radii":
        return message("cause_radii", "the radii of the geometry, off by {size:+.1f} mm",
                       size=-1000 * size)  # fmt: skip
    if one.cause.kind == "dip_zero":
        return message("cause_dip_zero", "the zero of all dips, off by {size:+.1f} mm",
                       size=-1000 * size)  # fmt: skip
    if one.cause.kind == "dip":
        return message("cause_dip", "the dip of row {row}, off by {size:+.1f} mm",
                       row=of, size=-1000 * size)  # fmt: skip
    if one.cause.kind == "batch":
        return message("cause_batch", "the batch of row {row}, which lacks {size:+.3f} m3: is a "
                       "batch missing, or counted twice?", row=of, size=size)  # fmt: skip
    if one.cause.kind == "bottom":
        return message("cause_bottom", "the volume of the bottom, off by {size:+.3f} m3",
                       size=-size)  # fmt: skip
    return _so_or_not(one, size)


def is_steady_leak(one):
    """Whether a `Verdict` is of a leak in all runs."""
    return one.cause.kind == "leak" and one.cause.of is None


def leak_unit(cause):
    """Unit of the size of a leak, as written."""
    return cause.unit if cause.unit != "m3" else message("m3_a_step", "m3 a step")


def _so_or_not(one, size):
    if one.cause.kind == "leak":
        return message("cause_leak", "a valve that passes, {size:+.3f} {unit}", size=size,
                       unit=leak_unit(one.cause))  # fmt: skip
    if one.cause.kind == "fahrenheit":
        return message("cause_fahrenheit", "temperatures in degrees Fahrenheit")
    return message("cause_swapped", "temperatures at the meter and in the tank that changed places")
