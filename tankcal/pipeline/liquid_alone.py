"""A tank of which liquid alone tells the volumes: its geometry only declared, and hardly known.

Within the filled dips such a geometry interpolates, and does no more: an upright tank keeps its
courses, each with a radius of its own; a lying one its form, with sizes, tilt and zero unknown; a
sphere its diameter and zero, a mesh its scale and zero.
"""

from dataclasses import replace

import numpy as np

from tankcal.pipeline.liquid_geometry import Geometry, wide_input
from tankcal.pipeline.nominal_wall import NominalWall, find_nominal_wall
from tankcal.pipeline.scan import Scan
from tankcal.pipeline.survey_limits import limits_of
from tankcal.pipeline.tanks.solid import sized_job

KEPT = (  # inputs that say nothing of the wall, but of what it holds and how it gives way
    *("plate_thickness", "shell_temperature", "expansion", "youngs_modulus"),
    *("liquid_density", "roof_mass", "deadwood", "interpolation", "rounding"),
)
SIZES = ("diameter", "length", "end_depth", "tilt", "dip_position", "datum", "scale", "surface")


def geometry_beside(job, survey):
    """`Geometry` that is adjusted with the runs of a job; sizes nothing speaks for are wide."""
    if isinstance(survey, NominalWall):
        return Geometry(job, survey, told_by_liquid=SIZES)
    if job.tank.kind == "vertical" or job.points is not None:
        return Geometry(job, survey)
    if any(one.name in SIZES for one in job.inputs):
        return Geometry(job, survey)
    wide = replace(job, inputs=(*job.inputs, *_wide(job)))
    return Geometry(wide, survey, told_by_liquid=SIZES)


def geometry_alone(job, survey):
    """`Geometry` that hardly anything is known of, for the table of liquid alone."""
    kept = tuple(one for one in job.inputs if one.name in KEPT)
    bare = replace(job, inputs=kept, correlations=_among(job.correlations, kept))
    if job.tank.kind == "vertical":
        bare = replace(
            bare, points=None, strapping=None, lines=None, hits=None, tangents=None, clouds=None,
            survey=replace(bare.survey, liquid_level_m=None, liquid_density_kg_m3=None),
        )  # fmt: skip
        wall = survey if isinstance(survey, NominalWall) else find_nominal_wall(bare)
        return Geometry(bare, wall, told_by_liquid=(*SIZES, "course_heights"))
    if isinstance(survey, Scan):
        bare, survey = replace(sized_job(bare, survey), points=None), None
    wide = replace(bare, inputs=(*kept, *_wide(bare)))
    return Geometry(wide, survey, told_by_liquid=SIZES)


def _wide(job):
    """Inputs of sizes, of which next to nothing is known."""
    wide = limits_of("liquid")["wide"]
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


def _among(correlations, kept):
    names = {one.name for one in kept}
    return tuple(one for one in correlations if {one[0], one[1]} <= names)


def filled_range_m(metering):
    """(lowest, highest) dip that counts."""
    dips = metering.dip_m[metering.used & np.isfinite(metering.dip_m)]
    return float(dips.min()), float(dips.max())
