"""What tanks of every kind have: what no reading saw, inputs, deadwood, and a temperature."""

from dataclasses import replace

import numpy as np

from tankcal.tank.factors import Factor
from tankcal.tank.fittings import deadwood
from tankcal.tank.heads import End, standard_end
from tankcal.uncertainty import factor_of

LEARNED, HALF_LEARNED = 0.1, 0.5  # share of a variance's logarithm that is assumed, at most


def factor_of_unseen(kind, parts, sizes, assumed):
    """`Factor` of what no reading saw of some components of one kind.

    parts    (f, f) covariance by each of them
    sizes    (k,) how much of the doubt each is
    assumed  (k,) share of each amplitude that is assumed
    """
    sizes = np.maximum(sizes, 1e-30)
    known = told_by(float(sizes @ assumed / sizes.sum()))
    by = "B" if known == "assumed" else "A"
    return Factor(kind, factor_of(sum(parts)), type=by, note=known)


def told_by(assumed):
    """Code of how an amplitude is known, by the share of it that is assumed."""
    if assumed < LEARNED:
        return "learned"
    return "half_learned" if assumed < HALF_LEARNED else "assumed"


def estimates_of(job):
    """{name of an input: its value as declared}; 0 of a scale, an offset and the like.

    The temperature is that of the shell, deg C. Without a value: plates or paint that differ from
    course to course, and what the job does not give.
    """
    survey, table, material = job.survey, job.table, job.material
    given = {
        **dict.fromkeys(("scale", "datum", "offset", "bottom", "barrel", "taper", "deadwood"), 0.0),
        "surface": 0.0,
        "plate_thickness": _only([1000 * part.thickness_m for part in job.courses or job.rings]),
        "paint": _only([1000 * part.paint_m for part in job.courses or job.rings]),
        "shell_temperature": survey.shell_temperature_c,
        "expansion": material.expansion_per_k,
        "youngs_modulus": material.e_pa / 1e9,
        "liquid_density": table.liquid_density_kg_m3,
        "survey_level": _thousand(survey.liquid_level_m),
        "survey_density": survey.liquid_density_kg_m3,
        "roof_mass": job.roof and job.roof.mass_kg,
        **_of_solid(job),
        **_of_ship(job),
        **_of_heads(job),
    }
    return {name: value for name, value in given.items() if value is not None}


def _of_heads(job):
    """Sizes of the bottom of an upright tank, and of the head on it, as they were given."""
    if job.tank.kind != "vertical":
        return {}
    centre, top = job.bottom.centre_z_m, job.top
    heads = [one for one in (job.bottom, top) if one is not None]
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


def _of_solid(job):
    """Sizes of a lying cylinder or a sphere."""
    lying, solid = job.horizontal, job.horizontal or job.sphere
    if solid is None:
        return {}
    plate = {} if job.rings else {"plate_thickness": 1000 * solid.thickness_m}
    if lying is None:
        return {**plate, "diameter": _thousand(solid.diameter_m)}
    round_m = lying.width_m if lying.width_m == lying.height_m else None
    ends = (lying.end_a, lying.end_b)
    depths, dishes, knuckles = (
        [1000 * getattr(end, key) for end in ends if getattr(end, key)]
        for key in ("depth_m", "dish_radius_m", "knuckle_radius_m")
    )
    return {
        **plate,
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


def _of_ship(job):
    """Even keel, the pipe's place in the ship's frame as the mesh has it, and a contraction."""
    if job.ship is None:
        return {}
    share = job.ship.contraction
    return {
        **dict.fromkeys(("trim", "list", "pipe_x", "pipe_y", "pipe_lean"), 0.0),
        "contraction": None if share is None else 100 * share,
    }


def _only(values):
    """The value that all have; None where they differ, or there are none."""
    return values[0] if len(set(values)) == 1 else None


def _thousand(value):
    return None if value is None else 1000 * value


def deadwood_part(items, zero_m):
    """The declared deadwood as a part; its heights are dips, zero_m the level of dip 0."""
    return deadwood(
        [item.name for item in items],
        [item.bottom_m + zero_m for item in items],
        [item.top_m + zero_m for item in items],
        [item.volume_m3 for item in items],
        [item.u_m3 for item in items],
    )


def as_declared(job):
    """A job of declared radii as these are: inside, the shell empty, at their temperature.

    Any other job as it is. What was surveyed beside the radii is in them already.
    """
    if job.radii is None:
        return job
    temperature = job.radii.temperature_c
    if temperature == job.table.reference_temperature_c:
        temperature = None
    survey = replace(
        job.survey,
        side="inside",
        shell_temperature_c=temperature,
        liquid_level_m=None,
        liquid_density_kg_m3=None,
    )
    return replace(job, survey=survey)


def thermal_scale(job, switches):
    """Lengths at reference temperature over those of the survey; 1 if not known or not on."""
    if not is_warmed(job, switches):
        return 1.0
    warmer = job.table.reference_temperature_c - job.survey.shell_temperature_c
    return 1.0 + job.material.expansion_per_k * warmer


def is_warmed(job, switches):
    return switches.temperature and job.survey.shell_temperature_c is not None


def inside_end(end, diameter_m, plate_m, scale):
    """The inside of an end, from what was measured; radii of a standard follow the diameter."""
    measured = End(end.kind, end.depth_m, end.dish_radius_m, end.knuckle_radius_m)
    if end.standard is not None:
        measured = standard_end(measured, end.standard, diameter_m)
    lengths = (measured.depth_m, measured.dish_radius_m, measured.knuckle_radius_m)
    return End(end.kind, *(scale * (length - plate_m) if length else length for length in lengths))
