"""Parts common to all kinds of tank: unseen form, input values, deadwood and temperature."""

from dataclasses import replace

import numpy as np

from tankcal.methods.base import given_methods, method_of
from tankcal.tank.budgets import Factor
from tankcal.tank.fittings import deadwood
from tankcal.tank.heads import End, standard_end
from tankcal.uncertainty import factor_of

# Largest assumed share of the logarithm of a variance, to count as estimated or partly estimated.
LEARNED, HALF_LEARNED = 0.1, 0.5


def factor_of_unseen(kind, parts, sizes, assumed):
    """`Factor` of the form that the readings do not determine, for components of one kind.

    Parameters
    ----------
    kind : str
        Name of the cause.
    parts : list of ndarray, shape (f, f)
        Covariance of the features due to each of k components.
    sizes : sequence of float, length k
        Weight of each component in the uncertainty.
    assumed : sequence of float, length k
        Share of each amplitude that is assumed.
    """
    sizes = np.maximum(sizes, 1e-30)
    origin = told_by(float(sizes @ assumed / sizes.sum()))
    return Factor(kind, factor_of(sum(parts)), note=origin)


def told_by(assumed):
    """Code of the origin of an amplitude, from the share of it that is assumed."""
    if assumed < LEARNED:
        return "learned"
    return "half_learned" if assumed < HALF_LEARNED else "assumed"


def estimates_of(job):
    """{name of an input: its declared value}; 0 for a scale, an offset and similar inputs.

    The temperature is that of the shell, in degrees Celsius. Inputs that the job does not give have
    no value, nor have plates or paint that differ between courses.
    """
    survey, table, material = job.survey, job.table, job.material
    parts, solids = job.courses or job.rings, list(filter(None, (job.horizontal, job.sphere)))
    values_of_inputs = {
        **dict.fromkeys(("scale", "datum", "offset", "bottom", "barrel", "taper", "deadwood"), 0.0),
        "surface": 0.0,
        "plate_thickness": _only([1000 * part.thickness_m for part in parts or solids]),
        "paint": _only([1000 * part.paint_m for part in parts]),
        "shell_temperature": survey.shell_temperature_c,
        "expansion": material.expansion_per_k,
        "youngs_modulus": material.e_pa / 1e9,
        "liquid_density": table.liquid_density_kg_m3,
        "survey_level": _thousand(survey.liquid_level_m),
        "survey_density": survey.liquid_density_kg_m3,
        "roof_mass": job.roof and job.roof.mass_kg,
        **_sizes_of_solid(job),
        **_sizes_of_heads(job),
    }
    for method in given_methods(job):
        values_of_inputs |= method.input_values(job)
    return {name: value for name, value in values_of_inputs.items() if value is not None}


def _sizes_of_heads(job):
    """Declared sizes of the bottom of an upright tank and of the head on it."""
    if job.tank.kind != "vertical":
        return {}
    centre, top = job.bottom.centre_z_m, job.top
    heads = [head for head in (job.bottom, top) if head is not None]
    dishes, knuckles = (
        [1000 * getattr(head, key) for head in heads if getattr(head, key)]
        for key in ("dish_radius_m", "knuckle_radius_m")
    )
    return {
        "bottom_depth": None if centre is None else 1000 * abs(centre - job.datum.bottom_z_m),
        "top_depth": top and _thousand(top.depth_m),
        "dish": _only(dishes),
        "knuckle": _only(knuckles),
    }


def _sizes_of_solid(job):
    """Declared sizes of a horizontal cylinder or a sphere."""
    lying, solid = job.horizontal, job.horizontal or job.sphere
    if solid is None:
        return {}
    if lying is None:
        return {"diameter": _thousand(solid.diameter_m)}
    round_m = lying.width_m if lying.width_m == lying.height_m else None
    ends = (lying.end_a, lying.end_b)
    depths, dishes, knuckles = (
        [1000 * getattr(end, key) for end in ends if getattr(end, key)]
        for key in ("depth_m", "dish_radius_m", "knuckle_radius_m")
    )
    return {
        "diameter": _thousand(round_m),
        "length": _thousand(lying.length_m),
        "end_depth": _only(depths),
        "dish": _only(dishes),
        "knuckle": _only(knuckles),
        "tilt": _thousand(lying.tilt),
        "dip_position": _thousand(lying.dip_from_a_m),
        "tube_angle": lying.tube_angle_rad and float(np.degrees(lying.tube_angle_rad)),
        "tube_offset": _thousand(lying.tube_offset_m),
    }


def _only(values):
    """Value common to all entries; None if they differ or if there are none."""
    return values[0] if len(set(values)) == 1 else None


def _thousand(value):
    return None if value is None else 1000 * value


def deadwood_part(items, zero_m):
    """Declared deadwood as a part; heights are dips, and `zero_m` is the level of dip 0."""
    return deadwood(
        [item.name for item in items],
        [item.bottom_m + zero_m for item in items],
        [item.top_m + zero_m for item in items],
        [item.volume_m3 for item in items],
        [item.u_m3 for item in items],
    )


def as_surveyed(job, survey):
    """Job in the state of its surveyed wall (`Method.job_as_surveyed`)."""
    method = method_of(survey)
    return job if method is None else method.job_as_surveyed(job)


def filled_with(job, density_kg_m3):
    """Return the job with another liquid, which also supports the floating roof."""
    if density_kg_m3 is None:
        return job
    density = float(density_kg_m3)
    roof = job.roof and replace(job.roof, reference_density_kg_m3=density)
    return replace(job, table=replace(job.table, liquid_density_kg_m3=density), roof=roof)


def thermal_scale(job, switches):
    """Lengths at reference temperature over those of the survey; 1 if unknown or disabled."""
    if not is_warmed(job, switches):
        return 1.0
    warmer = job.table.reference_temperature_c - job.survey.shell_temperature_c
    return 1.0 + job.material.expansion_per_k * warmer


def is_warmed(job, switches):
    """Whether lengths are corrected for temperature: enabled, with a known shell temperature."""
    return switches.temperature and job.survey.shell_temperature_c is not None


def inside_end(end, diameter_m, plate_m, scale):
    """Inside of an end from its measured sizes; radii of a standard follow from the diameter."""
    measured = End(end.kind, end.depth_m, end.dish_radius_m, end.knuckle_radius_m)
    if end.standard is not None:
        measured = standard_end(measured, end.standard, diameter_m)
    lengths = (measured.depth_m, measured.dish_radius_m, measured.knuckle_radius_m)
    return End(end.kind, *(scale * (length - plate_m) if length else length for length in lengths))
