"""Geometry of a tank for a table by liquid alone: declared only, with wide uncertainties.

Within the dips of the runs, such a geometry only interpolates. A vertical tank keeps its courses,
each with a free radius. A horizontal tank keeps its form, with unknown sizes, tilt and zero. A
sphere has an unknown diameter and zero, a mesh an unknown scale and zero.
"""

from dataclasses import replace

import numpy as np

from tankcal.pipeline.checks.survey_limits import limits_of_method
from tankcal.pipeline.liquid.geometry import Geometry, wide_input
from tankcal.pipeline.liquid.nominal_wall import NominalWall, find_nominal_wall
from tankcal.pipeline.solids.scan import Scan
from tankcal.pipeline.tanks.solid import sized_job

KEPT = (  # inputs that describe the liquid, the parts and the elasticity, not the shape of the wall
    *("plate_thickness", "shell_temperature", "expansion", "youngs_modulus"),
    *("liquid_density", "roof_mass", "deadwood", "interpolation", "rounding"),
)
SIZES = ("diameter", "length", "end_depth", "tilt", "dip_position", "datum", "scale", "surface")


def geometry_beside(job, survey):
    """Return the `Geometry` that is adjusted with the runs of a job.

    Sizes without any information get wide uncertainties.
    """
    if isinstance(survey, NominalWall):
        return Geometry(job, survey, told_by_liquid=SIZES)
    if job.tank.kind == "vertical" or job.points is not None:
        return Geometry(job, survey)
    if any(declared.name in SIZES for declared in job.inputs):
        return Geometry(job, survey)
    widened = replace(job, inputs=(*job.inputs, *_wide_inputs(job)))
    return Geometry(widened, survey, told_by_liquid=SIZES)


def geometry_alone(job, survey):
    """Return a `Geometry` with almost no information, for the table of liquid alone."""
    kept_inputs = tuple(declared for declared in job.inputs if declared.name in KEPT)
    bare = replace(
        job, inputs=kept_inputs, correlations=_correlations_between(job.correlations, kept_inputs)
    )
    if job.tank.kind == "vertical":
        bare = replace(
            bare, points=None, strapping=None, lines=None, hits=None, tangents=None, clouds=None,
            survey=replace(bare.survey, liquid_level_m=None, liquid_density_kg_m3=None),
        )  # fmt: skip
        wall = survey if isinstance(survey, NominalWall) else find_nominal_wall(bare)
        return Geometry(bare, wall, told_by_liquid=(*SIZES, "course_heights"))
    if isinstance(survey, Scan):
        bare, survey = replace(sized_job(bare, survey), points=None), None
    widened = replace(bare, inputs=(*kept_inputs, *_wide_inputs(bare)))
    return Geometry(widened, survey, told_by_liquid=SIZES)


def _wide_inputs(job):
    """Inputs of sizes with almost no information."""
    wide = limits_of_method("tankcal.pipeline.liquid")["wide"]
    zero = wide_input("datum", wide["zero_mm"] / 1000, "mm", wide["zero_mm"])
    if job.horizontal is not None:
        lying = job.horizontal
        diameter = wide["size"] * (lying.width_m + lying.height_m) / 2
        length, tilt = wide["size"] * lying.length_m, wide["tilt_mm_per_m"]
        return (
            wide_input("diameter", diameter, "mm", 1000 * diameter),
            wide_input("length", length, "mm", 1000 * length),
            wide_input("tilt", tilt / 1000, "mm/m", tilt),
            zero,
        )
    if job.sphere is not None:
        diameter = wide["size"] * job.sphere.diameter_m
        return (wide_input("diameter", diameter, "mm", 1000 * diameter), zero)
    return (wide_input("scale", wide["scale"], "ppm", 1e6 * wide["scale"]), zero)


def _correlations_between(correlations, kept):
    """Correlations between the kept inputs only."""
    names = {declared.name for declared in kept}
    return tuple(
        correlation for correlation in correlations if {correlation[0], correlation[1]} <= names
    )


def filled_range_m(metering):
    """Return the lowest and the highest dip used, m."""
    dips = metering.dip_m[metering.used & np.isfinite(metering.dip_m)]
    return float(dips.min()), float(dips.max())
