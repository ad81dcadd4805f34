"""What uncertainty.csv may declare."""

from dataclasses import dataclass

from tankcal.job.contract.kinds import KINDS, VERTICAL, WITH_POINTS


@dataclass(frozen=True)
class Declarable:
    """One input that may be declared.

    unit     as it must be written
    per_si   how many of it make one of SI
    largest  standard uncertainty that makes sense, in that unit
    note     what it is
    kinds    the kinds of tank that it bears on
    """

    unit: str
    per_si: float
    largest: float
    note: str
    kinds: tuple[str, ...] = KINDS


def _of_shell(unit, per_si, largest, note):
    return Declarable(unit, per_si, largest, note, VERTICAL)


def _of_lying(unit, per_si, largest, note):
    return Declarable(unit, per_si, largest, note, ("horizontal",))


INPUTS = {
    "scale": Declarable("ppm", 1e6, 1e4, "scale of the survey"),
    "datum": Declarable("mm", 1e3, 100, "height of the table's zero against the tank"),
    "plate_thickness": Declarable(
        "mm", 1e3, 10, "plate thickness, the same error everywhere", WITH_POINTS
    ),
    "paint": _of_shell("mm", 1e3, 5, "paint thickness, the same error in all courses"),
    "shell_temperature": Declarable("K", 1, 50, "shell temperature during the survey"),
    "expansion": Declarable("1/K", 1, 1e-4, "coefficient of thermal expansion"),
    "youngs_modulus": _of_shell("GPa", 1e-9, 100, "Young's modulus of the shell"),
    "liquid_density": _of_shell("kg/m3", 1, 500, "density of the liquid that the table is for"),
    "survey_level": _of_shell("mm", 1e3, 1000, "level of the liquid on the survey day"),
    "survey_density": _of_shell("kg/m3", 1, 500, "density of that liquid"),
    "bottom": _of_shell(
        "mm", 1e3, 500, "height of the bottom's surface, the same error everywhere"
    ),
    "barrel": _of_shell("mm", 1e3, 100, "how far a course bulges between its sections"),
    "roof_mass": _of_shell("kg", 1, 1e6, "mass of the floating roof"),
    "diameter": Declarable(
        "mm", 1e3, 200, "diameter of the cylinder or sphere", ("horizontal", "sphere")
    ),
    "length": _of_lying("mm", 1e3, 500, "length of the horizontal cylinder"),
    "end_depth": _of_lying("mm", 1e3, 500, "depth of both ends, the same error"),
    "tilt": _of_lying("mm/m", 1e3, 50, "tilt of the horizontal cylinder"),
    "dip_position": _of_lying("mm", 1e3, 2000, "place of the dip point along the axis"),
    "surface": Declarable("mm", 1e3, 200, "offset of the mesh's surface from the wall", ("mesh",)),
}
UNITS = tuple(dict.fromkeys(one.unit for one in INPUTS.values()))
