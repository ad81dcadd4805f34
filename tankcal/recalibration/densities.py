"""The density of the head in a table: declared, or read out of its rows."""

from dataclasses import dataclass, replace

import numpy as np

from tankcal.errors import SolutionError
from tankcal.recalibration.upright_geometry import read_upright

MOST_ROWS = 900  # that a density is read from


@dataclass(frozen=True)
class Density:
    """Density of the liquid that a table has the head of.

    Attributes
    ----------
    kg_m3 : float or None
        0: without head; None: not known.
    source : {"declared", "read"} or None
    u_kg_m3 : float or None
        Of one that was read: standard, by rounding alone.
    read_kg_m3 : float or None
        What the rows say, whether or not they decide.
    head : {"with", "without", "undecided"} or None
        What was read of it.
    """

    kg_m3: float | None = None
    source: str | None = None
    u_kg_m3: float | None = None
    read_kg_m3: float | None = None
    head: str | None = None


def densities_of(former, new, facts):
    """(Density, Density) of two tables; read out of rows only where one is not declared."""
    return _density_of(former, facts), _density_of(new, facts)


def _density_of(table, facts):
    if table.liquid_density_kg_m3 is not None:
        return Density(float(table.liquid_density_kg_m3), "declared")
    if not facts.has_plates:
        return Density()
    try:
        found = read_upright(
            _thinned(table), facts.heights_m, facts.thickness_m, modulus_pa=facts.modulus_pa
        )
    except SolutionError:
        return Density()
    read, head = found.density_kg_m3, found.head
    known = {"with": float(read.value), "without": 0.0, "undecided": None}[head]
    source = None if known is None else "read"
    return Density(known, source, float(read.u), float(read.value), head)


def _thinned(table):
    """A table of at most MOST_ROWS of its rows, evenly chosen, the last one among them."""
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
