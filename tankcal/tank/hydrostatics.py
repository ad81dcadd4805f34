"""Liquid head: deformation of the shell by the liquid, with thin hoops.

A liquid of density rho up to the level h widens the unloaded radius r0 of a course of plate
thickness t by

    dr(z) = K rho (h - z),  z < h,      K = g r0^2 / (E t).

During the survey, the shell was loaded by the liquid of that day. That load is removed and the load
of the table is applied. With the liquid of the table up to h, the surveyed radius at the height z
thus changes by

    d(z; h) = K [rho_t (h - z)+ - rho_s (h_s - z)+]

and the volume below h changes by the integral of girth(z) d + pi d^2 over z < h. This is the exact
difference of 1/2 integral (r + d)^2 da and 1/2 integral r^2 da for an irregular outline r(a). The
integral is exact: girths are of degree six in z, d is linear below and above h_s.

K is constant in a course; r0 is its mean unloaded inside radius over azimuth and height. Sources:
ISO 7507-1 and API MPMS 2.2A (liquid head); thin hoop: Timoshenko, Strength of Materials.
"""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from tankcal.errors import HeightError, SolutionError
from tankcal.geometry.field.estimate import LEVELS
from tankcal.messages import message
from tankcal.quadrature import height_polynomials
from tankcal.tank.parts import Part, as_levels
from tankcal.tank.volumes import CourseShape, ShellVolume, gauss_levels
from tankcal.units import STANDARD_GRAVITY

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
    """Course as a stack of thin hoops.

    course         shape of the course
    girth_m        (q,) coefficients of the inside girth by powers of the relative height
    radius_m       mean unloaded inside radius r0
    compliance     K, widening per mass of liquid above a square metre, m per kg/m2
    compliance_by  {input: derivative of K, m per kg/m2 per SI unit of the input}
    """

    course: CourseShape
    girth_m: np.ndarray
    radius_m: float
    compliance: float
    compliance_by: dict


