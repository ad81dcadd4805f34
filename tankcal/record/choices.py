"""The choices that a result names: what was assumed, each by a code and its value."""

import numpy as np

from tankcal.adjust import CRITICAL
from tankcal.methods.base import given_methods
from tankcal.record.liquid import geometry_beside
from tankcal.record.schema import Saved, key
from tankcal.record.table import zero_of

SIGHTS = {  # of a total station, a theodolite or a level: a tape beside photographs is none
    "direction", "horizontal angle", "vertical angle", "zenith angle", "azimuth",
    "height difference", "slope distance",
}  # fmt: skip


class Choice(Saved):
    """Something that was assumed; the sentence is the template's, in its language."""

    code: str = key("see below")
    value: str | float | bool | list | None = key("of the choice")


def choices_of(result):
    """The `Choice`s of a result: everything that was assumed."""
    job = result.job
    values = {
        "zero": zero_of(result),
        **(_shell_choices(job, result) if result.wall is not None else {}),
        **(_strapped_choices(job) if result.strapped is not None else {}),
        **_liquid_choices(result),
        **_radii_choices(result),
        **_choices_of_methods(result, ("vertical", "horizontal")),
        **({"form": "learned"} if result.scan is not None and job.horizontal is not None else {}),
        "thickness": _thickness_choice(job, result),
        "temperature": _temperature_choice(job),
        **_choices_of_methods(result, ("sphere",)),
        **_sphere_choices(job),
        "height_expansion": "yes" if job.table.height_expansion else "no",
        "head": _head_choice(job),
        "deadwood": _fitting_choice(job.switches.deadwood, job.deadwood),
        "interpolation": "linear",
        "coverage": job.table.coverage_probability,
        "k": "normal" if np.all(np.isinf(result.table.dof)) else "student",
        "expansion": "given" if job.material.expansion_given else "default",
        "not_in_budget": _not_in_budget(result),
    }
    if result.adjustment is not None:
        of_survey = _adjustment_values(result.adjustment, getattr(job, "measurements", None))
        values = of_survey | values
    return [Choice(*one) for one in values.items()]


def _not_in_budget(result):
    """Inputs without u, those of the table first, then what moves only corrections of a ship."""
    of_ship = () if result.ship is None else result.ship.undeclared
    return list(dict.fromkeys((*result.body.undeclared(), *of_ship)))


def adjustment_choices(adjustment, measurements):
    """Each `Choice` that was assumed when the survey was adjusted."""
    return [Choice(*one) for one in _adjustment_values(adjustment, measurements).items()]


def _adjustment_values(adjustment, measurements):
    settings = getattr(measurements, "settings", None)
    kinds = {group.kind for group in adjustment.groups}
    photographs = "image coordinate" in kinds
    others = kinds & SIGHTS
    test = "none"
    if adjustment.redundancy > 0:
        test = "passed" if adjustment.adjusted.test().passed else "failed"
    weights = getattr(settings, "image_weights", "measured")
    return {
        **({"image_weights": weights} if photographs else {}),
        "survey": "both" if photographs and others else "photographs" if photographs else "sights",
        "adjustment_datum": adjustment.datum.choice,
        "adjustment_snooping": CRITICAL if getattr(settings, "snooping", True) else "off",
        "adjustment_test": test,
        "adjustment_scale": getattr(settings, "scale", "a_priori"),
    }


def _shell_choices(job, result):
    """What was assumed about a shell of courses, and how its points were used."""
    wall = result.wall
    roof = job.roof and job.roof.weighing
    return {
        "bottom": _bottom_choice(job),
        **_measured_by(job, result),
        "course_of_points": "section" if any(job.points.section) else "height",
        "shape": "smoothed",
        "between_sections": "field",
        "tilt": _tilt_choice(job, wall.shell),
        "course_heights": "along_axis",
        **_top_choice(job),
        "roof": _fitting_choice(job.switches.roof, roof, roof),
        "snooping": CRITICAL if job.snooping else "off",
        "form": "learned",
        "covariance_sd_mm": 1000 * np.sqrt(np.median(wall.covariance_m2.diagonal())),
    }


def _measured_by(job, result):
    """How the points came about, and what is known of them."""
    found = {"covariance": _covariance_choice(job) if result.adjustment is None else "adjusted"}
    if job.clouds is not None:
        found = {"survey": "clouds", "covariance": "clouds"}
    for method in given_methods(job):
        found = method.choices(result)
    if result.straps is not None:
        found["straps"] = "beside_points"
    if job.lines is not None:
        found["lines"] = "beside_points"
    return found


