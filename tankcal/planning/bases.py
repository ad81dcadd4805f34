"""Bases of a plan: distances from angles to a stadia over one station, read from another."""

from dataclasses import replace

import numpy as np

from tankcal.job.checking import has_rows
from tankcal.job.checks.survey.stadia import bars_used
from tankcal.planning.model import Base
from tankcal.survey.measurements import Readings
from tankcal.survey.stadia import angle_of_distance_rad, distance_sd_m
from tankcal.units import ARCSEC

STADIA_FILE = "stadia.csv"
NEW_SD_RAD = ARCSEC  # standard deviation of the angle of an added base if the plan has no base


def bases_of(table, bars):
    """Return the `Base`s of the rows of a plan's stadia.csv; () if it has no rows.

    Parameters
    ----------
    table : ColumnValues or None
    bars : dict
        {name: {key: value}} of the stadias in the instruments.
    """
    if not has_rows(table):
        return ()
    columns = (table.of("setup"), table.of("to"), bars_used(table, bars))
    columns += table.of("s_arcsec"), table.of("readings"), table.rows
    return tuple(
        Base(setup, to, bar, sd * ARCSEC, int(readings or 1), row)
        for setup, to, bar, sd, readings, row in zip(*columns, strict=True)
    )


def base_m(plan, base):
    """Nominal horizontal length of a Base of a Plan, m."""
    points = plan.points
    return float(np.hypot(*(points[base.to] - points[base.setup])[:2]))


def angle_of_base_rad(plan, base):
    """Angle between the ends of the bar of a Base at its nominal length, rad."""
    return float(angle_of_distance_rad(base_m(plan, base), plan.bars[base.bar]))


def base_sd_m(plan, base):
    """Standard deviation of the distance from one reading of a Base, m."""
    return float(
        distance_sd_m(angle_of_base_rad(plan, base), plan.bars[base.bar], base.angle_sd_rad)
    )


def readings_of_bases(plan, point_names):
    """Return the `Readings`, without values, of bases between the points `there`; () if no base.

    Repeated readings of a base are one value with the standard deviation of their mean.
    """
    bases = [base for base in plan.bases if {base.setup, base.to} <= point_names]
    if not bases:
        return ()
    n = len(bases)
    return (
        Readings(
            table="distances",
            value=np.zeros(n),
            sd=np.array([base_sd_m(plan, base) / np.sqrt(base.readings) for base in bases]),
            start=tuple(base.setup for base in bases),
            end=tuple(base.to for base in bases),
            check=np.zeros(n, dtype=bool),
            instrument=tuple(base.bar for base in bases),
            horizontal=np.ones(n, dtype=bool),
            temperature_c=np.full(n, np.nan),
            rows=tuple(base.row for base in bases),
            sheet=STADIA_FILE,
        ),
    )


def group_by_ends(bases):
    """Group `Base`s by their two ends, whichever end each is read from: {names of ends: bases}."""
    groups = {}
    for base in bases:
        ends = (base.setup, base.to)
        groups.setdefault(ends[::-1] if ends[::-1] in groups else ends, []).append(base)
    return groups


def new_bases(plan):
    """Return possible new pairs of `Base`s, read from both ends; () if the plan has no stadia.

    Each pair connects two set-ups that sight each other and have no base yet.
    """
    if not plan.bars:
        return ()
    template = plan.bases[0] if plan.bases else Base("", "", next(iter(plan.bars)), NEW_SD_RAD)
    connected = {frozenset((base.setup, base.to)) for base in plan.bases}
    pairs = {}
    for setup in plan.setups:
        for other in setup.sights:
            pairs.setdefault(frozenset((setup.name, other)), (setup.name, other))
    return tuple(
        tuple(replace(template, setup=a, to=b, row=None) for a, b in (ends, ends[::-1]))
        for key, ends in pairs.items()
        if key not in connected
    )
