"""Difference of the radius of each course between two tables on a common basis."""

import numpy as np

from tankcal.recalibration.basis import radii_of_rows
from tankcal.recalibration.difference import adjust_difference
from tankcal.recalibration.upright_shell import Rings
from tankcal.record.comparison import ComparedCourse


def compared_courses(facts, basis, former_U, new_U, c, sd_m3):
    """Return the `ComparedCourse` of each course within the rows; none if the courses are unknown.

    Parameters
    ----------
    facts : TankFacts
    basis : OneBasis
    former_U, new_U : TableUncertainty
    c : float
        Correlation of the errors of both tables.
    sd_m3 : float
        Standard deviation of a difference of rows, by rounding.
    """
    if not facts.is_shell:
        return []
    difference = basis.new_m3 - basis.on_basis_m3
    adjusted = adjust_difference(
        facts, basis.height_m, difference, basis.new_m3, sd_m3, basis.for_use
    )
    if adjusted is None:
        return []
    new, edges = _radii(facts, basis), facts.edges_m()
    changes = adjusted.areas_m2 / (2 * np.pi * new)
    rounding = adjusted.u_areas_m2 / (2 * np.pi * new)
    courses = []
    for k in np.flatnonzero(np.isfinite(changes)):
        parts = _u_of_tables(basis, (former_U, new_U), edges[k : k + 2], new[k])
        u = None if None in parts else float(np.hypot(_u_of_change(*parts, c), rounding[k]))
        courses.append(
            ComparedCourse(
                course=int(k) + 1,
                bottom_m=float(edges[k]),
                top_m=float(edges[k + 1]),
                former_m=float(new[k] - changes[k]),
                new_m=float(new[k]),
                d_m=float(changes[k]),
                u_m=u,
                u_rounding_m=float(rounding[k]),
                w=float(changes[k] / u) if u else None,
                u_former_m=parts[0],
                u_new_m=parts[1],
            )
        )
    return courses


def _radii(facts, basis):
    """Radii (courses,) in the new table: from its record, else from the rise of its rows."""
    if facts.inside_m is not None:
        return facts.inside_m
    rings = Rings(facts.edges_m(), facts.thickness_m, facts.modulus_pa, is_first_order=False)
    density = basis.densities[1].kg_m3 or 0.0
    zone, afloat = None, np.flatnonzero(~basis.for_use)
    if len(afloat):
        first, last = max(afloat[0] - 1, 0), min(afloat[-1] + 1, len(basis.height_m) - 1)
        zone = basis.height_m[first], basis.height_m[last]
    return radii_of_rows(rings, basis.height_m, basis.new_m3, density, zone)


def _u_of_tables(basis, tables, ends, radius):
    """Standard uncertainty of a radius from the volume of its course in each table.

    None if unknown.

    u(r) = r u(V) / (2 V), V between the lowest and the highest row within the course.
    """
    dips = basis.height_m
    inside = np.flatnonzero((dips >= ends[0] - 1e-9) & (dips <= ends[1] + 1e-9) & basis.for_use)
    if len(inside) < 2:
        return [None for _ in tables]
    low, high = inside[:1], inside[-1:]
    volume = basis.new_m3[high[0]] - basis.new_m3[low[0]]
    uncertainties = [
        radius / 2 * float(table.deliveries(low, high)[0]) / table.k / volume for table in tables
    ]
    return [None if np.isnan(u) else u for u in uncertainties]


def _u_of_change(former, new, c):
    """Standard uncertainty of the difference of two radii with correlation c."""
    return float(np.sqrt(max(former**2 + new**2 - 2 * c * former * new, 0.0)))
