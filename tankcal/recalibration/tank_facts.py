"""What is known of the tank that both tables are of, besides its volumes."""

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
        Of its courses from the bottom up; None: not known. A plate of 0 is infinite here: its
        head is not known.
    bottom_m : float
        Dip of the bottom of the first course in the new table.
    modulus_pa, expansion_per_k : float
    material_is : {"record", "default"}
        Where the last two are from.
    dips_expand : bool
        Whether dips grow with the shell, too.
    inside_m : (courses,) ndarray or None
        Radii of the courses by the record of the new table.
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
        """Whether it stands upright, and its courses are known."""
        return self.kind == "vertical" and self.heights_m is not None

    @property
    def has_plates(self):
        """Whether the plates of all courses are known, which a head needs."""
        return self.is_shell and bool(np.isfinite(self.thickness_m).all())

    def edges_m(self, zero_m=0.0):
        """(courses + 1,) dips of the edges, `zero_m` being added to those of the new table."""
        return self.bottom_m + zero_m + np.concatenate([[0.0], np.cumsum(self.heights_m)])


def facts_of(former, new, courses=None):
    """TankFacts of two FormerTables.

    Parameters
    ----------
    former, new : FormerTable
        What the record of the new one says counts first.
    courses : (heights, thicknesses) or None
        As declared, m: used where no record has them.
    """
    kind = new.kind or former.kind or ("vertical" if courses is not None else None)
    given = {"kind": kind}
    if courses is not None:
        given |= _shell(*courses)
    for table in (former, new):  # the new one last: it counts
        if table.record is not None:
            given |= _of_record(table.record, is_new=table is new)
    return TankFacts(**given)


def _of_record(record, is_new):
    job = record["job"]
    material, table = job.get("material") or {}, job.get("table") or {}
    found = {"dips_expand": bool(table.get("height_expansion"))}
    if material.get("e_pa") and material.get("expansion_per_k"):
        found |= {
            "modulus_pa": float(material["e_pa"]),
            "expansion_per_k": float(material["expansion_per_k"]),
            "material_is": "record",
        }
    courses = job.get("courses") or []
    if courses:
        found |= _shell(*([one[key] for one in courses] for key in ("height_m", "thickness_m")))
        if is_new:
            found["bottom_m"] = -float(record["capacity"]["zero_m"])
            surveyed = record.get("courses") or []
            if len(surveyed) == len(courses):
                found["inside_m"] = np.array([one["inside_radius_m"] for one in surveyed], float)
    return found


def _shell(heights_m, thickness_m):
    thickness = np.asarray(thickness_m, dtype=float)
    return {
        "heights_m": np.asarray(heights_m, dtype=float),
        "thickness_m": np.where(thickness > 0, thickness, np.inf),
    }
