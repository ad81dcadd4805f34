"""Choices of a result: its assumptions, each as a code with a value."""

import numpy as np

from tankcal.adjust import CRITICAL
from tankcal.methods.base import accompanying_methods, given_methods
from tankcal.pipeline.table import undeclared_inputs
from tankcal.pipeline.tanks import as_surveyed
from tankcal.record.schema import Saved, key
from tankcal.record.table import zero_of

SIGHTS = {  # kinds of readings of instruments; a tape used with photographs is no sight
    "direction", "horizontal angle", "vertical angle", "zenith angle", "azimuth",
    "height difference", "slope distance",
}  # fmt: skip
_OF_EVERY_TANK = ("thickness", "temperature")


class Choice(Saved):
    """An assumption; the template supplies the sentence in its language."""

    code: str = key("see below")
    value: str | float | bool | list | None = key("of the choice")


def choices_of(result):
    """Return the `Choice`s of a result: all its assumptions."""
    job, survey = result.job, next(iter(result.surveys.values()), None)
    of_methods, of_solids = {}, {}
    is_early = job.tank.kind in ("vertical", "horizontal")
    for method in given_methods(job):
        # A record of a sphere has the choices on its survey after those on its temperature.
        choices = of_methods if is_early or method.is_supplement else of_solids
        choices |= method.choices(result)
    # A record states these choices after those on the wall.
    later = {code: of_methods.pop(code) for code in _OF_EVERY_TANK if code in of_methods}
    values = {
        "zero": zero_of(result),
        **(_shell_choices(job, result) if result.wall is not None else {}),
        **of_methods,
        **({"form": "learned"} if result.scan is not None and job.horizontal is not None else {}),
        "thickness": _thickness_choice(job, result),
        "temperature": _temperature_choice(job),
        **of_solids,
        **_sphere_choices(job),
        "height_expansion": "yes" if job.table.height_expansion else "no",
        "head": _head_choice(as_surveyed(job, survey)),
        "deadwood": _switch_choice(job.switches.deadwood, job.deadwood),
        "interpolation": "linear",
        "coverage": job.table.coverage_probability,
        "k": "normal" if np.all(np.isinf(result.table.dof)) else "student",
        "expansion": "given" if job.material.expansion_given else "default",
        "not_in_budget": list(undeclared_inputs(job, survey, result.body)),
    } | later
    if result.adjustment is not None:
        adjustment = _adjustment_values(result.adjustment, getattr(job, "measurements", None))
        values = adjustment | values
    return [Choice(*choice) for choice in values.items()]


def adjustment_choices(adjustment, measurements):
    """Return the `Choice`s of an adjustment of a survey."""
    return [Choice(*choice) for choice in _adjustment_values(adjustment, measurements).items()]


def _adjustment_values(adjustment, measurements):
    settings = getattr(measurements, "settings", None)
    kinds = {group.kind for group in adjustment.groups}
    photographs = "image coordinate" in kinds
    sights = kinds & SIGHTS
    test = "none"
    if adjustment.redundancy > 0:
        test = "passed" if adjustment.adjusted.test().passed else "failed"
    weights = getattr(settings, "image_weights", "measured")
    return {
        **({"image_weights": weights} if photographs else {}),
        "survey": "both" if photographs and sights else "photographs" if photographs else "sights",
        "adjustment_datum": adjustment.datum.choice,
        "adjustment_snooping": CRITICAL if getattr(settings, "snooping", True) else "off",
        "adjustment_test": test,
        "adjustment_scale": getattr(settings, "scale", "a_priori"),
    }


# ---- choices of each kind of wall


def _shell_choices(job, result):
    """Return the choices on a shell with surveyed points, and on the use of its points."""
    wall = result.wall
    return {
        "bottom": bottom_choice(job),
        **_survey_choices(job, result),
        "course_of_points": "section" if any(job.points.section) else "height",
        "shape": "smoothed",
        "between_sections": "field",
        "tilt": _tilt_choice(job, wall.shell),
        "course_heights": "along_axis",
        **top_choice(job),
        "roof": roof_choice(job),
        "snooping": CRITICAL if job.snooping else "off",
        "form": "learned",
        "covariance_sd_mm": 1000 * np.sqrt(np.median(wall.covariance_m2.diagonal())),
    }


def _survey_choices(job, result):
    """Return the choices on the origin of the points and of their covariance."""
    choices = {"covariance": _covariance_choice(job) if result.adjustment is None else "adjusted"}
    for method in given_methods(job):
        choices = method.choices(result) if method.is_sighted else choices
    for method in accompanying_methods(job):
        choices |= method.choices(result)
    return choices


def _sphere_choices(job):
    """Pressure of the table of a sphere, bar."""
    if job.sphere is not None and job.switches.head and job.table.pressure_pa:
        return {"pressure": job.table.pressure_pa / 1e5}
    return {}


# ---- single choices


def bottom_choice(job):
    """Form of the bottom of an upright tank; "off" if it is not corrected."""
    return job.bottom.form if job.switches.bottom else "off"


def top_choice(job):
    """Return the choice on the head on top; {} without head."""
    return {} if job.top is None else {"top": job.top.form if job.switches.top else "off"}


def roof_choice(job):
    """Weighing of a floating roof; "off" or "none" without a correction."""
    weighing = job.roof and job.roof.weighing
    return _switch_choice(job.switches.roof, weighing, weighing)


def _tilt_choice(job, shell):
    if not shell.tilt_known:
        return "not_determined"
    return "horizontal_cut" if job.switches.tilt else "off"


def _temperature_choice(job):
    if job.survey.shell_temperature_c is None:
        return "not_applied"
    return "applied" if job.switches.temperature else "off"


def _head_choice(job):
    """Return the density of the liquid of the table; "unloaded": only that of the survey."""
    if not job.switches.head:
        return "off"
    if job.table.liquid_density_kg_m3:
        return job.table.liquid_density_kg_m3
    return "unloaded" if job.survey.liquid_density_kg_m3 else "none"


def _switch_choice(is_on, declared, value="declared"):
    """Return `value`, "off" if the correction is off, or "none" if nothing is declared."""
    if not declared:
        return "none"
    return value if is_on else "off"


def _covariance_choice(job):
    if job.points.sd_m is None and job.points.covariance_m2 is None:
        return "estimated"
    code = "given_sd" if job.points.covariance_m2 is None else "given_full"
    return code + "_scaled" if job.scale == "a_posteriori" else code


def _thickness_choice(job, result):
    if job.survey.side == "inside":
        is_surveyed = any(not method.is_supplement for method in given_methods(job))
        return "inside" if is_surveyed or job.courses else "dimensions"
    solid = job.horizontal or job.sphere
    parts = job.courses or job.rings
    has_thickness = any(c.thickness_m + c.paint_m for c in parts) or (solid and solid.thickness_m)
    if not has_thickness:
        return "none"
    return "subtracted" if job.switches.plate and job.switches.paint else "off"
