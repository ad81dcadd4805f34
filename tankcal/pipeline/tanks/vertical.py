"""Vertical tank: shell of courses, head, bottom and internal parts."""

from dataclasses import dataclass

import numpy as np

from tankcal.geometry.field.components import COMPONENTS, KINDS
from tankcal.geometry.field.estimate import gauss_heights
from tankcal.job.contract.bottom import OF_CLOUD
from tankcal.job.plausibility import INSIDE, PLATES_TO_INSIDE
from tankcal.methods.base import given_methods
from tankcal.pipeline.tanks.solid import (
    as_surveyed,
    deadwood_part,
    estimates_of,
    factor_of_unseen,
    is_warmed,
    thermal_scale,
)
from tankcal.tank.body import Body, ShellPart
from tankcal.tank.bottoms import Footprint
from tankcal.tank.budgets import cause_factors
from tankcal.tank.fittings import floating_roof
from tankcal.tank.heads import End, standard_end
from tankcal.tank.hydrostatics import liquid_head
from tankcal.tank.parts import Part
from tankcal.tank.tips import FORMS as TIPS
from tankcal.tank.tips import HeadedShell, tip_of
from tankcal.tank.volumes import DEPARTURES, CourseShape, ShellVolume
from tankcal.units import FULL_TURN

# The plan of a bottom is that of the shell, so it widens with the shell.


@dataclass(frozen=True)
class Widened(Part):
    """Part with derivatives by inputs that widen the shell.

    Attributes
    ----------
    part : Part
        Part with a derivative by "scale".
    rates : dict
        {input: relative growth of the shell's lengths per SI unit of the input}.
    """

    part: Part
    rates: dict
    kind = "bottom"

    @property
    def has_own_height(self):
        """Whether the part has a height of its own."""
        return self.part.has_own_height

    @property
    def lowest_m(self):
        """Level at which the tank is empty."""
        return self.part.lowest_m

    @property
    def breakpoints_m(self):
        """Breakpoints of the part, m."""
        return self.part.breakpoints_m

    def volume_m3(self, levels_m):
        """Volumes (rows,) of the part, m3."""
        return self.part.volume_m3(levels_m)

    def area_m2(self, levels_m):
        """Areas (rows,) of the part, m2."""
        return self.part.area_m2(levels_m)

    def derivatives(self, levels_m):
        """{input: derivative (rows,)} of the part, with each rate times its derivative by scale."""
        derivatives = self.part.derivatives(levels_m)
        return derivatives | {
            name: rate * derivatives["scale"] for name, rate in self.rates.items()
        }

    def sources(self, levels_m):
        """Sources of uncertainty of the part."""
        return self.part.sources(levels_m)


def widen_bottom(part, shell):
    """`Widened` bottom of a `body.ShellPart`, from its radius at the bottom."""
    radius = np.sqrt(shell.volume.area_m2([0.0])[0] / np.pi) / shell.scale
    rates = {
        "offset": 1 / radius,
        "plate_thickness": -shell.subtracts / radius,
        "paint": -shell.subtracts / radius,
        "shell_temperature": -shell.expansion_per_k / shell.scale,
        "expansion": (shell.scale - 1) / shell.expansion_per_k / shell.scale,
    }
    bearing = [name for name in ("offset", *shell.bearing) if name not in shell.unused]
    return Widened(part, {name: rate for name, rate in rates.items() if name in bearing})


FOOTPRINT = 360  # azimuths of the outline of a bottom


def insets_of(job, switches):
    """Plate and paint of each course to subtract from outside radii, m; 0 for an inside survey."""
    outside = job.survey.side == "outside"
    return [
        outside * (switches.plate * course.thickness_m + switches.paint * course.paint_m)
        for course in job.courses
    ]


def nominal_inside_m(job, course):
    """Nominal inside radius of a course, m."""
    less = PLATES_TO_INSIDE[job.diameter_is or INSIDE]
    return job.tank.nominal_diameter_m / 2 - less * course.thickness_m


