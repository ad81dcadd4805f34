"""Liquid head: how the shell gives way to the liquid in it, by thin hoops.

A liquid of density rho up to the level h widens the unloaded radius r0 of a course of plate t by

    dr(z) = K rho (h - z),  z < h,      K = g r0^2 / (E t).

The survey saw the shell with the liquid of its day. That load is taken off and the table's is put
on, so with the table's liquid up to h the surveyed radius at the height z changes by

    d(z; h) = K [rho_t (h - z)+ - rho_s (h_s - z)+]

and the volume below h by the integral of girth(z) d + pi d^2 over z < h: the whole of
1/2 integral (r + d)^2 da less 1/2 integral r^2 da of an irregular outline r(a). The integral is
exact: girths are of degree six in z, d is linear below and above h_s.

K belongs to a course; r0 is its mean inside radius over azimuth and height, unloaded.
Sources: ISO 7507-1 and API MPMS 2.2A (liquid head); thin hoop: Timoshenko, Strength of Materials.
"""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from tankcal.errors import HeightError, SolutionError
from tankcal.geometry.field.estimate import LEVELS
from tankcal.messages import message
from tankcal.quadrature import height_polynomials
from tankcal.tank.courses import CourseShape, gauss_levels
from tankcal.tank.parts import Part, as_levels
from tankcal.tank.volumes import ShellVolume

STANDARD_GRAVITY = 9.80665  # m/s2
NODES, WEIGHTS = np.polynomial.legendre.leggauss(4)  # exact to degree seven
INPUTS = (
    "datum",
    "youngs_modulus",
    "plate_thickness",
    "liquid_density",
    "survey_density",
    "survey_level",
    "scale",
)


@dataclass(frozen=True)
class Hoop:
    """One course as a stack of thin hoops.

    girth_m        (q,) coefficients of the inside girth by powers of the part of the height
    radius_m       mean inside radius r0, unloaded
    compliance     K, widening by the mass of liquid above a square metre, m per kg/m2
    compliance_by  its derivatives: {input: m per kg/m2 per SI unit of the input}
    """

    course: CourseShape
    girth_m: np.ndarray
    radius_m: float
    compliance: float
    compliance_by: dict


@dataclass(frozen=True)
class LiquidHead(Part):
    """The part of a tank that the head of the liquid adds to the shell as it was surveyed.

    volume   the shell as surveyed
    hoops    its courses, from the bottom up
    density_kg_m3  of the liquid that the table is for; 0: the empty shell
    headroom_m  how far above the shell, in a head on top, its liquid may stand
    survey_density_kg_m3, survey_level_m  liquid during the survey; level above the bottom of the
             first course
    """

    volume: ShellVolume
    hoops: tuple[Hoop, ...]
    density_kg_m3: float
    survey_density_kg_m3: float
    survey_level_m: float
    headroom_m: float = 0.0

    @property
    def breakpoints_m(self):
        """Bottoms of the courses."""
        return tuple(hoop.course.bottom_m for hoop in self.hoops)

    def with_density(self, density_kg_m3):
        """The same shell and survey, for a table of another density of the liquid."""
        return replace(self, density_kg_m3=float(density_kg_m3))

    def volume_m3(self, levels_m):
        """(rows,) change of the volume below each level; 0 below the bottom.

        Raises HeightError for a level above the shell and the head on it.
        """
        return self._sums(levels_m)[0]

    def area_m2(self, levels_m):
        """(rows,) derivative of `volume_m3` by the level; the upper course at a joint.

        Not only the wider free surface: a rising level also widens the wall below it.
        """
        return self._sums(levels_m)[1]

    def derivatives(self, levels_m):
        """{input: (rows,)} derivative of `volume_m3` by each of INPUTS, m3 per SI unit.

        plate_thickness is that through the stiffness of all plates; what a thicker plate takes off
        the radius is the shell's. scale multiplies the inside radii.
        """
        return dict(zip(INPUTS, self._sums(levels_m)[1:], strict=True))

    def widening_m(self, heights_m, level_m):
        """(len(heights),) change of the surveyed radius with the table's liquid up to level_m.

        At a joint that of the upper course.
        """
        heights = np.atleast_1d(np.asarray(heights_m, dtype=float))
        joints = [hoop.course.bottom_m for hoop in self.hoops[1:]]
        compliance = np.array([hoop.compliance for hoop in self.hoops])
        put_on = self.density_kg_m3 * np.maximum(level_m - heights, 0)
        taken_off = self.survey_density_kg_m3 * np.maximum(self.survey_level_m - heights, 0)
        return compliance[np.searchsorted(joints, heights, side="right")] * (put_on - taken_off)

    def _sums(self, levels_m):
        """(1 + inputs, rows) volume and its derivatives."""
        levels = as_levels(levels_m)
        shell = self.volume.height_m
        top = shell + self.headroom_m
        inside = levels <= top * (1 + 1e-12)
        if not np.all(inside):
            raise HeightError(
                message(
                    "liquid_level_above_shell",
                    "level {level_m:g} m is above the shell ({top_m:g} m)",
                    level_m=levels[~inside][0],
                    top_m=top,
                )
            )
        place = np.searchsorted([hoop.course.bottom_m for hoop in self.hoops], levels, "right") - 1
        sums = np.zeros((1 + len(INPUTS), len(levels)))
        for index, (hoop, below) in enumerate(zip(self.hoops, self._below, strict=True)):
            rows = np.flatnonzero(place == index)
            own = levels[rows]
            found = _load(self, hoop, own, np.minimum(own, shell) if self.headroom_m else own)
            found[1] += _at_surface(self, hoop, own) * ((own < shell) | (self.headroom_m == 0))
            found += below[:, :1] + (below[:, 1:2] + below[:, 2:] * own) * own
            sums[:, rows] = found
        return sums

    @cached_property
    def _below(self):
        """[(1 + inputs, 3)] powers of the level in what the courses below each course add.

        It is quadratic in the level: three levels give it.
        """
        three = self.volume.height_m * np.arange(3.0)
        to_powers = np.linalg.inv(np.vander(three, increasing=True).T)
        full = [_load(self, h, three, np.full(3, h.course.top_m)) @ to_powers for h in self.hoops]
        return [sum(full[:index], np.zeros((1 + len(INPUTS), 3))) for index in range(len(full))]


