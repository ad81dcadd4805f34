"""Inputs of uncertainty.csv without an effect on the job, with the reasons."""

from tankcal.job.checking import has_rows, loads_sphere
from tankcal.job.checks.extent import (
    has_inside_sizes,
    has_wall_points,
    is_strapped,
    is_unsurveyed,
    may_be_seen_from_both_sides,
    wall_of,
)
from tankcal.job.contract import INPUTS
from tankcal.job.contract.bottom import SHAPED, bottom_form
from tankcal.job.contract.lying import RINGS_WITHOUT_TUBE, ROUND_TUBE
from tankcal.messages import message
from tankcal.methods.base import methods, methods_for

GIVEN = ("dish", "knuckle")
SIZES_OF_END = ("depth_m", "dish_radius_m", "knuckle_radius_m", "standard")
NO_SUCH_RADIUS = message(
    "no_such_radius", "expected only with a torispherical end that is given by this radius"
)
NOT_SUBTRACTED = message(
    "nothing_subtracted",
    "expected only with side = outside: with side = inside nothing is subtracted",
)

NO_HEAD = message("no_liquid_head", "expected only with a liquid head: table.liquid_density_kg_m3")
NO_SURVEY_LIQUID = message("no_survey_liquid", "expected only with survey.liquid_level_m above 0")


def useless_inputs(values, tables, kind):
    """Inputs of uncertainty without an effect on this job.

    Parameters
    ----------
    values : dict
        {section: {key: value}} of the settings; blank and invalid values count as not given.
    tables : dict of {str: ColumnValues or None}
        Tables by name.
    kind : str
        Kind of tank.

    Returns
    -------
    dict of {str: Message}
        Reason for each input.
    """
    others = {
        name: message("no_bearing", "it has no effect on a tank of kind {of_kind}", of_kind=kind)
        for name, known in INPUTS.items()
        if kind not in known.kinds
    }
    rules = explain_temperature(values, values["survey"]["shell_temperature_c"]) | {
        "deadwood": _explain_deadwood(values, tables["deadwood"])
    }
    if kind == "vertical":
        rules |= _explain_vertical(values, tables)
    elif kind == "horizontal":
        rules |= _explain_horizontal(values, tables)
    elif kind == "sphere":
        rules |= _explain_wall(values["sphere"], values, has_wall_points(tables))
        rules |= _explain_sphere(values)
    for method in methods_for(kind):
        if method.is_given(tables):
            rules |= method.useless_inputs(values, tables)
    return others | {name: why for name, why in rules.items() if why}


def _explain_switch(correction):
    return message("switched_off", "corrections.{correction} is false", correction=correction)


def explain_temperature(values, shell_temperature_c):
    """{input: reason}, with "" for an input that has an effect.

    All functions below return this form.
    """
    expands = shell_temperature_c is not None and values["corrections"]["temperature"] is not False
    why = (
        ""
        if expands
        else message("no_temperature_correction", "expected only with a temperature correction")
    )
    return {"shell_temperature": why, "expansion": why}


def _explain_deadwood(values, deadwood):
    if values["corrections"]["deadwood"] is False:
        return _explain_switch("deadwood")
    is_there = deadwood is not None and any(
        volume != 0 and u is None
        for volume, u in zip(deadwood.of("volume_m3"), deadwood.of("u_m3"), strict=True)
    )
    return (
        ""
        if is_there
        else message("no_vague_deadwood", "expected only with deadwood that has no u_m3 of its own")
    )


def _explain_vertical(values, tables):
    survey, switches = values["survey"], values["corrections"]
    head = values["table"]["liquid_density_kg_m3"] and switches["head"] is not False
    no_liquid = not survey["liquid_level_m"] or switches["head"] is False
    no_roof = values["roof"]["mass_kg"] is None or switches["roof"] is False
    of_points = message(
        "offset_of_points",
        "expected only with points: tapes and instruments of wall hits have their own in"
        " instruments.toml",
    )
    return _explain_plates(values, tables, head or not no_liquid) | {
        "offset": of_points if _has_own_offset(tables) else "",
        "course_heights": _explain_course_heights(tables["courses"], values),
        "youngs_modulus": NO_HEAD if not head and no_liquid else "",
        "liquid_density": "" if head else NO_HEAD,
        "survey_level": NO_SURVEY_LIQUID if no_liquid else "",
        "survey_density": NO_SURVEY_LIQUID if no_liquid else "",
        "bottom": _explain_bottom(values, tables["bottom"]),
        **_explain_heads(values, tables["bottom"]),
        "roof_mass": message("no_floating_roof", "expected only with a floating roof: [roof]")
        if no_roof
        else "",
        "tilt": _explain_switch("tilt") if switches["tilt"] is False else "",
    }