def shell_volume(wall, insets_m=None, scale=1.0, stretch=1.0, *, departures=()):
    """`ShellVolume` of the courses from the field of the wall.

    Parameters
    ----------
    wall : Wall
    insets_m : sequence of float, length courses, optional
        Lengths to subtract from the radii, m.
    scale : float
        Factor of horizontal lengths.
    stretch : float
        Factor of heights.
    departures : sequence of str
        Declared departures among "barrel" and "taper".
    """
    outlines, sites, levels = wall.field.outlines_m, wall.field.sites, gauss_heights()
    missed = {
        name: departure(levels) - wall.field.seen(departure(sites.zeta))
        for name, departure in DEPARTURES.items()
        if name in departures
    }
    insets = insets_m or [0.0] * len(outlines)
    return ShellVolume(
        tuple(
            CourseShape(
                stretch * wall.joints_m[index],
                stretch * wall.joints_m[index + 1],
                scale * (outlines[index] - inset),
                inset,
                scale,
                {name: lacking[index] for name, lacking in missed.items()},
            )
            for index, inset in enumerate(insets)
        )
    )


def shell_zero(job, wall):
    """Level of the table's zero in the frame of the parts, m.

    The zero is the dip plate, or otherwise the bottom, above the bottom of the first course. A
    bottom that leans with the shell is higher or lower at the dip point.
    """
    datum = job.datum
    if datum.dip_plate_z_m is not None:
        return datum.plate_level_m
    if job.bottom.form == "leaning" and job.switches.bottom and datum.dip_x_m is not None:
        axis_m, slope = np.array(wall.shell.axis_m), np.array(wall.shell.slope)
        axis_at_bottom = axis_m + (datum.bottom_z_m - wall.shell.z_m) * slope
        return -float((np.array([datum.dip_x_m, datum.dip_y_m]) - axis_at_bottom) @ slope)
    return 0.0


def critical_zone(job):
    """Dips (low, high) between which a floating roof is partly afloat; None without a roof."""
    if job.roof is None or not job.switches.roof:
        return None
    return job.roof.critical_bottom_m, job.roof.critical_top_m


def vertical_body(job, wall, switches, uncertain):
    """`Body` of a vertical tank.

    Parameters
    ----------
    job : Job
    wall : Wall
    switches
        Enabled corrections.
    uncertain : bool
        Whether to propagate the uncertainty of the wall.
    """
    job = as_surveyed(job, wall)
    shell = _shell(job, wall, switches, uncertain)
    zero = shell_zero(job, wall)
    top_part = shell
    if switches.top and job.top is not None:
        top_part = HeadedShell(shell, _tip(job.top, shell))
    highest = top_part.highest_m if top_part is not shell else shell.volume.height_m
    parts = [top_part]
    if switches.head and (job.table.liquid_density_kg_m3 or job.survey.liquid_density_kg_m3):
        parts.append(_head(job, shell, zero, highest))
    if switches.deadwood and job.deadwood:
        parts.append(deadwood_part(job.deadwood, zero))
    if switches.roof and job.roof is not None:
        parts.append(_roof(job, zero))
    if switches.bottom and job.bottom.form != "flat":
        parts = _add_bottom(job, wall, shell, zero, parts)
    return Body(
        tuple(parts),
        job.inputs,
        lowest_m=min(part.lowest_m for part in parts),
        highest_m=highest,
        correlations=job.correlations,
        estimates=estimates_of(job),
        shell=shell,
    )


def _add_bottom(job, wall, shell, zero, parts):
    """Parts with the bottom: beside them, or below them if it was calibrated by liquid."""
    bottom = job.bottom
    if bottom.form == "liquid":
        from tankcal.tank.volumes import PartAbove, measured_bottom

        measured = measured_bottom(bottom.level_m + zero, bottom.volume_m3, bottom.u_m3)
        return [*(PartAbove(part, measured.highest_m) for part in parts), measured]
    return [*parts, widen_bottom(_bottom(job, wall, shell), shell)]


