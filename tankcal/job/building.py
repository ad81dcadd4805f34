"""From the raw tables of a job to a checked `Job`, or to the list of all its problems.

Measuring equipment of a survey, from the register of the laboratory (equipment.toml).

The register is a file beside the job, or a file that several jobs share, named by
survey.equipment_register. The certificate states the equipment used with its calibration. No value
of the register enters a calculation.

Last day of the next verification, for the certificate: of a named rule, or of the customer.

A certificate has no recommendation of a calibration interval of the laboratory's own.
"""

from dataclasses import replace
from datetime import date
from pathlib import Path

from tankcal.errors import SHEET
from tankcal.job.assembly import Attached, make_frame, make_job, read_mesh_file
from tankcal.job.checking import has_rows
from tankcal.job.checks import check_all
from tankcal.job.checks.extent import has_survey, is_sighted, is_strapped
from tankcal.job.contract import COLUMNS, REQUIRED_TABLES, TABLES_OF_KIND
from tankcal.job.entries import ColumnValues, kind_of, read_columns, read_register, read_settings
from tankcal.job.fields import is_blank
from tankcal.job.folder import MAX_SETTINGS_BYTES
from tankcal.job.folder import read_register as parse_register
from tankcal.job.model import Equipment, NextVerification, Overruling, Seal
from tankcal.job.rule_files import find_rule, tell_layout
from tankcal.job.tables import (
    REGISTERS,
    SURVEY_TABLES,
    TABLES,
    TANK_TABLES,
    fingerprint,
    missing_sheet,
    nearest,
    read_beside,
)
from tankcal.messages import message
from tankcal.methods.base import methods, methods_for

# Columns of upright tanks, with the columns that lying tanks have in their place.
IN_PLACE = {"course": "ring", "level_m": "from_a_m"}
_OVERRULING_COLUMNS = ("point", "table", "row", "decision", "reason", "by", "date")


def job_of(raw, log, is_whole=True):
    """Check a job as a whole and build it.

    Parameters
    ----------
    raw : RawJob
        Job as read.
    log : Log
        Contains the problems of reading; receives the problems of the checks.
    is_whole : bool, optional
        False: check only the survey, for an adjustment without a capacity table.

    Returns
    -------
    Job

    Raises
    ------
    InputError
        With every problem in `log`.
    """
    raw = add_shared_register(raw, log)
    registers = {name: read_register(raw, name, log) for name in REGISTERS}
    tables = _read_tables(raw, registers, is_whole, log)
    values = read_settings(raw, log, is_whole) if raw.settings is not None else None
    check_all(values, tables, registers, raw, is_whole, log)
    equipment = (
        () if values is None else equipment_used(values["survey"], registers["equipment"], raw, log)
    )
    attached = _read_attachments(raw, values, log) if is_whole else None
    log.stop_if_problems()
    measurements = None
    if has_survey(tables):
        from tankcal.job.measuring import make_measurements

        measurements = make_measurements(values, tables, registers)
    overrulings = make_overrulings(tables["overrulings"])
    if not is_whole:
        frame = make_frame(raw, values, tables, measurements, tuple(log.warnings))
        return replace(frame, overrulings=overrulings, equipment=equipment)
    job = make_job(raw, values, tables, attached, measurements, tuple(log.warnings))
    if attached.mesh is not None:
        (name, *_), data = attached.mesh
        raw = replace(raw, archives=raw.archives | {name: data})
    by_attribute, by_method = {}, {}
    for method in methods_for(kind_of(raw)):  # two methods may share a table
        if method.is_given(tables):
            readings = method.read(values, tables, registers, raw)
            attributes = by_method if method.attribute is None else by_attribute
            attributes[method.attribute or method.name] = readings
    seals = tuple(
        Seal(name, **{key: str(value or "") for key, value in entry.items()})
        for name, entry in registers["seals"].items()
    )
    parts = {"overrulings": overrulings, "equipment": equipment, "seals": seals}
    parts["surveys"] = by_method
    return replace(job, **parts, **by_attribute)