def _has_own_offset(tables):
    """Return True if no offset common to all radii affects the measurements of the wall."""
    return (
        any(method.has_own_offset and method.is_given(tables) for method in methods())
        or (is_strapped(tables) and not has_wall_points(tables))
        or is_unsurveyed(tables)
    )


def _explain_bottom(values, bottom):
    if values["corrections"]["bottom"] is False:
        return _explain_switch("bottom")
    return {
        "liquid": message("u_in_bottom", "expected u_m3 in bottom.csv instead"),
        "flat": message(
            "bottom_is_flat",
            "expected only with a bottom that is not flat: the height of a flat one is given "
            "by datum",
        ),
    }.get(bottom_form(values, bottom), "")


def _explain_heads(values, bottom):
    """Reasons for the dimensions of a shaped bottom and of a head on top."""
    form, top = bottom_form(values, bottom), values["top"]["form"]
    is_off = {part: values["corrections"][part] is False for part in ("bottom", "top")}
    heads = [
        {**values[part], "form": shape, "depth_m": values[part][key]}
        for part, shape, key in (("bottom", form, "centre_z_m"), ("top", top, "depth_m"))
        if shape == "torispherical" and not is_off[part]
    ]
    has_shaped_bottom = form in SHAPED and not is_off["bottom"]
    has_head = top is not None and not is_off["top"]
    return {
        **_explain_head_radii(heads),
        "bottom_depth": ""
        if has_shaped_bottom
        else message("no_shaped_bottom", "expected only with a bottom that is a cone or a head"),
        "top_depth": ""
        if has_head
        else message("no_top", "expected only with a head on the shell: [top]"),
    }


def _explain_plates(values, tables, is_loaded, table_name="courses"):
    """Reasons for the thickness of plates and paint.

    Plates have an effect if they are subtracted or loaded; paint, if it is subtracted. A tape lies
    on both even if the points are inside, and so do hits from outside.
    """
    switches, courses = values["corrections"], tables[table_name]
    outside_seen = is_strapped(tables) or may_be_seen_from_both_sides(tables)
    inside = (values["survey"]["side"] == "inside" and not outside_seen) or has_inside_sizes(tables)
    why = {"plate_thickness": "", "paint": ""}
    if (inside or switches["plate"] is False) and not is_loaded:
        why["plate_thickness"] = NOT_SUBTRACTED
    if inside or switches["paint"] is False:
        why["paint"] = NOT_SUBTRACTED
    if has_rows(courses) and not courses.skipped:
        for name, column in (("plate_thickness", "thickness_mm"), ("paint", "paint_mm")):
            if not why[name] and not any(courses.of(column)):
                why[name] = message(
                    "no_such_thickness",
                    "expected only with {column} above 0 in {table}.csv",
                    column=column,
                    table=table_name,
                )
    return why


def _explain_course_heights(courses, values):
    has_head = values["top"]["form"] is not None and values["corrections"]["top"] is not False
    single = not has_head and courses is not None and len(courses.rows) + courses.skipped == 1
    return message("only_one_course", "expected only with two courses or more") if single else ""


def _explain_horizontal(values, tables):
    given, no_tilt = values["horizontal"], values["corrections"]["tilt"] is False
    wall = wall_of(tables)
    has_points = wall == "points"
    leans = has_points or (given["tilt_mm_per_m"] and not no_tilt)
    all_flat = given["end_a"] == given["end_b"] == "flat"
    switched_off = _explain_switch("tilt") if no_tilt else ""
    sizes = _explain_rings(values, tables) if wall == "straps" else _explain_single_cylinder()
    ends = [{key: given[f"end_{end}_{key}"] for key in SIZES_OF_END} for end in "ab"]
    return (
        _explain_wall(given, values, has_points)
        | sizes
        | {
            "end_depth": message("ends_are_flat", "expected only with an end that is not flat")
            if all_flat
            else "",
            **_explain_head_radii(ends),
            **dict.fromkeys(("tube_angle", "tube_offset"), _explain_tube(given, wall)),
            "tilt": _explain_measured(has_points) or switched_off,
            "dip_position": ""
            if leans
            else message("does_not_lean", "expected only for a tank that leans"),
        }
    )