def _bottom(job, wall, shell):
    """Part of the bottom, by its form."""
    from tankcal.tank.bottoms import leaning_bottom, shaped_bottom, surveyed_bottom

    bottom, low = job.bottom, job.datum.bottom_z_m
    # Inside outline of the first course at its bottom: the lowest section, scaled to its area.
    x, y, radius = wall.lowest_outline(np.arange(FOOTPRINT) * FULL_TURN / FOOTPRINT)
    larger = shell.volume.area_m2([0.0])[0] / (np.pi * np.mean(radius**2))
    footprint = Footprint(float(x), float(y), radius * np.sqrt(larger))
    if bottom.form == "leaning":
        return leaning_bottom(footprint, wall.shell.slope)
    if bottom.xyz_m is not None:
        xyz = bottom.xyz_m - (0.0, 0.0, low)
        causes = bottom.shared if bottom.form == OF_CLOUD else None
        shared = causes and cause_factors(causes, [cause.column_m for cause in causes])
        return surveyed_bottom(footprint, xyz, bottom.sd_m, wall.shell.slope, shared)
    rise = 0.0 if bottom.centre_z_m is None else bottom.centre_z_m - low
    depth, *radii = _sizes_of_head(bottom, footprint.area_m2, abs(rise))
    return shaped_bottom(bottom.form, footprint.area_m2, np.copysign(depth, rise), *radii)


def _head(job, shell, zero, highest_m):
    """Part of the deformation by the liquid head."""
    survey = job.survey
    return liquid_head(
        shell.volume,
        [course.thickness_m for course in job.courses],
        job.material.e_pa,
        job.table.liquid_density_kg_m3,
        survey_density_kg_m3=survey.liquid_density_kg_m3 or 0.0,
        survey_level_m=_survey_level_m(survey, zero),
        scale=shell.scale,
        headroom_m=highest_m - shell.volume.height_m,
    )


def _tip(top, shell):
    """Head on the shell, at the table's temperature."""
    volume = shell.volume
    plan = float(volume.top_weights @ volume.features)
    sizes = _sizes_of_head(top, plan, top.depth_m)
    return tip_of(top.form, plan, *(shell.stretch * size if size else size for size in sizes))


def _sizes_of_head(head, plan_m2, depth_m):
    """(Depth, dish, knuckle) of a head; radii of a standard follow from the edge diameter."""
    end = End(TIPS[head.form], depth_m or 0.0, head.dish_radius_m, head.knuckle_radius_m)
    if head.standard is not None:
        end = standard_end(end, head.standard, 2 * np.sqrt(plan_m2 / np.pi))
    return end.depth_m, end.dish_radius_m, end.knuckle_radius_m


def _survey_level_m(survey, zero):
    """Level of the liquid during the survey, m; 0 for the empty tank."""
    if not survey.liquid_density_kg_m3:
        return 0.0
    return max((survey.liquid_level_m or 0.0) + zero, 0.0)


def _roof(job, zero):
    """Part of the floating roof; its heights are dips, `zero` the level of dip 0."""
    roof = job.roof
    return floating_roof(
        roof.mass_kg,
        roof.critical_bottom_m + zero,
        roof.critical_top_m + zero,
        roof.reference_density_kg_m3,
        roof.weighing,
    )


def _shell(job, wall, switches, uncertain):
    """`ShellPart` of a wall.

    Parameters
    ----------
    job : Job
    wall : Wall
    switches
        Enabled corrections.
    uncertain : bool
        Whether to propagate the uncertainty of the wall.
    """
    scale = thermal_scale(job, switches)
    stretch = scale if job.table.height_expansion else 1.0
    leaning = np.hypot(1.0, wall.shell.tilt)  # horizontal section over section square to the axis
    volume = shell_volume(
        wall,
        insets_of(job, switches),
        scale if switches.tilt else scale / np.sqrt(leaning),
        stretch if switches.tilt else stretch * leaning,
        departures=_declared_names(job),
    )
    features = _functionals(wall, volume) if uncertain else None
    bearing = bearing_inputs(job, switches)
    read_with = wall.read_with(features.weights) if uncertain else {}
    if not wall.has_applied_inputs:
        read_with = {name: column for name, column in read_with.items() if name in bearing}
    return ShellPart(
        volume,
        _factors(job, wall, volume, features) if uncertain else (),
        scale,
        job.material.expansion_per_k,
        stretch,
        bearing,
        wall.shell.tilt if switches.tilt else 0.0,
        read_with,
        wall.without_inputs,
        job.survey.side == "outside",
        wall.shell.tilt_known,
    )