def _read_tables(raw, registers, is_whole, log):
    """Read and check all tables.

    Returns {name: ColumnValues}, with None for a table that is missing, unreadable or not allowed
    for the kind of tank, and for an empty table of a survey. A list of readings, such as clouds,
    forms a table with a row for each entry.
    """
    kind = kind_of(raw)
    allowed = None if kind is None else TABLES_OF_KIND[kind]
    if kind is not None and "points" in allowed:
        allowed += SURVEY_TABLES
    for method in methods_for(kind):
        allowed += method.tables + method.shared_tables
    listed = [method for method in methods() if method.register]
    tables = {
        method.register: _table_of_list(method, raw, registers, kind, log) for method in listed
    }
    # Without a valid kind, the table of rings indicates a lying cylinder.
    assumed_kind = kind or ("horizontal" if raw.tables.get("rings") is not None else None)
    for name in TABLES:
        table = raw.tables.get(name)
        is_empty = table is None or not (table.rows or table.skipped)
        if allowed is not None and name not in allowed:
            if not is_empty:
                log.problem(table.file, not_for_this_kind(kind))
            tables[name] = None
            continue
        if table is None or (is_empty and name not in TANK_TABLES):
            tables[name] = None
        else:
            tables[name] = _as_upright(read_columns(name, table, log, kind=assumed_kind))
    if is_whole:
        _tell_missing_tables(raw, tables, kind, log)
    return tables


def _as_upright(table):
    """Add to a table of a lying tank the columns that an upright tank has in their place."""
    equivalents = {name: table.columns[equivalent] for name, equivalent in IN_PLACE.items()
                   if equivalent in table.columns and name not in table.columns}  # fmt: skip
    return replace(table, columns=table.columns | equivalents) if equivalents else table


def _table_of_list(method, raw, registers, kind, log):
    """ColumnValues of a list of readings; None if absent or not allowed for the kind."""
    entries, register = registers[method.register], raw.registers.get(method.register)
    if register is None or not entries:
        return None
    if kind is not None and kind not in method.kinds:
        log.problem(register.file, not_for_this_kind(kind))
        return None
    rows = tuple(register.rows[name] for name in entries)
    return ColumnValues(register.file, rows, 0, {REGISTERS[method.register]: [*entries]})


def not_for_this_kind(kind):
    """Message about a table that a tank of this kind does not have."""
    return message(
        "not_for_this_kind", "not for a tank of kind {of_kind}; remove the table", of_kind=kind
    )


def _tell_missing_tables(raw, tables, kind, log):
    if kind == "vertical":
        _tell_sights_missing(raw, tables, log)
        _tell_empty_lists(raw, tables, log)
    is_measured = has_survey(tables) or any(m.is_given(tables) for m in methods_for(kind))
    replaced = ["points"] if is_measured else []  # by any measurement of the wall
    present = {*raw.tables, *replaced}
    missing = [name for name in REQUIRED_TABLES.get(kind, ()) if name not in present]
    sources = raw.registers | raw.tables
    for name in missing:
        empty = [other for other in _IN_PLACE_OF_POINTS if name == "points" and other in sources]
        if not empty:
            log.problem(raw.file_of(name), _missing(raw, name))
        elif sources[empty[0]] is not None:  # else reported already
            log.problem(sources[empty[0]].file, _IN_PLACE_OF_POINTS[empty[0]])


def _tell_sights_missing(raw, tables, log):
    """Report set-ups from which no target, wall point or limb was sighted."""
    has_targets = has_rows(tables["points"]) or has_rows(tables["targets"]) or is_sighted(tables)
    has_readings = has_survey(tables) or is_strapped(tables)  # otherwise reported as missing points
    if has_targets or not has_readings or not has_rows(tables["setups"]):
        return
    methods_with_sights = (method for method in methods_for("vertical") if method.is_sighted)
    sights = [m.readings_table for m in methods_with_sights if m.readings_table in raw.tables]
    for name in sights:
        if raw.tables[name] is not None:
            log.problem(raw.tables[name].file, _IN_PLACE_OF_POINTS[name])
    if not sights and not has_survey(tables):
        expected = message(
            "setups_without_sights",
            "set-ups, but nothing was sighted from them; expected wall_hits.csv, tangents.csv, or"
            " readings such as directions.csv",
        )
        log.problem(tables["setups"].file, expected)