@dataclass(frozen=True)
class LiquidHead(Part):
    """Part of a tank: volume added by the liquid head to the shell as surveyed.

    volume   shell as surveyed
    hoops    courses, from the bottom up
    density_kg_m3  density of the liquid of the table; 0: the empty shell
    headroom_m  possible height of the liquid above the shell, in a head on top
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
        """Levels of the bottoms of the courses."""
        return tuple(hoop.course.bottom_m for hoop in self.hoops)

    def with_density(self, density_kg_m3):
        """Return the liquid head for a table of another density of the liquid."""
        return replace(self, density_kg_m3=float(density_kg_m3))

    def volume_m3(self, levels_m):
        """Return the change (rows,) of the volume below each level; 0 below the bottom.

        Raises HeightError for a level above the shell and the head on top of it.
        """
        return self._sums(levels_m)[0]

    def area_m2(self, levels_m):
        """Return the derivative (rows,) of `volume_m3`; at a joint that of the upper course.

        It contains the wider free surface, and the widening of the wall below a rising level.
        """
        return self._sums(levels_m)[1]

    def derivatives(self, levels_m):
        """Return {input: derivative (rows,) of `volume_m3`} for INPUTS, m3 per SI unit.

        plate_thickness acts through the stiffness of all plates; its effect on the inside radius is
        part of the shell. scale multiplies the inside radii.
        """
        return dict(zip(INPUTS, self._sums(levels_m)[1:], strict=True))

    def widening_m(self, heights_m, level_m):
        """Return the change (len(heights),) of the surveyed radius with liquid up to level_m.

        At a joint, the change is that of the upper course.
        """
        heights = np.atleast_1d(np.asarray(heights_m, dtype=float))
        joints = [hoop.course.bottom_m for hoop in self.hoops[1:]]
        compliance = np.array([hoop.compliance for hoop in self.hoops])
        table_load = self.density_kg_m3 * np.maximum(level_m - heights, 0)
        survey_load = self.survey_density_kg_m3 * np.maximum(self.survey_level_m - heights, 0)
        return compliance[np.searchsorted(joints, heights, side="right")] * (
            table_load - survey_load
        )

    def _sums(self, levels_m):
        """Return the volume and its derivatives, shape (1 + inputs, rows)."""
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
        courses = zip(self.hoops, self._lower_courses, strict=True)
        for index, (hoop, lower_courses) in enumerate(courses):
            rows = np.flatnonzero(place == index)
            course_levels = levels[rows]
            values = _integrate_load(
                self,
                hoop,
                course_levels,
                np.minimum(course_levels, shell) if self.headroom_m else course_levels,
            )
            values[1] += _girth_at_surface(self, hoop, course_levels) * (
                (course_levels < shell) | (self.headroom_m == 0)
            )
            # Courses below contribute a quadratic polynomial of the level.
            values += (
                lower_courses[:, :1]
                + (lower_courses[:, 1:2] + lower_courses[:, 2:] * course_levels) * course_levels
            )
            sums[:, rows] = values
        return sums

    @cached_property
    def _lower_courses(self):
        """Coefficients (1 + inputs, 3) of the contribution of the courses below each course.

        The contribution is quadratic in the level, so three levels determine it.
        """
        levels = self.volume.height_m * np.arange(3.0)
        # Coefficients of the parabola through three levels.
        to_powers = np.linalg.inv(np.vander(levels, increasing=True).T)
        full = [
            _integrate_load(self, h, levels, np.full(3, h.course.top_m)) @ to_powers
            for h in self.hoops
        ]
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
    """Return the volume added to a shell by the liquid head, with each course as thin hoops.

        dr(z) = K rho (h - z),  z < h,      K = g r0^2 / (E t)

    Parameters
    ----------
    volume : ShellVolume
        Shell as surveyed, inside.
    thicknesses_m : array_like, shape (courses,)
        Plate thickness of each course from the bottom up, m.
    youngs_modulus_pa : float
    density_kg_m3 : float
        Density of the liquid of the table, kg/m3; 0: the empty shell.
    survey_density_kg_m3, survey_level_m : float, default 0
        Density of the liquid during the survey, and its level above the bottom of the first course,
        m.
    gravity_m_s2 : float
    scale : float, default 1
        Temperature factor on horizontal lengths, as for `course_shape`.
    headroom_m : float, default 0
        Possible height of the liquid above the shell, in a head on top of it.

    Returns
    -------
    LiquidHead

    Raises
    ------
    SolutionError
        For an impossible modulus, density, level or gravity, or a loaded course without plate
        thickness.

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
        _build_hoop(course, plate, youngs_modulus_pa, gravity_m_s2, scale, *survey)
        for course, plate in zip(volume.courses, thicknesses, strict=True)
    ]
    return LiquidHead(volume, tuple(hoops), float(density_kg_m3), *survey, headroom_m)


def _refuse_numbers(modulus, gravity, *others):
    """Raise SolutionError for an impossible modulus, gravity, density or level."""
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


def _build_hoop(course, plate, modulus, gravity, scale, density, level):
    """Return the hoop of a course from its surveyed radius.

    The surveyed radius is r0 + B r0^2, with B due to the liquid during the survey.
    """
    girths = height_polynomials(gauss_levels(), LEVELS - 1) @ course.girths_m / scale
    height = course.height_m
    girth = _integrals(course, girths, np.array([course.top_m]))[0]
    surveyed = girth[0] / (2 * np.pi * height)
    wet = np.clip(level - course.bottom_m, 0, height)
    depth = wet * (level - course.bottom_m - wet / 2) / height  # mean of (h_s - z)+
    soft = gravity / (modulus * plate) if plate > 0 else 0.0  # no plate: the course is unloaded
    expansion = soft * density * depth
    # Positive root of B r0^2 + r0 - r = 0, in the form without cancellation for small B.
    radius = 2 * surveyed / (1 + np.sqrt(1 + 4 * expansion * surveyed))
    # Implicit derivative: dr0 (1 + 2 B r0) = dr - r0^2 dB, for K = soft r0^2.
    stiffening = 1 + 2 * expansion * radius
    by_soft = radius**2 / stiffening
    by_expansion = -2 * soft * radius**3 / stiffening
    derivatives = {
        "youngs_modulus": -by_soft * soft / modulus,
        "plate_thickness": -by_soft * soft / plate if plate > 0 else 0.0,
        "survey_density": by_expansion * soft * depth,
        "survey_level": by_expansion * soft * density * wet / height,
        "scale": 2 * soft * radius * surveyed / stiffening,
    }
    return Hoop(course, girths, float(radius), float(soft * radius**2), derivatives)


