"""What lies between the bottom of a vertical tank and the plane of the bottom of its first course.

Every part here gives the volume that stands on the bottom below a level, less the area times level
that the shell counts above that plane (level 0),

    V(L) = integral over the plan of (L - z)+ - L+,

so it is positive below the plane and negative where the bottom rises above it. A level L = z counts
as wet. Where the wall differs from the plan's outline between the plane and the bottom's edge is
left out: it is the product of two small heights.
"""

from dataclasses import dataclass

import numpy as np

from tankcal.errors import SolutionError
from tankcal.messages import message
from tankcal.tank.parts import Part, as_levels
from tankcal.tank.soundings import SurveyedSurface, surveyed_surface
from tankcal.tank.terrain import Surface, surface
from tankcal.uncertainty import Source

FORMS = ("flat", "cone", "dish")
LEAN_AZIMUTHS = 720  # of the triangles of a leaning plate


@dataclass(frozen=True)
class ShapedBottom(Part):
    """A level plate, a cone, or a dish that is part of a sphere; its edge lies at level 0.

    Over an outline that is no circle the form is that over a circle, drawn out to the outline along
    each radius, so areas and volumes depend on the plan's area alone.

    Attributes
    ----------
    form : str
        "flat", "cone" or "dish".
    centre_m : float
        Level of the centre: above 0 the bottom bulges up, below 0 down.
    plan_m2 : float
        Inside area of the first course at its bottom.
    """

    form: str
    centre_m: float
    plan_m2: float
    kind = "bottom"

    @property
    def lowest_m(self):
        """Level at which the tank is empty."""
        return min(self.centre_m, 0.0)

    @property
    def breakpoints_m(self):
        """Where the tank is empty."""
        return (self.lowest_m,)

    def volume_m3(self, levels_m):
        """(rows,) closed form: a cone holds A d^3 / (3 H^2), a dish pi d^2 (R - d / 3).

        d is the depth at the centre, H that of the edge, R the radius of the sphere.
        """
        levels, rise = as_levels(levels_m), self.centre_m
        if rise <= 0:
            return self._tip_m3(np.clip(levels - rise, 0, -rise))
        return self._tip_m3(rise - np.clip(levels, 0, rise)) - self._tip_m3(rise)

    def area_m2(self, levels_m):
        """(rows,) derivative of `volume_m3` by the level."""
        return self._wet_m2(levels_m) - self.plan_m2 * (as_levels(levels_m) >= 0)

    def derivatives(self, levels_m):
        """{input: (rows,)} by "datum" (level), "bottom" and "scale", m3 per SI unit.

        bottom lifts the whole bottom: minus its wetted plan area. scale stretches the plan.
        """
        levels, rise = as_levels(levels_m), self.centre_m
        by_scale = 2 * self.volume_m3(levels)
        if self.form == "dish":
            sag = np.clip(levels - rise, 0, -rise) if rise < 0 else rise - np.clip(levels, 0, rise)
            whole = rise if rise > 0 else 0.0
            by_scale = self._dish_by_scale(sag) - self._dish_by_scale(whole)
        return {
            "datum": self.area_m2(levels),
            "bottom": -self._wet_m2(levels),
            "scale": by_scale,
        }

    @property
    def _sphere_m(self):
        return (self.plan_m2 / np.pi / abs(self.centre_m) + abs(self.centre_m)) / 2

    def _tip_m3(self, depth):
        """Volume of the cone or dish between its tip and the depth from it."""
        if self.centre_m == 0:
            return 0.0 * depth
        if self.form == "cone":
            return self.plan_m2 * depth**3 / (3 * self.centre_m**2)
        return np.pi * depth**2 * (self._sphere_m - depth / 3)

    def _tip_m2(self, depth):
        if self.form == "cone":
            return self.plan_m2 * (depth / self.centre_m) ** 2
        return np.pi * depth * (2 * self._sphere_m - depth)

    def _dish_by_scale(self, depth):
        return self.plan_m2 / abs(self.centre_m) * depth**2

    def _wet_m2(self, levels_m):
        levels, rise = as_levels(levels_m), self.centre_m
        if rise == 0:
            return self.plan_m2 * (levels >= 0)
        if rise < 0:
            return self._tip_m2(np.clip(levels - rise, 0, -rise))
        return (self.plan_m2 - self._tip_m2(rise - np.clip(levels, 0, rise))) * (levels >= 0)


def shaped_bottom(form, plan_m2, centre_m=0.0):
    """A flat, conical or dished bottom; a centre at level 0 makes it flat.

    Parameters
    ----------
    form : str
        "flat", "cone" or "dish".
    plan_m2 : float
        Inside area of the first course at its bottom.
    centre_m : float, optional
        Level of the centre: above 0 the bottom bulges up, below 0 down.

    Returns
    -------
    ShapedBottom

    Raises
    ------
    SolutionError
        For an unknown form, an area that cannot be, a flat bottom with a centre off the plane, and
        a dish deeper than half a sphere.

    Examples
    --------
    A cone of 0.3 m below a floor of 100 m2 holds a third of its prism:

    >>> round(float(shaped_bottom("cone", 100.0, -0.3).volume_m3([0.0])[0]), 9)
    10.0
    """
    if form not in FORMS:
        raise SolutionError(f'bottom "{form}"; expected one of {", ".join(FORMS)}')
    if not (np.isfinite(plan_m2) and plan_m2 > 0 and np.isfinite(centre_m)):
        raise SolutionError(
            message(
                "bottom_impossible",
                "bottom of {plan_m2:g} m2 with its centre at {centre_m:g} m; expected an "
                "area above 0 and a finite height",
                plan_m2=plan_m2,
                centre_m=centre_m,
            )
        )
    if form == "flat" and centre_m != 0:
        raise SolutionError(
            message(
                "flat_bottom_centre",
                "a flat bottom with its centre at {centre_m:g} m; expected 0",
                centre_m=centre_m,
            )
        )
    if form == "dish" and abs(centre_m) > np.sqrt(plan_m2 / np.pi):
        raise SolutionError(
            message(
                "dish_too_deep",
                "a dish {depth_m:g} m deep is more than half a sphere",
                depth_m=abs(centre_m),
            )
        )
    return ShapedBottom("flat" if centre_m == 0 else form, float(centre_m), float(plan_m2))


