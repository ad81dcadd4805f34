"""Facts about the tank of two tables, besides its volumes."""

from dataclasses import dataclass

import numpy as np

from tankcal.job.model.settings import Material


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
    material_is : {"record", "default"}
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
    material_is: str = "default"
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


def facts_of(former, new, courses=None):
    """Return the TankFacts of two FormerTables.

    Parameters
    ----------
    former, new : FormerTable
        The record of the new table takes precedence.
    courses : (heights, thicknesses) or None
        Declared courses, m, used if no record has them.
    """
    kind = new.kind or former.kind or ("vertical" if courses is not None else None)
    facts = {"kind": kind}
    if courses is not None:
        facts |= _shell(*courses)
    for table in (former, new):  # the new table last, so that it takes precedence
        if table.record is not None:
            facts |= _of_record(table.record, is_new=table is new)
    return TankFacts(**facts)


def _of_record(record, is_new):
    job = record["job"]
    material, table = job.get("material") or {}, job.get("table") or {}
    facts = {"dips_expand": bool(table.get("height_expansion"))}
    if material.get("e_pa") and material.get("expansion_per_k"):
        facts |= {
            "modulus_pa": float(material["e_pa"]),
            "expansion_per_k": float(material["expansion_per_k"]),
            "material_is": "record",
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
