"""Read a plan from its folder and check it; report all problems at once.

The checks concern names, combinations of keys, standard deviations and units.
"""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np

from tankcal.job.assembly import Attached, make_job
from tankcal.job.checking import has_rows, is_not_given, refuse_repeated, tell, tiny_sd
from tankcal.job.checks import check_tank
from tankcal.job.checks.survey.cameras import check_cameras
from tankcal.job.checks.survey.doubtful import TINY
from tankcal.job.checks.survey.readings import SurveyFiles, bars_of, check_bars, check_instruments
from tankcal.job.contract import KEYS
from tankcal.job.entries import (
    ColumnValues,
    kind_of,
    read_columns,
    read_register,
    read_setting,
    read_settings,
    unknown_section,
)
from tankcal.job.fields import is_blank
from tankcal.job.folder import (
    MAX_SETTINGS_BYTES,
    declared_marks,
    decode,
    flattened,
    parsed_toml,
    read_csv,
    saved_file_in,
)
from tankcal.job.folder import read_register as read_register_file
from tankcal.job.measuring import make_measurements
from tankcal.job.rule_files import find_rule
from tankcal.job.tables import (
    REGISTERS,
    Log,
    RawJob,
    Value,
    fingerprint,
    meant,
    nearest,
    read_beside,
)
from tankcal.job.tables import TABLES as JOB_FILES
from tankcal.messages import message
from tankcal.pipeline.checks.wall import ADVISED_POINTS, FEWEST_POINTS
from tankcal.planning.assembly import assemble_plan, limits_of
from tankcal.planning.contract import (
    JOB_TABLES,
    PLAN_FILE,
    REPEATED,
    SINGLE,
    TABLES,
    WALL_SECTIONS,
    WALL_TABLES,
    Count,
    Entry,
    PlanInput,
    check_form,
    no_such_name,
)
from tankcal.planning.places import check_obstacles
from tankcal.planning.position_checks import check_positions
from tankcal.planning.wall.reading import check_sections, is_wall_plan, wall_plan_of
from tankcal.text.naming import NUMBER

OF_LIQUID = ("horizontal", "sphere")  # kinds of tank that a plan may measure by liquid only
# Placeholder of a table with one row, so that the checks of a job see a survey with readings.
NO_IMAGE_POINTS = {"image_points": ColumnValues("image_points.csv", (1,), 0, {})}
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


def load_plan(path):
    """Read the plan in a folder, or in the folder of a plan.toml.

    Parameters
    ----------
    path : path
        The folder or the file.

    Returns
    -------
    Plan or WallPlan

    Raises
    ------
    InputError
        With every problem of the input, each with its file, row and column.
    """
    log = Log()
    folder = _folder(Path(path), log)
    log.stop_if_problems()
    raw, plan_input = _read(folder, log)
    values = read_settings(raw, log)
    _check_kind(raw, plan_input, log)
    registers = {name: read_register(raw, name, log) for name in REGISTERS}
    tables = _job_tables(raw, log)
    plan_input = replace(plan_input, control=tables["control"])
    if plan_input.is_wall:
        return _wall_plan(raw, values, tables, plan_input, folder, log)
    _check(raw, values, tables | plan_input.ties | NO_IMAGE_POINTS, registers, plan_input, log)
    log.stop_if_problems()
    job = _job(raw, values, tables, registers, log)
    log.stop_if_problems()
    plan = assemble_plan(job, plan_input, bars_of(registers), folder.resolve().name)
    check_positions(plan, plan_input, raw, log)
    log.stop_if_problems()
    return replace(plan, raw=_use_decimal_points(raw), warnings=tuple(log.warnings))


