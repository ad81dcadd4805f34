"""Volume between the bottom of a vertical tank and the plane of the bottom of its first course.

Each part gives the volume on the bottom below a level, less the area times level that the shell
counts above that plane (level 0),

    V(L) = integral over the plan of (L - z)+ - L+,

so it is positive below the plane, and negative where the bottom is above the plane. A level L = z
counts as wet. Between the plane and the edge of the bottom, the wall may differ from the outline of
the plan. This difference is neglected, as the product of two small heights.
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
LEAN_AZIMUTHS = 720  # number of triangles of a leaning plate


@dataclass(frozen=True)
class ShapedBottom(Part):
    """Level plate, or head with a level edge at level 0, dished down or up; see `shaped_bottom`.

    Attributes
    ----------
    form : str
        One of FORMS.
    centre_m : float
        Level of the centre: positive for a bottom that bulges up, negative for one that bulges
        down.
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
        """Level of the empty tank."""
        return min(self.centre_m, 0.0)

    @property
    def breakpoints_m(self):
        """Level of the empty tank."""
        return (self.lowest_m,)

    def volume_m3(self, levels_m):
        """Return the volume (rows,) of the head below its edge, or minus that above it."""
        levels = as_levels(levels_m)
        return self._tip_contribution(levels, self.tip.beyond_m3) if self.tip else 0.0 * levels

    def area_m2(self, levels_m):
        """Return the derivative (rows,) of `volume_m3` by the level."""
        return self._wet_m2(levels_m) - self.plan_m2 * (as_levels(levels_m) >= 0)

    def derivatives(self, levels_m):
        """Return {input: (rows,)} by "datum" (level), "bottom", "scale" and sizes, m3 per SI unit.

        "bottom" raises the whole bottom: minus its wet plan area. "scale" stretches the plan.
        "bottom_depth" moves the centre away from the edge. "dish_radius" and "knuckle_radius" are
        the dimensions of a torispherical head, if given.
        """
        levels = as_levels(levels_m)
        derivatives = {
            "datum": self.area_m2(levels),
            "bottom": -self._wet_m2(levels),
            "scale": 0.0 * levels,
        }
        if self.tip is None:
            return derivatives
        for name in self.tip.derivatives(0.0):
            input_name = "bottom_depth" if name == "depth" else name
            derivatives[input_name] = self._tip_contribution(
                levels, lambda x, name=name: self.tip.derivatives(x)[name]
            )
        return derivatives

    def _tip_contribution(self, levels, content_beyond):
        """Return the contribution of the head at levels, from its content beyond a plane."""
        # Bulging down: content beyond the level. Bulging up: minus the volume that the head
        # occupies.
        if self.centre_m <= 0:
            return content_beyond(np.clip(-levels, 0, self.tip.depth_m))
        return content_beyond(np.clip(levels, 0, self.tip.depth_m)) - content_beyond(0.0)

    def _wet_m2(self, levels_m):
        """Return the wet plan area (rows,) of the bottom."""
        levels = as_levels(levels_m)
        if self.tip is None:
            return self.plan_m2 * (levels >= 0)
        depth = self.tip.depth_m
        if self.centre_m < 0:
            return self.tip.area_m2(np.clip(-levels, 0, depth))
        return (self.plan_m2 - self.tip.area_m2(np.clip(levels, 0, depth))) * (levels >= 0)