@dataclass(frozen=True)
class SurfaceBottom(Part):
    """A bottom given as a surface of triangles: a leaning plate, or surveyed points.

    Attributes
    ----------
    surface : Surface
        Over the plan (`terrain.Surface`).
    survey : SurveyedSurface or None
        `soundings.SurveyedSurface`, or None for a plate of a given slope.
    shared : tuple of factors.Factor
        What the heights of the points have in common: columns (n, c), m.
    has_own_height : bool
        Whether this is all that is uncertain about its height.
    """

    surface: Surface
    survey: SurveyedSurface | None = None
    shared: tuple = ()
    has_own_height: bool = False
    kind = "bottom"

    @property
    def lowest_m(self):
        """Level at which the tank is empty."""
        return self.surface.lowest_m

    @property
    def breakpoints_m(self):
        """Where the tank is empty."""
        return (self.lowest_m,)

    def volume_m3(self, levels_m):
        """(rows,) exact for the surface."""
        volume, _ = self.surface.volume_and_area(as_levels(levels_m))
        return volume - self._plan_m2 * np.maximum(as_levels(levels_m), 0)

    def area_m2(self, levels_m):
        """(rows,) derivative of `volume_m3` by the level."""
        _, wet = self.surface.volume_and_area(as_levels(levels_m))
        return wet - self._plan_m2 * (as_levels(levels_m) >= 0)

    def derivatives(self, levels_m):
        """{input: (rows,)} by "datum" (level), "bottom" and "scale", m3 per SI unit.

        bottom lifts the whole bottom: minus its wetted plan area. scale stretches the plan; a
        leaning plate keeps its slope, surveyed points their heights.
        """
        levels = as_levels(levels_m)
        volume, wet = self.surface.volume_and_area(levels)
        by_scale = 2 * (volume - self._plan_m2 * np.maximum(levels, 0))
        if self.survey is None:
            by_scale += volume - levels * wet  # minus the integral of z over the wet plan
        return {
            "datum": wet - self._plan_m2 * (levels >= 0),
            "bottom": -wet,
            "scale": by_scale,
        }

    def sources(self, levels_m):
        """Noise of the surveyed points and form between them; none for a leaning plate.

        The covariance is exact at the edges of 24 bands of wet area; within a band it grows with
        the wet area.
        """
        if self.survey is None:
            return ()
        edges = np.append(self.surface.lowest_m, self.survey.edges_m)
        _, at_edges = self.surface.volume_and_area(edges)
        at_edges[0] = 0.0
        _, wet = self.surface.volume_and_area(as_levels(levels_m))
        share = np.column_stack([np.interp(wet, at_edges, unit) for unit in np.eye(len(edges))[1:]])
        by_points = share @ self.survey.by_points_m2
        return (
            Source("bottom_points", share @ self.survey.noise_m3, self.survey.noise_dof),
            Source("bottom_form", share @ self.survey.form_m3, self.survey.form_dof),
            *(one.source(by_points @ one.columns) for one in self.shared),
        )

    @property
    def _plan_m2(self):
        return self.surface.areas_m2.sum()


def leaning_bottom(footprint, slope):
    """A plate square to the shell's axis, through level 0 at the axis.

    Slid along the axis to the plane of level 0, its point at the distance x down the lean lies at z
    = - m x / (1 + m^2).

    Parameters
    ----------
    footprint : Footprint
        Outline of the first course at its bottom.
    slope : array_like, shape (2,)
        (dx/dz, dy/dz) of the axis.

    Returns
    -------
    SurfaceBottom
    """
    slope = np.asarray(slope, dtype=float)
    plan, faces = footprint.mesh(1, LEAN_AZIMUTHS)
    return SurfaceBottom(surface(plan, faces, -plan @ slope / (1 + slope @ slope)))


def surveyed_bottom(footprint, xyz_m, sd_m=None, slope=(0.0, 0.0), shared=None):
    """The bottom through surveyed points, smoothed by what they can tell.

    Parameters
    ----------
    footprint : Footprint
        Outline of the first course at its bottom.
    xyz_m : ndarray, shape (n, 3)
        x, y in the survey's frame, z above the bottom of the first course.
    sd_m : ndarray, shape (n,), or float, optional
        Standard deviations of z; None: noise and waves are estimated as one.
    slope : array_like, shape (2,), optional
        (dx/dz, dy/dz) of the shell's axis.
    shared : sequence of factors.Factor, optional
        What the heights have in common, over the points; None: nothing says it.

    Returns
    -------
    SurfaceBottom

    Raises
    ------
    SolutionError
        As `soundings.surveyed_surface`.
    """
    survey = surveyed_surface(footprint, xyz_m, sd_m, slope)
    return SurfaceBottom(survey.surface, survey, tuple(shared or ()), shared is not None)