def _wall_plan(raw, values, tables, plan_input, folder, log):
    """Return the WallPlan of a plan that measures the bare wall."""
    courses = None if tables["courses"] is None else tuple(tables["courses"].of("course"))
    diameter = values["tank"]["nominal_diameter_m"]
    check_sections(plan_input, courses, None if diameter is None else diameter / 2, raw, log)
    log.stop_if_problems()
    warnings = tuple(log.warnings)
    raw = _use_decimal_points(raw)
    check_tank(values, tables, raw, log)
    log.stop_if_problems()
    limits = limits_of(plan_input.sections["limits"])
    name = folder.resolve().name
    plan = wall_plan_of(raw, values, tables, plan_input, limits, name)
    return replace(plan, warnings=(*warnings, *plan.warnings))


def _check_kind(raw, plan_input, log):
    """Check the kind of tank: upright, unless the plan measures by liquid only."""
    kind = kind_of(raw)
    if kind in (None, "vertical"):
        return
    is_filled = bool(plan_input.sections["runs"])
    others = [name for name in WALL_SECTIONS if plan_input.has(name)]
    if is_filled and not others and kind in OF_LIQUID:
        return
    if is_filled and kind in OF_LIQUID:
        expected = message(
            "plan_wall_of_upright",
            "given for a tank that lies or is a sphere; expected [[runs]] of liquid alone",
        )
        for name in others:
            log.problem(PLAN_FILE, expected, None, name)
        return
    expected = message(
        "plan_kinds",
        "found {found}; expected vertical, or, of runs of liquid alone, horizontal or sphere",
        found=kind,
    )
    log.problem(PLAN_FILE, expected, None, "tank.kind")


def _use_decimal_points(raw):
    """Return the RawJob with decimal points in its tables and no declared marks."""
    settings = {name: entries for name, entries in raw.settings.items() if name != "csv"}
    tables = {
        name: replace(table, decimal=".", rows=tuple(map(_row_with_points, table.rows)))
        if table is not None and table.decimal is not None
        else table
        for name, table in raw.tables.items()
    }
    return replace(raw, settings=settings, tables=tables)


def _row_with_points(row):
    """Return a row of cells with decimal points."""
    numbers = ((cell or "").strip().replace(",", ".") for cell in row)
    return tuple(
        number if NUMBER.fullmatch(number) else cell
        for number, cell in zip(numbers, row, strict=True)
    )


def _folder(path, log):
    if path.name == PLAN_FILE and path.is_file():
        return path.parent
    if not (path / PLAN_FILE).is_file():
        expected = message(
            "plan_no_plan_file",
            "no {file} there; expected a plan's folder, or its {same}",
            file=PLAN_FILE,
            same=PLAN_FILE,
        )
        if saved := saved_file_in(path):
            expected = message(
                "results_as_plan",
                "holds results ({saved}), not a plan; expected a plan's folder, or its {file}",
                saved=saved, file=PLAN_FILE,
            )  # fmt: skip
        log.problem(path.name or ".", expected)
    return path


def _read(folder, log):
    """Return the RawJob and the PlanInput of a plan's folder."""
    files = []

    def content(name, limit=None):
        data = read_beside(folder, name, log, *([] if limit is None else [limit]))
        if data is not None:
            files.append(fingerprint(name, data))
        return data

    data = content(PLAN_FILE, MAX_SETTINGS_BYTES)
    parsed = None if data is None else parsed_toml(PLAN_FILE, data, log)
    log.stop_if_problems()
    whole, rows = parsed
    text = decode(PLAN_FILE, data, log)
    rows, text = _refuse_misspelt(whole, rows, text, log)
    plan_sections = {name: whole.pop(name) for name in (*SINGLE, *REPEATED) if name in whole}
    _refuse_nothing_measured(plan_sections, log)
    settings, sections = flattened(PLAN_FILE, whole, rows, log)
    is_wall = is_wall_plan(plan_sections)
    needed = () if is_wall else ("pattern",)
    checked = {
        name: _read_section(name, plan_sections.get(name, {}), rows, log, name in needed)
        for name in SINGLE
    }
    for name in REPEATED:
        checked[name] = _read_sections(name, plan_sections.get(name, []), text, log)
    marks = declared_marks(PLAN_FILE, settings, log)
    # The design of a bare wall generates its control.
    of_wall = (*(name for name in JOB_TABLES if name != "control"), *WALL_TABLES)
    known = [f"{name}.csv" for name in (of_wall if is_wall else (*JOB_TABLES, *TABLES))]
    tables = {}
    for path in sorted(folder.glob("*.csv")):
        if path.name not in known:
            expected = message(
                "plan_unknown_file", "unknown file; expected {known}", known=", ".join(known)
            )
            log.problem(path.name, expected)
            continue
        table, tables[path.stem] = content(path.name), None
        if table is not None and marks is not None:
            tables[path.stem] = read_csv(path.name, table, *marks, log, PLAN_FILE)
    registers = {}
    for name in REGISTERS:
        if (folder / f"{name}.toml").exists():
            register = content(f"{name}.toml", MAX_SETTINGS_BYTES)
            if register is not None:
                registers[name] = read_register_file(f"{name}.toml", register, log)
    raw = RawJob(
        folder.resolve().name, folder, PLAN_FILE, settings, sections, tables,
        files=tuple(files), registers=registers, is_planned=True,
    )  # fmt: skip
    ties = {name: _table(name, tables.get(name), log) for name in TABLES}
    return raw, PlanInput(checked, ties, ties.pop("stadia"), is_wall=is_wall)