def shaped_bottom(form, plan_m2, centre_m=0.0, dish_radius_m=None, knuckle_radius_m=None):
    """Return a flat bottom, or a head; a centre at level 0 makes it flat.

    Parameters
    ----------
    form : str
        One of FORMS.
    plan_m2 : float
        Inside area of the first course at its bottom.
    centre_m : float, optional
        Level of the centre: positive for a bottom that bulges up, negative for one that bulges
        down. 0 for a torispherical bottom of given radii, which bulges down.
    dish_radius_m, knuckle_radius_m : float, optional
        Radii of a torispherical bottom: one of them in addition to the centre, or both.

    Returns
    -------
    ShapedBottom

    Raises
    ------
    SolutionError
        For an unknown form, an impossible area, a flat bottom with a centre off the plane, and
        dimensions that are impossible for such a head (a dish deeper than a hemisphere).

    Examples
    --------
    A cone of 0.3 m below an area of 100 m2 contains a third of its prism:

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
    """Bottom given as a surface of triangles: a leaning plate, or surveyed points.

    Attributes
    ----------
    surface : Surface
        Surface over the plan (`terrain.Surface`).
    survey : SurveyedSurface or None
        `soundings.SurveyedSurface`; None for a plate of a given slope.
    shared : tuple of factors.Factor
        Common errors of the heights of the points: columns (n, c), m.
    has_own_height : bool
        Whether `shared` contains the complete uncertainty of the height of the bottom.
    """

    surface: Surface
    survey: SurveyedSurface | None = None
    shared: tuple = ()
    has_own_height: bool = False
    kind = "bottom"

    @property
    def lowest_m(self):
        """Level of the empty tank."""
        return self.surface.lowest_m

    @property
    def breakpoints_m(self):
        """Level of the empty tank."""
        return (self.lowest_m,)

    def volume_m3(self, levels_m):
        """Return the volume (rows,), exact for the surface of triangles."""
        volume, _ = self.surface.volume_and_area(as_levels(levels_m))
        return volume - self._plan_m2 * np.maximum(as_levels(levels_m), 0)

    def area_m2(self, levels_m):
        """Return the derivative (rows,) of `volume_m3` by the level."""
        _, wet = self.surface.volume_and_area(as_levels(levels_m))
        return wet - self._plan_m2 * (as_levels(levels_m) >= 0)

    def derivatives(self, levels_m):
        """Return {input: (rows,)} by "datum" (level), "bottom" and "scale", m3 per SI unit.

        "bottom" raises the whole bottom: minus its wet plan area. "scale" stretches the plan; a
        leaning plate keeps its slope, surveyed points keep their heights.
        """
        levels = as_levels(levels_m)
        volume, wet = self.surface.volume_and_area(levels)
        # The plan area grows with the square of the scale; the heights are constant.
        by_scale = 2 * (volume - self._plan_m2 * np.maximum(levels, 0))
        if self.survey is None:
            by_scale += volume - levels * wet  # minus the integral of z over the wet plan
        return {
            "datum": wet - self._plan_m2 * (levels >= 0),
            "bottom": -wet,
            "scale": by_scale,
        }

    def sources(self, levels_m):
        """Return sources for the noise of the points and the form between them; none for a plate.

        The covariance is exact at the limits of 24 bands of wet area. Within a band, it grows in
        proportion to the wet area.
        """
        if self.survey is None:
            return ()
        edges = np.append(self.surface.lowest_m, self.survey.edges_m)
        _, at_edges = self.surface.volume_and_area(edges)
        at_edges[0] = 0.0
        _, wet = self.surface.volume_and_area(as_levels(levels_m))
        # Interpolation weights of the bands: the column of a band grows from 0 to 1 over its wet
        # area.
        share = np.column_stack([np.interp(wet, at_edges, unit) for unit in np.eye(len(edges))[1:]])
        by_points = share @ self.survey.by_points_m2
        return (
            Source("bottom_points", share @ self.survey.noise_m3, self.survey.noise_dof),
            Source("bottom_form", share @ self.survey.form_m3, self.survey.form_dof),
            *(factor.source(by_points @ factor.columns) for factor in self.shared),
        )

    @property
    def _plan_m2(self):
        return self.surface.areas_m2.sum()


def leaning_bottom(footprint, slope):
    """Return a plate perpendicular to the axis of the shell, through level 0 at the axis.

    The plate is shifted along the axis to the plane of level 0. Its point at the distance x down
    the lean has the height z = - m x / (1 + m^2).

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
    """Return the bottom through surveyed points, smoothed according to their noise.

    Parameters
    ----------
    footprint : Footprint
        Outline of the first course at its bottom.
    xyz_m : ndarray, shape (n, 3)
        x, y in the frame of the survey, z above the bottom of the first course.
    sd_m : ndarray, shape (n,), or float, optional
        Standard deviations of z; None: noise and waves are estimated jointly.
    slope : array_like, shape (2,), optional
        (dx/dz, dy/dz) of the axis of the shell.
    shared : sequence of factors.Factor, optional
        Common errors of the heights, for each point; None: unknown.

    Returns
    -------
    SurfaceBottom

    Raises
    ------
    SolutionError
        As for `soundings.surveyed_surface`.
    """
    survey = surveyed_surface(footprint, xyz_m, sd_m, slope)
    return SurfaceBottom(survey.surface, survey, tuple(shared or ()), shared is not None)