def liquid_head(
    volume,
    thicknesses_m,
    youngs_modulus_pa,
    density_kg_m3,
    *,
    survey_density_kg_m3=0.0,
    survey_level_m=0.0,
    gravity_m_s2=STANDARD_GRAVITY,
    scale=1.0,
    headroom_m=0.0,
):
    """What the head of the liquid adds to a shell, course by course as thin hoops.

        dr(z) = K rho (h - z),  z < h,      K = g r0^2 / (E t)

    Parameters
    ----------
    volume : ShellVolume
        The shell as surveyed, inside.
    thicknesses_m : array_like, shape (courses,)
        Plate of each course from the bottom up, m.
    youngs_modulus_pa : float
    density_kg_m3 : float
        Of the liquid that the table is for, kg/m3; 0: the empty shell.
    survey_density_kg_m3, survey_level_m : float, default 0
        Liquid in the tank during the survey; its level above the bottom of the first course, m.
    gravity_m_s2 : float
    scale : float, default 1
        Of horizontal lengths, as `course_shape` was given it.
    headroom_m : float, default 0
        How far above the shell the table's liquid may stand, in a head on top of it.

    Returns
    -------
    LiquidHead

    Raises
    ------
    SolutionError
        For a modulus, density, level or gravity that cannot be, or a course that carries liquid
        and has no plate.

    References
    ----------
    ISO 7507-1 and API MPMS 2.2A (liquid head); thin hoop: Timoshenko, Strength of Materials.
    """
    thicknesses = np.asarray(thicknesses_m, dtype=float)
    if thicknesses.shape != (len(volume.courses),):
        raise SolutionError(
            message(
                "thicknesses_for_courses",
                "{count} plate thicknesses for {courses} courses",
                count=thicknesses.size,
                courses=len(volume.courses),
            )
        )
    _refuse_numbers(
        youngs_modulus_pa, gravity_m_s2, density_kg_m3, survey_density_kg_m3, survey_level_m
    )
    if survey_level_m > volume.height_m:
        raise SolutionError(
            message(
                "survey_liquid_above_shell",
                "liquid up to {level_m:g} m during the survey; the shell ends at {top_m:g} m",
                level_m=survey_level_m,
                top_m=volume.height_m,
            )
        )
    surveyed = survey_level_m if survey_density_kg_m3 > 0 else 0.0
    for number, (course, plate) in enumerate(zip(volume.courses, thicknesses, strict=True), 1):
        if (density_kg_m3 > 0 or course.bottom_m < surveyed) and not plate > 0:
            raise SolutionError(
                message(
                    "course_without_plate",
                    "course {number} from the bottom has a plate of {plate_m:g} m; for the "
                    "liquid head it needs its thickness",
                    number=number,
                    plate_m=plate,
                )
            )
    survey = (float(survey_density_kg_m3), float(survey_level_m))
    hoops = [
        _hoop(course, plate, youngs_modulus_pa, gravity_m_s2, scale, *survey)
        for course, plate in zip(volume.courses, thicknesses, strict=True)
    ]
    return LiquidHead(volume, tuple(hoops), float(density_kg_m3), *survey, headroom_m)


def _refuse_numbers(modulus, gravity, *others):
    for value in (modulus, gravity):
        if not (np.isfinite(value) and value > 0):
            raise SolutionError(
                message(
                    "modulus_or_gravity",
                    "Young's modulus or gravity {value:g}; expected a value above 0",
                    value=value,
                )
            )
    for value in others:
        if not (np.isfinite(value) and value >= 0):
            raise SolutionError(
                message(
                    "density_or_level",
                    "density or level of a liquid {value:g}; expected 0 or more",
                    value=value,
                )
            )