def _refuse_misspelt(content, rows, text, log):
    """Report sections with misspelt names; return (rows, text) with the corrected names.

    Reading continues under the corrected name, so that the section is not also reported as missing.
    A name that would appear twice, or with other brackets, is removed from `content`.
    """
    sections_of_jobs = {name.partition(".")[0] for name in KEYS}
    known = (*sections_of_jobs, *SINGLE, *REPEATED)
    for name in [section for section in content if section not in known]:
        is_list = isinstance(content[name], list)
        entries = content[name] if is_list else [content[name]]
        right = meant(name, known)
        if right is None or not all(isinstance(entry, dict) for entry in entries):
            continue
        places = _rows_of(re.escape(name), text)
        row = places[0][0] if places else rows.get(name)
        column = f"[[{name}]]" if is_list else f"[{name}]"
        log.problem(PLAN_FILE, unknown_section(name, known), row, column)
        entries = content.pop(name)
        if right not in content and is_list == (right in REPEATED):
            content[right] = entries
            rows = rows | {
                right + key[len(name) :]: row
                for key, row in rows.items()
                if key == name or key.startswith(f"{name}.")
            }
            pattern = rf"(?m)^(\s*\[+\s*){re.escape(name)}(\s*\]+)"
            text = re.sub(pattern, lambda found, right=right: found[1] + right + found[2], text)
    return rows, text


def _refuse_nothing_measured(sections, log):
    """Raise InputError for a plan with neither targets nor measurements of the bare wall."""
    if "pattern" in sections or is_wall_plan(sections):
        return
    expected = message(
        "plan_of_nothing",
        "nothing is measured; expected a [pattern] of targets, or [[straps]], [lines], [[hits]]"
        " or [tangents] of the bare wall, or [[runs]] of metered liquid",
    )
    log.problem(PLAN_FILE, expected)
    log.stop_if_problems()


def _table(name, table, log):
    """Return the ColumnValues of a table whose columns differ from those of a job, or None."""
    if table is None:
        return None
    values = read_columns(name, table, log, TABLES[name])
    for field in TABLES[name]:
        if isinstance(field, Count):
            for row, count in zip(values.rows, values.of(field.name), strict=True):
                if why := _explain_fraction(field, count):
                    log.problem(values.file, why, row, field.name)
    return values


def _read_section(section, entries, rows, log, is_needed):
    """Return the Entry of a [section] of a plan."""
    if not isinstance(entries, dict):
        expected = message("plan_one_section", "expected one [{section}]", section=section)
        log.problem(PLAN_FILE, expected, rows.get(section), section)
        entries = {}
    key_rows = {key: rows.get(f"{section}.{key}") for key in entries}
    return _check_entry(
        section, SINGLE[section], entries, rows.get(section), key_rows, log, is_needed
    )


