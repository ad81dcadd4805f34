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
from tankcal.tank.tips import FORMS as TIPS
from tankcal.tank.tips import Tip, tip_of
from tankcal.uncertainty import Source

FORMS = ("flat", *TIPS)
LEAN_AZIMUTHS = 720  # of the triangles of a leaning plate


@dataclass(frozen=True)
class ShapedBottom(Part):
    """A level plate, or a head with a level edge at level 0, dished down or up; `shaped_bottom`.

    Attributes
    ----------
    form : str
        One of FORMS.
    centre_m : float
        Level of the centre: above 0 the bottom bulges up, below 0 down.
    plan_m2 : float
        Inside area of the first course at its bottom.
    tip : Tip or None
        The head; None for a level plate.
    """

    form: str
    centre_m: float
    plan_m2: float
    tip: Tip | None = None
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
        """(rows,) of the head below the edge, less what one that bulges up takes above it."""
        levels = as_levels(levels_m)
        return self._of_tip(levels, self.tip.beyond_m3) if self.tip else 0.0 * levels

    def area_m2(self, levels_m):
        """(rows,) derivative of `volume_m3` by the level."""
        return self._wet_m2(levels_m) - self.plan_m2 * (as_levels(levels_m) >= 0)

    def derivatives(self, levels_m):
        """{input: (rows,)} by "datum" (level), "bottom", "scale" and sizes, m3 per SI unit.

        bottom lifts the whole bottom: minus its wetted plan area. scale stretches the plan.
        bottom_depth moves the centre away from the edge, dish_radius and knuckle_radius are those
        of a torispherical head that was given by them.
        """
        levels = as_levels(levels_m)
        found = {
            "datum": self.area_m2(levels),
            "bottom": -self._wet_m2(levels),
            "scale": 0.0 * levels,
        }
        if self.tip is None:
            return found
        for name in self.tip.derivatives(0.0):
            said = "bottom_depth" if name == "depth" else name
            found[said] = self._of_tip(levels, lambda x, name=name: self.tip.derivatives(x)[name])
        return found

    def _of_tip(self, levels, beyond):
        """What the head adds at levels, by what it has beyond a plane."""
        if self.centre_m <= 0:
            return beyond(np.clip(-levels, 0, self.tip.depth_m))
        return beyond(np.clip(levels, 0, self.tip.depth_m)) - beyond(0.0)

    def _wet_m2(self, levels_m):
        levels = as_levels(levels_m)
        if self.tip is None:
            return self.plan_m2 * (levels >= 0)
        depth = self.tip.depth_m
        if self.centre_m < 0:
            return self.tip.area_m2(np.clip(-levels, 0, depth))
        return (self.plan_m2 - self.tip.area_m2(np.clip(levels, 0, depth))) * (levels >= 0)


def shaped_bottom(form, plan_m2, centre_m=0.0, dish_radius_m=None, knuckle_radius_m=None):
    """A flat bottom, or a head; a centre at level 0 makes it flat.

    Parameters
    ----------
    form : str
        One of FORMS.
    plan_m2 : float
        Inside area of the first course at its bottom.
    centre_m : float, optional
        Level of the centre: above 0 the bottom bulges up, below 0 down. 0 for a torispherical one
        of given radii, which bulges down.
    dish_radius_m, knuckle_radius_m : float, optional
        Of a torispherical bottom: one beside the centre, or both.

    Returns
    -------
    ShapedBottom

    Raises
    ------
    SolutionError
        For an unknown form, an area that cannot be, a flat bottom with a centre off the plane, and
        sizes that make no such head (a dish deeper than half a sphere).

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
    radii = (dish_radius_m, knuckle_radius_m)
    if centre_m == 0 and None in radii:
        return ShapedBottom("flat", 0.0, float(plan_m2))
    tip = tip_of(form, plan_m2, abs(centre_m), *radii)
    centre = float(centre_m) if centre_m else -tip.depth_m
    return ShapedBottom(form, centre, float(plan_m2), tip)


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