def _declared_names(job):
    return {declared_input.name for declared_input in job.inputs}


def _factors(job, wall, volume, features):
    """`Factor`s of the features of the shell: from readings, and from unseen form by kind."""
    has_means = any(method.has_means for method in given_methods(job))
    return (
        *wall.factors(job, features.weights),
        *_factors_of_unseen(wall, volume, features, _declared_names(job), scanned=has_means),
    )


def _factors_of_unseen(wall, volume, features, declared, *, scanned):
    """`Factor` of each kind of component that the survey does not fully determine.

    A declared barrel or taper is not counted again. Points may miss seams, and their readings
    cannot exclude them. Seams therefore have at least the size that points may miss. The cells of a
    scan leave no gaps, so this lower bound does not apply.
    """
    assumed, factors = wall.field.amplitudes.assumed_share(), []
    top = volume.weights_m([volume.height_m])[0]
    for kind in KINDS:
        indices = [
            index
            for index, component in enumerate(COMPONENTS)
            if component.kind == kind
            and component.declared_as not in declared
            and (component.shape == "mean" or wall.field.stated)
        ]
        if indices:
            parts = [features.unseen(index) for index in indices]
            assumed_shares = assumed[indices]
            if kind == "seams" and not scanned:
                parts.append(_hidden_seams_m2(features, top, sum(parts)))
                assumed_shares = np.append(assumed_shares, 1.0)
            factors.append(
                factor_of_unseen(kind, parts, [top @ part @ top for part in parts], assumed_shares)
            )
    return tuple(factor for factor in factors if factor.columns.shape[1])


def _hidden_seams_m2(features, top, known_m2):
    """Covariance (f, f) by which the known seams fall short of those that points may miss, m2."""
    hidden = features.hidden_seams()
    least = max(top @ hidden @ top, 1e-30)
    # Only the shortfall at the top of the shell is added, so that known seams count once.
    return max(1 - top @ known_m2 @ top / least, 0.0) * hidden


def _functionals(wall, volume):
    """`Functionals` of the features of the shell by the surveyed radii."""
    return wall.field.functionals(np.array([course.gradients_m for course in volume.courses]))


def volume_by_points(job, wall, levels_m):
    """Derivative of the shell's volume by the coordinates of the accepted points.

    Parameters
    ----------
    job : Job
    wall : Wall
        Wall with m accepted points.
    levels_m : array_like, shape (rows,)
        Levels above the bottom of the first course, m.

    Returns
    -------
    ndarray, shape (rows, 3 m)
        Derivatives, m3 per m.
    """
    volume = _shell(job, wall, job.switches, False).volume
    jacobian = _functionals(wall, volume).weights @ wall.radii_by_points
    return volume.weights_m(np.maximum(levels_m, 0.0)) @ jacobian


def bearing_inputs(job, switches):
    """Declared inputs that the corrections of the shell use."""
    is_seen_through = job.strapping is not None or (job.points is not None and job.points.by_inputs)
    outside = job.survey.side == "outside" or bool(is_seen_through)
    is_used = {
        "plate_thickness": outside and switches.plate and any(c.thickness_m for c in job.courses),
        "paint": outside and switches.paint and any(c.paint_m for c in job.courses),
        "shell_temperature": is_warmed(job, switches),
        "expansion": is_warmed(job, switches),
    }
    return tuple(name for name, is_relevant in is_used.items() if is_relevant)
