"""Checks of the input of a plan: names, combinations of keys, standard deviations, units."""

import numpy as np

from tankcal.job.checking import is_not_given, refuse_repeated, tell, tiny_sd
from tankcal.job.checks.survey.doubtful import TINY
from tankcal.job.tables import nearest
from tankcal.messages import message
from tankcal.pipeline.wall_warnings import ADVISED_POINTS, FEWEST_POINTS
from tankcal.planning.entries import PLAN_FILE, check_form, no_such_name
from tankcal.planning.obstacles import check_obstacles

UNFIT = {  # kinds of instruments that a section cannot use
    "setup_rings": ("tape", "level", "stadia"),
    "tapes": ("total_station", "theodolite", "level", "stadia"),
}
LOOSE = 0.05  # U over volume; a larger limit is suspected to be in percent
UNITS_OF_SDS = {
    "photo_rings": {"s_um": "um"},
    "tapes": {"s_mm": "mm"},
    "setup_rings": {"s_direction_arcsec": "arcsec", "s_zenith_arcsec": "arcsec", "s_mm": "mm"},
}
_NAMED = {
    "tape": message("plan_named_tape", "tape"),
    "level": message("plan_named_level", "level"),
    "total_station": message("plan_named_total_station", "total station"),
    "theodolite": message("plan_named_theodolite", "theodolite"),
    "stadia": message("plan_named_stadia", "stadia"),
}


def check_input(values, registers, plan_input, raw, log):
    """Check that names are defined, combinations of keys are valid, and not all sds are zero.

    Parameters
    ----------
    values : dict or None
        {section: {key: value}} of the settings of the job; None if unreadable.
    registers : dict
        {register: {name: values}} of cameras and instruments.
    plan_input : PlanInput
    raw : RawJob
        Content of the plan's folder.
    log : Log
    """
    for section, key, register in (
        ("photo_rings", "camera", "cameras"),
        ("setup_rings", "instrument", "instruments"),
        ("tapes", "instrument", "instruments"),
    ):
        known = registers[register]
        for entry in plan_input.sections[section]:
            if entry[key] is not None and entry[key] not in known:
                hint = nearest(entry[key], known)
                entry.report(log.problem, key, no_such_name(entry[key], f"{register}.toml", hint))
    _check_kinds(registers["instruments"], plan_input, log)
    _check_pattern(plan_input.sections["pattern"], log)
    for section in ("photo_rings", "setup_rings"):
        for ring in plan_input.sections[section]:
            if len(ring.filled_keys & {"distance_m", "radius_m"}) != 1:
                expected = message(
                    "plan_one_radius",
                    "expected one of distance_m (from the wall) and radius_m (from the axis)",
                )
                ring.report(log.problem, "distance_m", expected)
    check_obstacles(plan_input, log)
    _check_tapes(plan_input, log)
    _check_tables(plan_input, log)
    _check_accuracies(values, plan_input, raw, log)
    _warn_of_units(plan_input, raw, values, log)


def _check_kinds(instruments, plan_input, log):
    """Check that set-ups use total stations and tapes use tapes."""
    for section, unfit in UNFIT.items():
        for entry in plan_input.sections[section]:
            kind = (instruments.get(entry["instrument"]) or {}).get("kind")
            if kind in unfit:
                fit = message("plan_total_station", "a total station or a theodolite")
                if section == "tapes":
                    fit = message("plan_a_tape", "a tape")
                expected = message(
                    "plan_unfit_instrument",
                    "{instrument} is a {named}; expected {fit}",
                    instrument=entry["instrument"],
                    named=_NAMED[kind],
                    fit=fit,
                )
                entry.report(log.problem, "instrument", expected)


def _check_pattern(pattern, log):
    """Check a pattern: enough lines for a section, heights or levels, common form within form."""
    lines = pattern["generatrices"]
    if lines in range(FEWEST_POINTS):
        expected = message(
            "plan_few_lines",
            "found {lines:g} points in each section of the wall; expected at least {fewest} "
            "({advised} or more are advised)",
            lines=lines,
            fewest=FEWEST_POINTS,
            advised=ADVISED_POINTS,
        )
        pattern.report(log.problem, "generatrices", expected)
    if {"levels", "heights_m"} <= pattern.filled_keys:
        expected = message(
            "plan_levels_or_heights", "given together with heights_m; expected one of the two"
        )
        pattern.report(log.problem, "levels", expected)
    check_form(pattern, log)