def _read_sections(section, entries, text, log):
    """Return the list of Entry of a [[section]] of a plan."""
    if not isinstance(entries, list) or not all(isinstance(entry, dict) for entry in entries):
        expected = message(
            "plan_double_brackets", "expected [[{section}]], in double brackets", section=section
        )
        log.problem(PLAN_FILE, expected, None, section)
        return []
    result, places = [], _rows_of(section, text)
    for number, entry in enumerate(entries):
        row, rows = places[number] if number < len(places) else (None, {})
        name = f"{section}[{number + 1}]"
        result.append(_check_entry(name, REPEATED[section], entry, row, rows, log, is_needed=True))
    return result


def _rows_of(section, text):
    """Return [(row, {key: row})] of each [[section]] in the text of a plan.

    Used in messages only.
    """
    sections, rows = [], {}
    for number, line in enumerate(text.splitlines(), 1):
        if re.match(r"\s*\[+[^\[\],]+\]+\s*(#|$)", line):
            rows = {}
            if re.match(rf"\s*\[\[\s*{section}\s*\]\]", line):
                sections.append((number, rows))
        elif key := re.match(r"\s*[\"']?(\w+)[\"']?\s*=", line):
            rows.setdefault(key[1], number)
    return sections


def _check_entry(name, fields, entries, row, rows, log, is_needed=False):
    """Return the Entry of the checked keys of a section; rows: {key: row} for messages."""
    known = [field.name for field in fields]
    for key in entries:
        if key not in known:
            expected = message("plan_unknown_key", "unknown key{hint}", hint=nearest(key, known))
            log.problem(PLAN_FILE, expected, rows.get(key) or row, f"{name}.{key}")
    values = {
        field.name: read_setting(
            PLAN_FILE,
            f"{name}.{field.name}",
            field,
            Value(entries[field.name], rows.get(field.name)) if field.name in entries else None,
            None,
            log,
            field.required and bool(entries or is_needed),
            row,
        )
        for field in fields
    }
    filled_keys = frozenset(key for key, value in entries.items() if not is_blank(value))
    checked = Entry(name, values, filled_keys, row, rows)
    for field in fields:
        if isinstance(field, Count) and (why := _explain_fraction(field, values[field.name])):
            checked.report(log.problem, field.name, why)
    return checked


def _explain_fraction(field, value):
    """Return the message about a value that is no whole number; "" if it is whole or blank."""
    if value is None or float(value).is_integer():
        return ""
    return message(
        "plan_not_whole",
        "found {found:g}; expected {expected}",
        found=value,
        expected=field.expectation,
    )


def _job_tables(raw, log):
    """Return {name: ColumnValues or None} of all tables that a job can have."""
    tables = dict.fromkeys(JOB_FILES)
    for name in JOB_TABLES:
        if raw.tables.get(name) is not None:
            tables[name] = read_columns(name, raw.tables[name], log)
    if "courses" not in raw.tables and kind_of(raw) in (None, "vertical"):
        log.problem(
            "courses.csv",
            message("plan_courses_missing", "missing file; expected the courses of the shell"),
        )
    return tables


def _check(raw, values, tables, registers, plan_input, log):
    """Check all values that do not depend on positions."""
    check_tank(values, tables, raw, log)
    files = SurveyFiles(values, tables, registers, raw, log)
    check_cameras(files)
    check_instruments(files)
    if has_rows(plan_input.stadia):
        check_bars(files, plan_input.stadia)
    check_input(values, registers, plan_input, raw, log)


def _job(raw, values, tables, registers, log):
    """Return the Job of a plan.

    Its measurements are cameras, instruments, control and settings only.
    """
    rule = values["table"]["rule"]
    attached = Attached(None, None if rule is None else find_rule(raw, rule, log))
    log.stop_if_problems()
    measurements = make_measurements(values, tables, registers)
    tables = tables | NO_IMAGE_POINTS
    return make_job(raw, values, tables, attached, measurements, tuple(log.warnings))


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
