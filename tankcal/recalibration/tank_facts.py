"""Facts about the tank of two tables besides its volumes: courses, material, head."""

from dataclasses import dataclass, replace

import numpy as np

from tankcal.errors import SolutionError
from tankcal.job.model.settings import Material
from tankcal.recalibration.upright_geometry import read_upright

MOST_ROWS = 900  # largest number of rows from which a density is estimated


@dataclass(frozen=True)
class TankFacts:
    """The tank of two tables.

    Attributes
    ----------
    kind : {"vertical", "horizontal", "sphere", "mesh"} or None
    heights_m, thickness_m : (courses,) ndarray or None
        Courses from the bottom up; None: unknown. A thickness of 0 means an unknown plate: its
        expansion by the head is not computed.
    bottom_m : float
        Dip of the bottom of the first course in the new table.
    modulus_pa, expansion_per_k : float
    material_source : {"record", "default"}
        Source of the two material constants.
    dips_expand : bool
        Whether dips also expand with the shell.
    inside_m : (courses,) ndarray or None
        Radii of the courses in the record of the new table.
    """

    kind: str | None = None
    heights_m: np.ndarray | None = None
    thickness_m: np.ndarray | None = None
    bottom_m: float = 0.0
    modulus_pa: float = Material.e_pa
    expansion_per_k: float = Material.expansion_per_k
    material_source: str = "default"
    dips_expand: bool = False
    inside_m: np.ndarray | None = None

    @property
    def is_shell(self):
        """Whether the tank is upright and its courses are known."""
        return self.kind == "vertical" and self.heights_m is not None

    @property
    def has_plates(self):
        """Whether all plate thicknesses are known, as the head requires."""
        return self.is_shell and bool(np.isfinite(self.thickness_m).all())

    def edges_m(self, zero_m=0.0):
        """Dips (courses + 1,) of the edges; `zero_m` is added to those of the new table."""
        return self.bottom_m + zero_m + np.concatenate([[0.0], np.cumsum(self.heights_m)])


def collect_facts(former, new, courses=None):
    """Return the TankFacts of two FormerTables.

    Parameters
    ----------
    former, new : FormerTable
        The record of the new table takes precedence.
    courses : (heights, thicknesses) or None
        FormerFacts courses, m, used if no record has them.
    """
    kind = new.kind or former.kind or ("vertical" if courses is not None else None)
    facts = {"kind": kind}
    if courses is not None:
        facts |= _shell(*courses)
    for table in (former, new):  # the new table last, so that it takes precedence
        if table.record is not None:
            facts |= _record_facts(table.record, is_new=table is new)
    return TankFacts(**facts)


def _record_facts(record, is_new):
    job = record["job"]
    material, table = job.get("material") or {}, job.get("table") or {}
    facts = {"dips_expand": bool(table.get("height_expansion"))}
    if material.get("e_pa") and material.get("expansion_per_k"):
        facts |= {
            "modulus_pa": float(material["e_pa"]),
            "expansion_per_k": float(material["expansion_per_k"]),
            "material_source": "record",
        }
    courses = job.get("courses") or []
    if courses:
        facts |= _shell(
            *([course[key] for course in courses] for key in ("height_m", "thickness_m"))
        )
        if is_new:
            facts["bottom_m"] = -float(record["capacity"]["zero_m"])
            surveyed = record.get("courses") or []
            if len(surveyed) == len(courses):
                facts["inside_m"] = np.array([key["inside_radius_m"] for key in surveyed], float)
    return facts


def _shell(heights_m, thickness_m):
    thickness = np.asarray(thickness_m, dtype=float)
    return {
        "heights_m": np.asarray(heights_m, dtype=float),
        "thickness_m": np.where(thickness > 0, thickness, np.inf),
    }


# ---- density of the head


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


def find_densities(former, new, facts):
    """Return the Density of both tables, estimated from the rows if not declared."""
    return _find_density(former, facts), _find_density(new, facts)


def _find_density(table, facts):
    if table.liquid_density_kg_m3 is not None:
        return Density(float(table.liquid_density_kg_m3), "declared")
    if not facts.has_plates:
        return Density()
    try:
        geometry = read_upright(
            _thin_table(table), facts.heights_m, facts.thickness_m, modulus_pa=facts.modulus_pa
        )
    except SolutionError:
        return Density()
    read, head = geometry.density_kg_m3, geometry.head
    known = {"with": float(read.value), "without": 0.0, "undecided": None}[head]
    source = None if known is None else "read"
    return Density(known, source, float(read.u), float(read.value), head)


def _thin_table(table):
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