def _integrate_load(head, hoop, levels, ends):
    """Return the contribution (1 + inputs, rows) of a course below `ends`, for liquid up to levels.

    With d = K u, u = rho_t (h - z) - rho_s (h_s - z)+, these are the integral of girth d + pi d^2
    and its derivatives, at a fixed end of the integral.
    """
    compliance_k = hoop.compliance
    density, survey, survey_level = (
        head.density_kg_m3,
        head.survey_density_kg_m3,
        head.survey_level_m,
    )
    # Integrals of girth, girth z, 1, z and z^2: all terms of u and u^2 are combinations of these.
    girth, lever, length, first, second = _integrals(hoop.course, hoop.girth_m, ends)
    survey_integrals = np.zeros((5, len(ends)))  # integrals up to the lower of end and h_s
    if survey_level > hoop.course.bottom_m:
        survey_integrals = _integrals(hoop.course, hoop.girth_m, np.minimum(ends, survey_level))
    depth = [
        survey_level * survey_integrals[i] - survey_integrals[j]
        for i, j in ((0, 1), (2, 3), (3, 4))
    ]  # of (h_s - z)+
    mass = density * levels
    hoops = mass * girth - density * lever - survey * depth[0]  # integral of girth u
    moments = [  # integrals of u times 1, z and (h_s - z)+
        mass * length - density * first - survey * depth[1],
        mass * first - density * second - survey * depth[2],
        mass * depth[1] - density * depth[2] - survey * (survey_level * depth[1] - depth[2]),
    ]
    square = mass * moments[0] - density * moments[1] - survey * moments[2]
    survey_moment = mass * survey_integrals[2] - density * survey_integrals[3] - survey * depth[1]
    by_one, by_height, by_depth = (  # derivatives by the coefficients of 1, z, (h_s - z)+ in u
        compliance_k * (linear + 2 * np.pi * compliance_k * moment)
        for linear, moment in zip((girth, lever, depth[0]), moments, strict=True)
    )
    by_level = compliance_k * (survey_integrals[0] + 2 * np.pi * compliance_k * survey_moment)
    by_compliance = hoops + 2 * np.pi * compliance_k * square
    derivatives_by = {
        name: derivative * by_compliance for name, derivative in hoop.compliance_by.items()
    }
    derivatives_by["liquid_density"] = levels * by_one - by_height
    derivatives_by["survey_density"] = derivatives_by["survey_density"] - by_depth
    derivatives_by["survey_level"] = derivatives_by["survey_level"] - survey * by_level
    derivatives_by["scale"] = derivatives_by["scale"] + compliance_k * hoops
    derivatives_by["datum"] = density * by_one
    volume = compliance_k * (hoops + np.pi * compliance_k * square)
    return np.array([volume, *(derivatives_by[name] for name in INPUTS)])


def _girth_at_surface(head, hoop, levels):
    """Return girth d + pi d^2 (rows,) at each level, where only the unloading acts."""
    survey_depth = np.maximum(head.survey_level_m - levels, 0)
    widening = -hoop.compliance * head.survey_density_kg_m3 * survey_depth
    return (_girth_m(hoop.course, hoop.girth_m, levels) + np.pi * widening) * widening


def _integrals(course, girth_m, ends):
    """Return integrals (5, rows) of girth, girth z, 1, z, z^2 from the bottom of a course to ends.

    An end below the bottom of the course counts as the bottom.
    """
    # Gauss-Legendre rule with four nodes on the interval from the bottom to each end.
    half = np.maximum(ends - course.bottom_m, 0.0) / 2
    z = course.bottom_m + half * (1 + NODES[:, None])
    girth = _girth_m(course, girth_m, z)
    terms = [girth, girth * z, np.ones_like(z), z, z**2]
    return np.array([(WEIGHTS @ term) * half for term in terms])


def _girth_m(course, girth_m, z):
    """Return the inside girth of a course at heights z."""
    t = (z - course.bottom_m) / course.height_m
    girth = girth_m[-1]
    # Horner's scheme.
    for coefficient in girth_m[-2::-1]:
        girth = girth * t + coefficient
    return girth + 0.0 * t
