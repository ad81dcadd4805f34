"""Causes that misclosures of liquid and geometry may have in a job, as columns to be tested."""

import numpy as np

from tankcal.tank.liquid import Alternative, reduce_steps
from tankcal.tank.liquid.readings import as_fahrenheit, swapped


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
        Alternative("meter", column, name)
        for name, column in zip(fill.meters, _by_meter(metering, fill, reduced), strict=True)
    ]
    told.append(Alternative("radii", over @ loaded.by_offset, unit="m"))
    told.append(Alternative("dip_zero", area.sum(axis=1), unit="m"))
    told += [Alternative("dip", column, int(row), "m")
             for row, column in zip(rows, area.T, strict=True)]  # fmt: skip
    told += [Alternative("batch", column, int(row), "m3")
             for row, column in zip(rows[fill.end], -np.eye(len(fill)), strict=True)]  # fmt: skip
    told += _leaks(metering, fill)
    empty = fill.from_empty.astype(float)
    told.append(Alternative("bottom", empty, unit="m3"))
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