def _tell_empty_lists(raw, tables, log):
    """Report an empty list of readings beside a survey without targets or sights to the wall."""
    has_targets = has_rows(tables["points"]) or has_rows(tables["targets"]) or is_sighted(tables)
    for name, register in raw.registers.items():
        is_empty = name in _IN_PLACE_OF_POINTS and register is not None and not register.entries
        if is_empty and has_survey(tables) and not has_targets:
            log.problem(register.file, _IN_PLACE_OF_POINTS[name])


_IN_PLACE_OF_POINTS = {  # straps last: other methods have an empty table of them beside their own
    method.readings_table: no_rows
    for method in sorted(methods(), key=lambda method: (not method.register, method.comes_last))
    if (no_rows := method.no_rows)
}


def _missing(raw, name):
    if raw.file_of(name).startswith(SHEET):
        return missing_sheet()
    needed = ", ".join(field.name for field in COLUMNS[name] if field.required)
    if name == "points":
        return message(
            "missing_points_file",
            "missing file; expected one with the columns {columns}, or the files of a survey, "
            "such as distances.csv",
            columns=needed,
        )
    return message(
        "missing_file", "missing file; expected one with the columns {columns}", columns=needed
    )


def _read_attachments(raw, values, log):
    """Read the files beside the settings; values is None if the settings are unreadable."""
    mesh = rule = None
    if values is not None:
        mesh, name = values["mesh"]["file"], values["table"]["rule"]
        rule = None if name is None else find_rule(raw, name, log)
        if rule is not None:
            tell_layout(raw, values, rule[0], log)
    return Attached(
        None if mesh is None else read_mesh_file(raw.folder, mesh, log),
        rule,
        (None, None) if values is None else read_next_verification(raw, values, log),
    )


def make_overrulings(table):
    """`Overruling`s in the order of the file; () without the table."""
    if table is None:
        return ()
    rows = zip(*map(table.of, _OVERRULING_COLUMNS), table.rows, strict=True)
    return tuple(
        Overruling(
            point=point,
            table=reading_table,
            reading_row=None if number is None else int(number),
            decision=decision,
            reason=reason,
            by=by or "",
            date="" if date is None else str(date),
            row=row,
            file=table.file,
        )
        for point, reading_table, number, decision, reason, by, date, row in rows
    )


# ---- measuring equipment

EQUIPMENT, ENDING = "equipment", ".toml"
REGISTER_KEY = f"{EQUIPMENT}_register"


def add_shared_register(raw, log):
    """Return the RawJob with the register that `survey.equipment_register` names, if any."""
    key = (raw.settings or {}).get("survey", {}).get(REGISTER_KEY)
    if key is None or is_blank(key.raw):
        return raw
    place, name = (raw.settings_file, key.row, f"survey.{REGISTER_KEY}"), str(key.raw)
    if EQUIPMENT in raw.registers:
        expected = message(
            "two_equipment_registers",
            "found {name} and {local}; expected one register of equipment",
            name=name,
            local=raw.file_of(EQUIPMENT),
        )
        log.problem(place[0], expected, *place[1:])
        return raw
    # A job may come from somebody else: only TOML files at a relative place are read.
    if (
        not name.lower().endswith(ENDING)
        or Path(name).is_absolute()
        or not (raw.folder / name).is_file()
    ):
        expected = message(
            "no_equipment_register",
            "found {name}; expected a TOML file at a place relative to the job, such as "
            "../equipment.toml",
            name=name,
        )
        log.problem(place[0], expected, *place[1:])
        return raw
    name = Path(name).as_posix()  # `tankcal verify` finds the file by this place
    data, register, files = read_beside(raw.folder, name, log, MAX_SETTINGS_BYTES), None, raw.files
    if data is not None:
        register = parse_register(name, data, log, EQUIPMENT)
        files = (*files, fingerprint(name, data))
    return replace(raw, registers=raw.registers | {EQUIPMENT: register}, files=files)


