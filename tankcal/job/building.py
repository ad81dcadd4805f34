"""From the raw tables of a job to a checked `Job`, or to the list of all its problems."""

from dataclasses import replace

from tankcal.errors import SHEET
from tankcal.job.assembly import Attached, make_frame, make_job, read_mesh_file
from tankcal.job.checking import has_rows
from tankcal.job.checks import check_all
from tankcal.job.checks.extent import has_survey, is_sighted, is_strapped
from tankcal.job.contract import COLUMNS, REQUIRED_TABLES, TABLES_OF_KIND
from tankcal.job.entries import ColumnValues, kind_of, read_columns, read_register, read_settings
from tankcal.job.equipment import add_shared_register, equipment_used
from tankcal.job.model.settings import Overruling, Seal
from tankcal.job.next_verification import read_next_verification
from tankcal.job.rule_files import find_rule
from tankcal.job.tables import (
    REGISTERS,
    SURVEY_TABLES,
    TABLES,
    TANK_TABLES,
    missing_sheet,
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
    attached = _attached(raw, values, log) if is_whole else None
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
    if (no_rows := method.no_rows())
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


def _attached(raw, values, log):
    """Read the files beside the settings; values is None if the settings are unreadable."""
    mesh = rule = None
    if values is not None:
        mesh, rule = values["mesh"]["file"], values["table"]["rule"]
    return Attached(
        None if mesh is None else read_mesh_file(raw.folder, mesh, log),
        None if rule is None else find_rule(raw, rule, log),
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
