"""uncertainty.csv: each input once, in its own unit, of a credible size, and of use here."""

from tankcal.job.checks.bottom import bottom_form
from tankcal.job.checks.common import has_wall_points, loads_the_shell, refuse_repeated
from tankcal.job.contract import INPUTS


def check_inputs(inputs, values, tables, kind, log):
    """Each input once, in its own unit, of a credible size, and of use for this job."""
    refuse_repeated(inputs, "input", log)
    useless = {} if values is None or kind is None else _useless(values, tables, kind)
    given = zip(inputs.rows, inputs.of("input"), inputs.of("u"), inputs.of("unit"), strict=True)
    for row, name, u, unit in given:
        if name in useless:
            log.problem(inputs.file, f"found {name}; {useless[name]}", row, "input")
        if None in (name, u, unit):
            continue
        known = INPUTS[name]
        if unit != known.unit:
            expected = f"found {unit!r}; expected {known.unit!r} for {name}"
            log.problem(inputs.file, expected, row, "unit")
        elif u > known.largest:
            expected = f"found {u:g} {unit} for {name}; expected at most {known.largest:g} {unit}"
            log.problem(inputs.file, expected, row, "u")


def _useless(values, tables, kind):
    """{name of an input without any effect on this job: why}."""
    useless = {
        name: f"it has no bearing on a tank of kind {kind}"
        for name, known in INPUTS.items()
        if kind not in known.kinds
    }
    survey, switches = values["survey"], values["corrections"]
    expands = survey["shell_temperature_c"] is not None and switches["temperature"] is not False
    rules = {"expansion": "" if expands else "expected only with a temperature correction"}
    if kind == "vertical":
        rules |= _rules_of_vertical(values, tables)
    elif kind == "horizontal":
        rules |= _rules_of_horizontal(values, tables)
    elif kind == "sphere":
        rules |= _rules_of_wall(values["sphere"], values, has_wall_points(tables))
    return useless | {name: why for name, why in rules.items() if why}


def _rules_of_vertical(values, tables):
    """{input: "" or why it has no effect}."""
    survey, switches = values["survey"], values["corrections"]
    inside = survey["side"] == "inside"
    head = loads_the_shell(values)
    no_liquid = not survey["liquid_level_m"] or switches["head"] is False
    no_head = "expected only with a liquid head: a density in [table]"
    no_survey_liquid = "expected only with survey.liquid_level_m above 0"
    not_subtracted = "expected only with side = outside: nothing is subtracted"
    no_plate = inside or switches["plate"] is False
    no_roof = values["roof"]["mass_kg"] is None or switches["roof"] is False
    is_measured = bottom_form(values, tables["bottom"]) == "liquid"
    return {
        "plate_thickness": not_subtracted if no_plate and no_liquid and not head else "",
        "paint": not_subtracted if inside or switches["paint"] is False else "",
        "youngs_modulus": no_head if not head and no_liquid else "",
        "liquid_density": "" if head else no_head,
        "survey_level": no_survey_liquid if no_liquid else "",
        "survey_density": no_survey_liquid if no_liquid else "",
        "bottom": "expected u_m3 in bottom.csv instead" if is_measured else "",
        "roof_mass": "expected only with a floating roof: [roof]" if no_roof else "",
    }


def _rules_of_horizontal(values, tables):
    given, has_points = values["horizontal"], has_wall_points(tables)
    leans = has_points or (given["tilt_mm_per_m"] and values["corrections"]["tilt"] is not False)
    all_flat = given["end_a"] == given["end_b"] == "flat"
    switched_off = values["corrections"]["tilt"] is False
    return _rules_of_wall(given, values, has_points) | {
        "end_depth": "expected only with an end that is not flat" if all_flat else "",
        "tilt": _from_points(has_points) or ("corrections.tilt is false" if switched_off else ""),
        "dip_position": "" if leans else "expected only for a tank that leans",
    }


def _rules_of_wall(given, values, has_points):
    """What horizontal cylinders and spheres share."""
    switched_off = values["corrections"]["plate"] is False
    outside = values["survey"]["side"] == "outside" and not switched_off
    nothing = "expected only with side = outside and a thickness_mm: nothing is subtracted"
    return {
        "diameter": _from_points(has_points),
        "plate_thickness": "" if outside and given["thickness_mm"] else nothing,
    }


def _from_points(has_points):
    return "it comes from the points, with their uncertainty" if has_points else ""