def equipment_used(survey, entries, raw, log):
    """Return the `Equipment` of a survey; warn of calibrations that do not cover its date.

    Parameters
    ----------
    survey : dict
        Values of [survey].
    entries : dict
        {name: {key: value}} of the register.
    raw : RawJob
    log : Log

    Returns
    -------
    tuple of Equipment
        Those of `equipment_used`, otherwise all of the register.
    """
    register = raw.registers.get(EQUIPMENT)
    if register is None and survey[REGISTER_KEY]:  # it could not be read: reported already
        return ()
    names = survey["equipment_used"] or tuple(entries)
    unknown = [name for name in names if name not in entries]
    for name in unknown:
        expected = message(
            "unknown_equipment",
            "found {name!r}; expected a name of the register of equipment{hint}",
            name=name,
            hint=nearest(name, entries),
        )
        row = raw.settings["survey"]["equipment_used"].row
        log.problem(raw.settings_file, expected, row, "survey.equipment_used")
    used = tuple(
        Equipment(name, **{key: str(value or "") for key, value in entries[name].items()})
        for name in names
        if name not in unknown
    )
    for item in used:
        _check_dates(item, survey["date"], register, log)
    return used


def _check_dates(item, survey_date, register, log):
    """Warn of a calibration that was due before the survey, or made after it."""
    day = str(survey_date or "")
    if not day:
        return
    entry = register.entries[item.name]
    if item.due and item.due < day:
        text = message(
            "equipment_overdue",
            "its calibration was due on {due}, before the survey of {day}",
            due=item.due,
            day=day,
        )
        log.warning(register.file, text, entry["due"].row, f"{item.name}.due")
    if item.date and item.date > day:
        text = message(
            "equipment_calibrated_later",
            "calibrated on {date}, after the survey of {day}",
            date=item.date,
            day=day,
        )
        log.warning(register.file, text, entry["date"].row, f"{item.name}.date")


# ---- next verification

_KEY = "certificate.next_verification_rule"
_LYING = ("horizontal", "inclined")
_KINDS = {  # kinds of tank in the terms of the rules: without, and with a floating roof
    "vertical": (("vertical_fixed_roof",), ("vertical_floating_roof",)),
    "horizontal": (_LYING, _LYING),
    "sphere": (("sphere",), ("sphere",)),
    "mesh": (("other",), ("other",)),
}


def read_next_verification(raw, values, log):
    """Return the next verification of a job, and the fingerprint of a rule beside the job.

    Parameters
    ----------
    raw : RawJob
    values : dict of {str: dict}
        {section: {key: value}} of the settings.
    log : Log
        Receives the problems; also a warning for a rule that was not compared with its text, whose
        date no certificate states.

    Returns
    -------
    tuple of (NextVerification or None, tuple or None)
    """
    certificate = values["certificate"]
    wished, name = certificate["next_verification"], certificate["next_verification_rule"]
    if name is None:
        return (None if wished is None else NextVerification(str(wished))), None
    row = raw.settings["certificate"]["next_verification_rule"].row
    if wished is not None:
        expected = message(
            "two_next_verifications",
            "given together with next_verification; expected the rule or the date for which the "
            "customer asked",
        )
        log.problem(raw.settings_file, expected, row, _KEY)
        return None, None
    named = find_rule(raw, name, log, _KEY)
    day = values["survey"]["date"]
    if named is None or day is None or values["tank"]["kind"] is None:
        return None, None
    rule, file = named
    period = _shortest_period(rule, values)
    if period is None:
        text = message(
            "no_period_for_tank",
            "the rule has no period for the whole of a tank of this kind; the certificate states "
            "no date",
        )
    elif not period.verified:
        text = message(
            "period_not_read",
            "the period of the rule was not compared with its text; the certificate states no date",
        )
    else:
        last = _add_years(date.fromisoformat(str(day)), period.years)
        return NextVerification(str(last), rule.name, period.clause, period.years), file
    log.warning(raw.settings_file, text, row, _KEY)
    return None, file


def _shortest_period(rule, values):
    """Return the shortest Period of the whole tank, or None."""
    has_roof = values["roof"]["mass_kg"] is not None
    kinds = _KINDS[values["tank"]["kind"]][has_roof]
    periods = [
        period
        for period in rule.periods
        if period.of == "all" and (not period.tanks or set(kinds) & set(period.tanks))
    ]
    return min(periods, key=lambda period: period.years, default=None)


def _add_years(day, years):
    """Return the day after a number of years; fractions of a year count as whole months."""
    months = day.month - 1 + round(12 * years)
    year, month = day.year + months // 12, months % 12 + 1
    last_of_month = (date(year + month // 12, month % 12 + 1, 1) - date(year, month, 1)).days
    return date(year, month, min(day.day, last_of_month))