def _check_tapes(plan_input, log):
    seen = set()
    for entry in plan_input.sections["tapes"]:
        if entry["name"] in seen:
            expected = message(
                "plan_tape_twice", "found {found!r} again; expected it once", found=entry["name"]
            )
            entry.report(log.problem, "name", expected)
        seen.add(entry["name"])


def _check_tables(plan_input, log):
    """Check that ties connect two points, and that control points are unique and in one frame."""
    for table in plan_input.ties.values():
        if table is None:
            continue
        for row, start, end in zip(table.rows, table.of("from"), table.of("to"), strict=True):
            if start is not None and start == end:
                expected = message(
                    "plan_tie_to_itself",
                    "found {end!r} on both sides; expected two points",
                    end=end,
                )
                log.problem(table.file, expected, row, "to")
    control = plan_input.control
    if control is not None:
        refuse_repeated(control, "point", log)
        for row, system in zip(control.rows, control.of("system"), strict=True):
            if system is not None:
                expected = message(
                    "plan_own_frame",
                    "found {system!r}; expected a blank: a plan is in the frame of the survey",
                    system=system,
                )
                log.problem(control.file, expected, row, "system")


def _check_accuracies(values, plan_input, raw, log):
    """Check that each ring states its precision, and that not all readings are exact."""
    has_common = values is None or not is_not_given(raw, "adjustment", "image_sd_um")
    for entry in plan_input.sections["photo_rings"]:
        if "s_um" not in entry.filled_keys and not has_common:
            expected = message(
                "plan_image_sd_missing", "missing; expected s_um here, or adjustment.image_sd_um"
            )
            entry.report(log.problem, "s_um", expected)
        elif entry["s_um"] == 0:
            expected = message(
                "plan_exact_image",
                "found 0; an image point cannot be exact: expected micrometres above 0",
            )
            entry.report(log.problem, "s_um", expected)
    keys = ("s_direction_arcsec", "s_zenith_arcsec", "s_mm")
    for ring in plan_input.sections["setup_rings"]:
        if not ring.filled_keys & {*keys}:
            expected = message(
                "plan_measures_nothing",
                "measures nothing; expected at least one of {keys}",
                keys=", ".join(keys),
            )
            log.problem(PLAN_FILE, expected, ring.row, ring.name)
        elif not any(ring[key] or ring.is_refused(key) for key in keys):
            expected = message(
                "plan_ring_exact",
                "an accuracy of zero for everything: expected standard deviations above 0",
            )
            log.problem(PLAN_FILE, expected, ring.row, ring.name)
        if "s_mm" in ring.filled_keys and "s_zenith_arcsec" not in ring.filled_keys:
            expected = message(
                "plan_zenith_missing",
                "missing; expected zenith angles together with slope distances (s_mm)",
            )
            ring.report(log.problem, "s_zenith_arcsec", expected)


def _warn_of_units(plan_input, raw, values, log):
    """Warn of tiny standard deviations, and of a limit that looks like percent."""
    common = None if values is None else values["adjustment"]["image_sd_um"]
    if common and common < TINY["um"]:
        tell(log.warning, raw, "adjustment", "image_sd_um", tiny_sd("um", common))
    for section, units in UNITS_OF_SDS.items():
        for entry in plan_input.sections[section]:
            for key, unit in units.items():
                if entry[key] and entry[key] < TINY[unit]:
                    entry.report(log.warning, key, tiny_sd(unit, entry[key]))
    for table in (*plan_input.ties.values(), plan_input.stadia):
        unit = "arcsec" if table is plan_input.stadia else "mm"
        sds = np.empty(0) if table is None else table.numbers(f"s_{unit}")
        if (sds > 0).any() and sds[sds > 0].max() < TINY[unit]:
            log.warning(table.file, tiny_sd(unit, sds[sds > 0].max()), None, f"s_{unit}")
    limit = plan_input.sections["limits"]
    if (limit["relative_u"] or 0.0) > LOOSE:
        text = message(
            "plan_limit_loose",
            "found {share:g}, which is {percent:.3g} % of the volume: is it given in "
            "percent? 0.2 % is 0.002",
            share=limit["relative_u"],
            percent=100 * limit["relative_u"],
        )
        limit.report(log.warning, "relative_u", text)