def _hoop(course, plate, modulus, gravity, scale, density, level):
    """The hoop of a course; r0 + B r0^2 is the surveyed radius, B of the survey's liquid."""
    girths = height_polynomials(gauss_levels(), LEVELS - 1) @ course.girths_m / scale
    height = course.height_m
    girth = _integrals(course, girths, np.array([course.top_m]))[0]
    surveyed = girth[0] / (2 * np.pi * height)
    wet = np.clip(level - course.bottom_m, 0, height)
    depth = wet * (level - course.bottom_m - wet / 2) / height  # mean of (h_s - z)+
    soft = gravity / (modulus * plate) if plate > 0 else 0.0  # refused where it is loaded
    bulge = soft * density * depth
    radius = 2 * surveyed / (1 + np.sqrt(1 + 4 * bulge * surveyed))
    stiffening = 1 + 2 * bulge * radius
    by_soft = radius**2 / stiffening
    by_bulge = -2 * soft * radius**3 / stiffening
    by = {
        "youngs_modulus": -by_soft * soft / modulus,
        "plate_thickness": -by_soft * soft / plate if plate > 0 else 0.0,
        "survey_density": by_bulge * soft * depth,
        "survey_level": by_bulge * soft * density * wet / height,
        "scale": 2 * soft * radius * surveyed / stiffening,
    }
    return Hoop(course, girths, float(radius), float(soft * radius**2), by)


def _load(head, hoop, levels, ends):
    """(1 + inputs, rows) what a course adds below `ends`, with liquid up to the levels.

    With d = K u, u = rho_t (h - z) - rho_s (h_s - z)+, the integral of girth d + pi d^2 and its
    derivatives, at a fixed end of the integral.
    """
    stiff = hoop.compliance
    density, survey, seen = head.density_kg_m3, head.survey_density_kg_m3, head.survey_level_m
    girth, lever, length, first, second = _integrals(hoop.course, hoop.girth_m, ends)
    below = np.zeros((5, len(ends)))  # to level and h_s
    if seen > hoop.course.bottom_m:
        below = _integrals(hoop.course, hoop.girth_m, np.minimum(ends, seen))
    depth = [seen * below[i] - below[j] for i, j in ((0, 1), (2, 3), (3, 4))]  # of (h_s - z)+
    mass = density * levels
    hoops = mass * girth - density * lever - survey * depth[0]  # integral of girth u
    moments = [  # integrals of u times 1, z and (h_s - z)+
        mass * length - density * first - survey * depth[1],
        mass * first - density * second - survey * depth[2],
        mass * depth[1] - density * depth[2] - survey * (seen * depth[1] - depth[2]),
    ]
    square = mass * moments[0] - density * moments[1] - survey * moments[2]
    both = mass * below[2] - density * below[3] - survey * depth[1]
    by_one, by_height, by_depth = (  # derivatives by the coefficients of 1, z, (h_s - z)+ in u
        stiff * (linear + 2 * np.pi * stiff * moment)
        for linear, moment in zip((girth, lever, depth[0]), moments, strict=True)
    )
    by_level = stiff * (below[0] + 2 * np.pi * stiff * both)
    by_compliance = hoops + 2 * np.pi * stiff * square
    through = {name: by * by_compliance for name, by in hoop.compliance_by.items()}
    through["liquid_density"] = levels * by_one - by_height
    through["survey_density"] = through["survey_density"] - by_depth
    through["survey_level"] = through["survey_level"] - survey * by_level
    through["scale"] = through["scale"] + stiff * hoops
    through["datum"] = density * by_one
    volume = stiff * (hoops + np.pi * stiff * square)
    return np.array([volume, *(through[name] for name in INPUTS)])


def _at_surface(head, hoop, levels):
    """(rows,) girth d + pi d^2 at each level itself, the unloading alone."""
    above = np.maximum(head.survey_level_m - levels, 0)
    widening = -hoop.compliance * head.survey_density_kg_m3 * above
    return (_girth_m(hoop.course, hoop.girth_m, levels) + np.pi * widening) * widening


def _integrals(course, girth_m, ends):
    """(5, rows) integrals of girth, girth z, 1, z, z^2 from the course's bottom to each end.

    An end below the bottom counts as the bottom.
    """
    half = np.maximum(ends - course.bottom_m, 0.0) / 2
    z = course.bottom_m + half * (1 + NODES[:, None])
    girth = _girth_m(course, girth_m, z)
    terms = [girth, girth * z, np.ones_like(z), z, z**2]
    return np.array([(WEIGHTS @ term) * half for term in terms])


def _girth_m(course, girth_m, z):
    t = (z - course.bottom_m) / course.height_m
    girth = girth_m[-1]
    for coefficient in girth_m[-2::-1]:
        girth = girth * t + coefficient
    return girth + 0.0 * t
