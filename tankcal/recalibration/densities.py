"""Density of the head in a table: declared, or estimated from its rows."""

from dataclasses import dataclass, replace

import numpy as np

from tankcal.errors import SolutionError
from tankcal.recalibration.upright_geometry import read_upright

MOST_ROWS = 900  # largest number of rows from which a density is estimated


@dataclass(frozen=True)
class Density:
    """Density of the liquid whose head a table includes.

    Attributes
    ----------
    kg_m3 : float or None
        0: no head; None: unknown.
    source : {"declared", "read"} or None
    u_kg_m3 : float or None
        Standard uncertainty of an estimated density, by rounding only.
    read_kg_m3 : float or None
        Estimate from the rows, whether or not it is used.
    head : {"with", "without", "undecided"} or None
        Estimated from the rows.
    """

    kg_m3: float | None = None
    source: str | None = None
    u_kg_m3: float | None = None
    read_kg_m3: float | None = None
    head: str | None = None


def densities_of(former, new, facts):
    """Return the Density of both tables, estimated from the rows if not declared."""
    return _density_of(former, facts), _density_of(new, facts)


def _density_of(table, facts):
    if table.liquid_density_kg_m3 is not None:
        return Density(float(table.liquid_density_kg_m3), "declared")
    if not facts.has_plates:
        return Density()
    try:
        geometry = read_upright(
            _thinned(table), facts.heights_m, facts.thickness_m, modulus_pa=facts.modulus_pa
        )
    except SolutionError:
        return Density()
    read, head = geometry.density_kg_m3, geometry.head
    known = {"with": float(read.value), "without": 0.0, "undecided": None}[head]
    source = None if known is None else "read"
    return Density(known, source, float(read.u), float(read.value), head)


def _thinned(table):
    """Return a table of at most MOST_ROWS evenly chosen rows, including the last."""
    every = -(-len(table.height_m) // MOST_ROWS)
    if every == 1:
        return table
    chosen = np.arange(len(table.height_m))[::-1][::every][::-1]
    rounding = table.height_rounding_m
    return replace(
        table,
        height_m=table.height_m[chosen],
        volume_m3=table.volume_m3[chosen],
        U_m3=None,
        factor_m3=None,
        row=None,
        height_rounding_m=None if rounding is None else rounding[chosen],
    )
