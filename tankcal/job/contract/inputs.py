"""What uncertainty.csv may declare, and what tankcal assumes where it does not."""

from dataclasses import dataclass

from tankcal.job.contract.kinds import KINDS, VERTICAL, WITH_POINTS

AS_READ = ("standard", "half_width", "expanded", "scale", "sd")  # what u may be


@dataclass(frozen=True)
class Declarable:
    """One input that may be declared.

    unit     as it must be written
    per_si   how many of it make one of SI
    largest  standard uncertainty that makes sense, in that unit
    note     what it is
    kinds    the kinds of tank that it bears on
    default  half-width of the rectangular distribution that is assumed where it bears on a job and
             is not declared, in that unit; None: nothing is assumed
    default_share  the same as a part of the input's own value, in place of `default`
    correlates     whether it may be correlated with others: it is one error, not many
    """

    unit: str
    per_si: float
    largest: float
    note: str
    kinds: tuple[str, ...] = KINDS
    default: float | None = None
    default_share: float | None = None
    correlates: bool = True

    def assumed_half_width(self, value):
        """Half-width of the default in `unit`, None without one; value: of the input, or None."""
        return self.default if self.default_share is None else self.default_share * value

    @property
    def assumption(self):
        """The default as it is told: "± 2 K", "± 1 % of its value"; "" without one."""
        if self.default_share is not None:
            return f"± {100 * self.default_share:g} % of its value"
        number = f"{self.default or 0:g}".replace("e-0", "e-")
        return "" if self.default is None else f"± {number} {self.unit}"


def _of_shell(unit, per_si, largest, note, **more):
    return Declarable(unit, per_si, largest, note, VERTICAL, **more)


def _of_lying(unit, per_si, largest, note):
    return Declarable(unit, per_si, largest, note, ("horizontal",))


INPUTS = {
    "scale": Declarable("ppm", 1e6, 1e4, "scale of the survey"),
    "offset": Declarable(
        "mm",
        1e3,
        100,
        "offset of instrument or target square to the wall, the same for all points",
        WITH_POINTS,
    ),
    "datum": Declarable("mm", 1e3, 100, "height of the table's zero against the tank"),
    "course_heights": _of_shell(
        "mm", 1e3, 100, "height of each course, independent of the others", correlates=False
    ),
    "plate_thickness": Declarable(
        "mm", 1e3, 10, "plate thickness, the same error everywhere", WITH_POINTS, default=0.2
    ),
    "paint": _of_shell(
        "mm", 1e3, 5, "paint thickness, the same error in all courses", default=0.05
    ),
    "shell_temperature": Declarable("K", 1, 50, "shell temperature during the survey", default=2.0),
    "expansion": Declarable("1/K", 1, 1e-4, "coefficient of thermal expansion", default=1e-6),
    "youngs_modulus": _of_shell("GPa", 1e-9, 100, "Young's modulus of the shell", default=6.0),
    "liquid_density": _of_shell("kg/m3", 1, 500, "density of the liquid that the table is for"),
    "survey_level": _of_shell(
        "mm", 1e3, 1000, "level of the liquid on the survey day", default=5.0
    ),
    "survey_density": _of_shell("kg/m3", 1, 500, "density of that liquid", default=5.0),
    "bottom": _of_shell(
        "mm", 1e3, 500, "height of the bottom's surface, the same error everywhere"
    ),
    "barrel": _of_shell("mm", 1e3, 100, "how far a course bulges between its sections"),
    "roof_mass": _of_shell("kg", 1, 1e6, "mass of the floating roof", default_share=0.01),
    "deadwood": Declarable(
        "%",
        100,
        50,
        "volume of the deadwood without u_m3 of its own, the same relative error",
        default=5.0,
    ),
    "diameter": Declarable(
        "mm", 1e3, 200, "diameter of the cylinder or sphere", ("horizontal", "sphere")
    ),
    "length": _of_lying("mm", 1e3, 500, "length of the horizontal cylinder"),
    "end_depth": _of_lying("mm", 1e3, 500, "depth of both ends, the same error"),
    "tilt": Declarable(
        "mm/m",
        1e3,
        50,
        "tilt of the axis; of a vertical tank such as settlement since the survey",
        ("vertical", "horizontal"),
    ),
    "dip_position": _of_lying("mm", 1e3, 2000, "place of the dip point along the axis"),
    "surface": Declarable("mm", 1e3, 200, "offset of the mesh's surface from the wall", ("mesh",)),
    "interpolation": Declarable(
        "m3", 1, 100, "straight line between two rows, of each reading", correlates=False
    ),
    "rounding": Declarable(
        "m3", 1, 10, "last digit of a printed volume, of each reading", correlates=False
    ),
}
UNITS = tuple(dict.fromkeys(one.unit for one in INPUTS.values()))
