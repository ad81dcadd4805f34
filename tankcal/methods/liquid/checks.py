"""Checks of a calibration with liquid as a whole: meters, settings, other measurements."""

from tankcal.job.checking import has_rows, is_not_given, missing_beside, settings_place, tell
from tankcal.job.checks.extent import (
    extent_of,
    has_wall_points,
    is_strapped,
    is_unsurveyed,
)
from tankcal.job.contract.bottom import bottom_form
from tankcal.job.entries import kind_of
from tankcal.job.tables import nearest
from tankcal.messages import message
from tankcal.methods.liquid.columns import GEOMETRY, NEEDED
from tankcal.methods.liquid.runs import check_runs, place_runs
from tankcal.tank.liquid.reduction import MOST_ROWS


def check_liquid(values, tables, registers, raw, log):
    """Check meters, settings and the order of rows; parameters as for `check_all`."""
    table = tables["liquid"]
    if len(table.rows) > MOST_ROWS:
        expected = message(
            "too_many_batches",
            "{count} rows; expected at most {most}",
            count=len(table.rows),
            most=MOST_ROWS,
        )
        log.problem(table.file, expected)
        return
    _check_meters(table, registers["meters"], raw, log)
    extent = None
    if values is not None:
        kind = kind_of(raw)
        extent = extent_of(values, tables, kind)
        _check_settings(values, tables, raw, log)
        _check_beside(values, tables, kind, raw, log)
    check_runs(table, values, extent, raw, log)


def meters_read(table, meters):
    """Name of the meter of each row; None where it is not known.

    A blank means the only meter. At the start of a run, where nothing was metered, the meter of the
    next row applies.
    """
    only = next(iter(meters)) if len(meters) == 1 else None
    names = [name or only for name in table.of("meter")]
    for rows in place_runs(table).values():
        if len(rows) > 1 and names[rows[0]] is None:
            names[rows[0]] = names[rows[1]]
    return names


def tell_without_rows(tables, registers, raw, log):
    """Report meters, settings or an empty table without any readings."""
    if "liquid" in raw.tables:
        table = raw.tables["liquid"]
        has_wall = has_wall_points(tables) or is_strapped(tables)
        is_begun = registers["meters"] or _given_settings(raw)
        if table is not None and (has_wall or kind_of(raw) != "vertical") and is_begun:
            expected = message(
                "meters_without_rows",
                "no rows, but a meter or [liquid] is filled in; expected the batches and dips",
            )
            log.problem(table.file, expected)
        return
    for key in _given_settings(raw)[:1]:
        expected = message(
            "settings_without_liquid",
            "given without {file}; expected both or none",
            file=raw.file_of("liquid"),
        )
        tell(log.problem, raw, "liquid", key, expected)
    if registers["meters"]:
        expected = message("no_liquid", "without effect: nothing was metered into the tank")
        log.warning(raw.registers["meters"].file, expected)


def _given_settings(raw):
    entries = (raw.settings or {}).get("liquid", {})
    return [key for key in entries if not is_not_given(raw, "liquid", key)]


def _check_meters(table, meters, raw, log):
    file = raw.file_of("meters")
    if raw.registers.get("meters", ()) is None:
        return  # unreadable, reported already
    if not meters:
        expected = message(
            "no_meter",
            "nothing filled in; expected a section for each meter of {of}",
            of=table.file,
        )
        log.problem(file, expected)
        return
    used_meters = meters_read(table, meters)
    for row, given, name in zip(table.rows, table.of("meter"), used_meters, strict=True):
        if name is None and not log.has(table.file, row, "meter"):
            expected = message("meter_not_named", "blank; expected a meter of {file}", file=file)
            log.problem(table.file, expected, row, "meter")
        elif given is not None and given not in meters:
            expected = message(
                "no_such_meter",
                "found {name!r}; expected a meter of {file}{hint}",
                name=given,
                file=file,
                hint=nearest(given, meters),
            )
            log.problem(table.file, expected, row, "meter")
    register = raw.registers["meters"]
    for name, keys in meters.items():
        low, high = keys["flow_min_m3_h"], keys["flow_max_m3_h"]
        if None not in (low, high) and low >= high:
            expected = message(
                "flows_upside_down",
                "found {low:g}; expected less than flow_max_m3_h = {high:g}",
                low=low,
                high=high,
            )
            _tell_of_meter(log.problem, register, name, "flow_min_m3_h", expected)
        if name not in used_meters:
            expected = message("meter_not_read", "without effect: no row of {of} names it",
                               of=table.file)  # fmt: skip
            log.warning(file, expected, register.rows.get(name), name)


