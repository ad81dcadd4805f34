"""A job with one of its inputs moved: what the volume does then is its own answer, not a slope."""

from dataclasses import replace

VARIED = (
    "plate_thickness",
    "paint",
    "shell_temperature",
    "expansion",
    "youngs_modulus",
    "liquid_density",
    "survey_level",
    "survey_density",
    "diameter",
    "length",
    "end_depth",
    "tilt",
    "dip_position",
)


def varied(job, name, change):
    """The job with `change` (SI) added to the input `name`, one of VARIED; None: it has none."""
    if name in _OF_VALUES:
        part, key = _OF_VALUES[name]
        return _with(job, part, key, change)
    if name in ("plate_thickness", "paint") and job.courses:
        key = {"plate_thickness": "thickness_m", "paint": "paint_m"}[name]
        courses = (replace(one, **{key: getattr(one, key) + change}) for one in job.courses)
        return replace(job, courses=tuple(courses))
    if job.points is not None:
        return None if name != "plate_thickness" else _of_solid(job, name, change)
    return _of_solid(job, name, change)


_OF_VALUES = {
    "shell_temperature": ("survey", "shell_temperature_c"),
    "expansion": ("material", "expansion_per_k"),
    "youngs_modulus": ("material", "e_pa"),
    "liquid_density": ("table", "liquid_density_kg_m3"),
    "survey_level": ("survey", "liquid_level_m"),
    "survey_density": ("survey", "liquid_density_kg_m3"),
}


def _of_solid(job, name, change):
    if job.sphere is not None:
        key = {"diameter": "diameter_m", "plate_thickness": "thickness_m"}.get(name)
        return None if key is None else _with(job, "sphere", key, change)
    if job.horizontal is None:
        return None
    lying = job.horizontal
    if name == "diameter":
        wider = replace(lying, width_m=lying.width_m + change, height_m=lying.height_m + change)
        return replace(job, horizontal=wider)
    if name == "end_depth":
        ends = {key: _deeper(getattr(lying, key), change) for key in ("end_a", "end_b")}
        return None if None in ends.values() else replace(job, horizontal=replace(lying, **ends))
    keys = {
        "plate_thickness": "thickness_m",
        "length": "length_m",
        "tilt": "tilt",
        "dip_position": "dip_from_a_m",
    }
    return _with(job, "horizontal", keys[name], change) if name in keys else None


def _deeper(end, change):
    """The end with another depth; None for a torispherical one, whose radii give its depth."""
    if end.kind == "flat":
        return end
    return replace(end, depth_m=end.depth_m + change) if end.depth_m else None


def _with(job, part, key, change):
    whole = getattr(job, part)
    if getattr(whole, key) is None:
        return None
    return replace(job, **{part: replace(whole, **{key: getattr(whole, key) + change})})