def _strapped_choices(job):
    """What was assumed about a shell that a tape was put round."""
    roof = job.roof and job.roof.weighing
    return {
        "bottom": _bottom_choice(job),
        "survey": "strapping" if job.lines is None else "reference_line",
        "area_term": _area_term_choice(job.strapping.shape_sd_m),
        **_top_choice(job),
        "between_sections": "cylinders" if job.lines is None else "revolution",
        "tilt": "not_measured" if job.lines is None else "not_applied",
        "course_heights": "along_axis",
        "roof": _fitting_choice(job.switches.roof, roof, roof),
        "form": "learned",
    }


def _area_term_choice(shape_sd_m):
    if shape_sd_m is None:
        return "assumed"
    return "none" if shape_sd_m == 0 else 1000 * shape_sd_m


def _choices_of_methods(result, kinds):
    """Assumptions of the methods of a job, if its tank is of these kinds.

    A record of a sphere has them at another place than the records of other tanks.
    """
    choices = {}
    for method in given_methods(result.job) if result.job.tank.kind in kinds else ():
        choices |= method.choices(result)
    return choices


def _sphere_choices(job):
    """Pressure of the table of a sphere, bar."""
    if job.sphere is not None and job.switches.head and job.table.pressure_pa:
        return {"pressure": job.table.pressure_pa / 1e5}
    return {}


def _liquid_choices(result):
    """Whose table is printed where liquid was metered, and what stood beside the liquid."""
    if result.liquid is None:
        return {}
    job, beside = result.job, geometry_beside(result)
    found = {"liquid": result.liquid.certified, "liquid_beside": beside}
    if beside == "drawing":
        roof = job.roof and job.roof.weighing
        found |= {
            "bottom": _bottom_choice(job),
            **_top_choice(job),
            "tilt": "not_measured",
            "course_heights": "along_axis",
            "roof": _fitting_choice(job.switches.roof, roof, roof),
        }
    return found


def _radii_choices(result):
    """Where the radii of the courses come from."""
    if result.radii is None:
        return {}
    job = result.job
    roof = job.roof and job.roof.weighing
    return {
        "bottom": _bottom_choice(job),
        **_top_choice(job),
        "radii": job.radii.source,
        "radii_beside": "none" if result.radii.updated is None else "survey",
        "between_sections": "radii",
        "tilt": "not_known",
        "course_heights": "along_axis",
        "roof": _fitting_choice(job.switches.roof, roof, roof),
    }


def _bottom_choice(job):
    return job.bottom.form if job.switches.bottom else "off"


def _top_choice(job):
    """The head on top; nothing is said of a tank without one."""
    return {} if job.top is None else {"top": job.top.form if job.switches.top else "off"}


def _tilt_choice(job, shell):
    if not shell.tilt_known:
        return "not_determined"
    return "horizontal_cut" if job.switches.tilt else "off"


def _temperature_choice(job):
    if job.radii is not None:
        return _temperature_of_radii(job)
    if job.survey.shell_temperature_c is None:
        return "not_applied"
    return "applied" if job.switches.temperature else "off"


def _temperature_of_radii(job):
    if job.radii.temperature_c == job.table.reference_temperature_c:
        return "radii_as_they_are"
    return "radii_applied" if job.switches.temperature else "off"


def _head_choice(job):
    """Density that the table is loaded for; "unloaded" when only the survey's was taken off."""
    if not job.switches.head:
        return "off"
    if job.table.liquid_density_kg_m3:
        return job.table.liquid_density_kg_m3
    loaded = job.survey.liquid_density_kg_m3 and job.radii is None
    return "unloaded" if loaded else "none"


def _fitting_choice(switched_on, given, applied="declared"):
    if not given:
        return "none"
    return applied if switched_on else "off"


def _covariance_choice(job):
    if job.points.sd_m is None and job.points.covariance_m2 is None:
        return "estimated"
    given = "given_sd" if job.points.covariance_m2 is None else "given_full"
    return given + "_scaled" if job.scale == "a_posteriori" else given


def _thickness_choice(job, result):
    if result.liquid is not None and geometry_beside(result) == "drawing":
        return "drawing"
    if result.radii is not None:
        return "radii"
    if job.survey.side == "inside":
        return "inside"
    solid = job.horizontal or job.sphere
    parts = job.courses or job.rings
    given = any(c.thickness_m + c.paint_m for c in parts) or (solid and solid.thickness_m)
    if not given:
        return "none"
    return "subtracted" if job.switches.plate and job.switches.paint else "off"