def _tell_of_meter(report, register, name, key, expected):
    value = register.entries[name].get(key)
    row = register.rows.get(name) if value is None or value.row is None else value.row
    report(register.file, expected, row, f"{name}.{key}")


def _check_settings(values, tables, raw, log):
    """Require the settings of a calibration with liquid; refuse settings without effect."""
    table, given = tables["liquid"], values["liquid"]
    for key in NEEDED:
        if is_not_given(raw, "liquid", key):
            tell(log.problem, raw, "liquid", key, missing_beside(table.file))
    dips = zip(table.of("dip_m"), table.of("s_dip_mm"), strict=True)
    if is_not_given(raw, "liquid", "s_dip_mm") and any(
        sd is None for dip, sd in dips if dip is not None
    ):
        expected = message(
            "dip_sd_missing",
            "missing; expected it, or s_dip_mm in each row of {file}",
            file=table.file,
        )
        tell(log.problem, raw, "liquid", "s_dip_mm", expected)
    runs = place_runs(table)
    if len(runs) == 1 and not table.skipped and is_not_given(raw, "liquid", "run_ppm"):
        expected = message(
            "run_effect_missing",
            "missing; expected by how much whole runs differ (0: not at all): there is one run,"
            " {run!r}, and only two or more show it",
            run=next(iter(runs)),
        )
        tell(log.problem, raw, "liquid", "run_ppm", expected)
    alone = is_unsurveyed(tables) and not _has_unreadable_survey(raw)
    if alone and given["table"] == GEOMETRY:
        expected = message(
            "no_geometry_beside_liquid",
            "found {table}; expected joint or liquid: nothing but liquid measured the tank",
            table=GEOMETRY,
        )
        tell(log.problem, raw, "liquid", "table", expected)
    if given["u_radius_mm"] is not None and not is_unsurveyed(tables):
        expected = message(
            "radius_beside_survey",
            "given beside a survey of the wall; expected only where liquid alone tells the tank",
        )
        tell(log.problem, raw, "liquid", "u_radius_mm", expected)


def _has_unreadable_survey(raw):
    return any(table is None for name, table in raw.tables.items() if name != "liquid")


def _check_beside(values, tables, kind, raw, log):
    """Refuse a second determination of the bottom, and a roof that touches the liquid."""
    lowest, table = values["roof"]["critical_bottom_m"], tables["liquid"]
    if kind == "vertical" and lowest is not None:
        _refuse_roof(table, lowest, log)
    if kind != "vertical" or bottom_form(values, tables["bottom"]) != "liquid":
        return
    expected = message(
        "bottom_beside_liquid",
        "a bottom measured by liquid beside {file}; expected only one of them: {file} tells what"
        " is below its first dip",
        file=tables["liquid"].file,
    )
    if has_rows(tables["bottom"]):
        log.problem(tables["bottom"].file, expected)
    else:
        file, row, name = settings_place(raw, "bottom", "form")
        log.problem(file, expected, row, name)


def _refuse_roof(table, lowest_m, log):
    for row, dip in zip(table.rows, table.of("dip_m"), strict=True):
        if dip is not None and dip > lowest_m:
            expected = message(
                "dip_reaches_roof",
                "found {dip:g}; expected dips below roof.critical_bottom_m = {lowest:g} m: above it"
                " the roof takes part in the volume",
                dip=dip,
                lowest=lowest_m,
            )
            log.problem(table.file, expected, row, "dip_m")
            return