def _explain_single_cylinder():
    """Reasons for inputs of strapped rings, for a tank without rings."""
    no_rings = message("no_rings", "expected only with the rings of rings.csv")
    return dict.fromkeys(("paint", "ring_lengths", "ring_axes"), no_rings)


def _explain_rings(values, tables):
    """Reasons for the inputs of a cylinder with strapped rings."""
    by_tape = message("by_tape", "its uncertainty comes from the readings of the tape")
    is_single = "rings" in tables and has_rows(tables["rings"]) and len(tables["rings"].rows) == 1
    why = _explain_plates(values, tables, False, "rings")
    return why | {
        "diameter": by_tape,
        "offset": by_tape,
        "length": message("of_each_ring", "expected ring_lengths instead: each ring has its own"),
        "ring_lengths": "",
        "ring_axes": message("only_one_ring", "expected only with two rings or more")
        if is_single
        else "",
    }


def _explain_head_radii(heads):
    return {
        name: "" if any(_gives(name, head) for head in heads) else NO_SUCH_RADIUS for name in GIVEN
    }


def _gives(name, head):
    """Return True if a radius, "dish" or "knuckle", is among the given dimensions of a head."""
    by_standard = head["standard"] and (name == "knuckle" or not head["depth_m"])
    return bool(head[f"{name}_radius_m"] or by_standard)


def _explain_tube(given, wall):
    if wall == "straps":
        return RINGS_WITHOUT_TUBE
    if None in (given["width_m"], given["height_m"]):
        return ""
    return ROUND_TUBE


def _explain_wall(given, values, has_points):
    """Reasons for inputs of horizontal cylinders and spheres."""
    switched_off = values["corrections"]["plate"] is False
    is_subtracted = values["survey"]["side"] == "outside" and not switched_off
    not_subtracted = message(
        "no_plates",
        "expected only with side = outside and a thickness_mm: without them nothing is subtracted",
    )
    return {
        "diameter": _explain_measured(has_points),
        "offset": ""
        if has_points
        else message("no_points", "expected only with points; without points, declare diameter"),
        "plate_thickness": "" if is_subtracted and given["thickness_mm"] else not_subtracted,
    }


def _explain_sphere(values):
    """Reasons for inputs of the expansion of a sphere under load."""
    table, survey = values["table"], values["survey"]
    is_off = values["corrections"]["head"] is False
    liquid = (survey["liquid_density_kg_m3"] or 0) * (survey["liquid_level_m"] or 0)
    rules = {
        "youngs_modulus": loads_sphere(values)
        or message("no_load_of_sphere", "expected only with a pressure or a liquid that loads it"),
        "liquid_density": (table["liquid_density_kg_m3"] and not is_off) or NO_HEAD,
        "pressure": (table["pressure_bar"] and not is_off)
        or message("no_table_pressure", "expected only with table.pressure_bar above 0"),
        "survey_pressure": (survey["pressure_bar"] and not is_off)
        or message("no_survey_pressure", "expected only with survey.pressure_bar above 0"),
        **dict.fromkeys(
            ("survey_level", "survey_density"), (liquid and not is_off) or NO_SURVEY_LIQUID
        ),
    }
    reasons = {name: why for name, why in rules.items() if isinstance(why, str)}
    is_subtracted = (values["survey"]["side"] == "outside") and values["corrections"][
        "plate"
    ] is not False
    if loads_sphere(values) and values["sphere"]["thickness_mm"] and not is_subtracted:
        reasons["plate_thickness"] = ""  # the plate determines the expansion under load
    return reasons


def _explain_measured(has_points):
    return message("from_points", "its uncertainty comes from the points") if has_points else ""
