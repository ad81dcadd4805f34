"""Sheets of a record: certificate, survey, uncertainty, courses, methods and corrections."""

from functools import partial

import numpy as np

from tankcal.methods.base import methods
from tankcal.record.columns import as_columns
from tankcal.report.certificate import (
    authorising_person,
    calibration_facts,
    doubts_of,
    limits_of_u,
)
from tankcal.report.numbers import unit
from tankcal.report.paper import DECIMALS_OF_PARTS
from tankcal.report.tables import (
    ship,
    survey,
    tank,
)
from tankcal.report.tables.facts import REFERENCES, SURVEY, SURVEY_DATE, tank_facts
from tankcal.report.tables.survey import (
    CHECK_POINTS,
    GROUPS,
    INSTRUMENTS,
    MOST_IN_SHEET,
    PHOTOS,
    POINTS,
    READINGS,
    SYSTEMS,
    camera_rows,
    camera_table,
    convert_units,
    point_rows,
)
from tankcal.report.uncertainty import budget, method, monte_carlo, rule
from tankcal.report.uncertainty.method import limits_table, stated_table
from tankcal.report.uncertainty.stated import (
    WORST_DELIVERIES,
    k_of_rows,
    stated_U_m3,
    worst_delivery_rows,
)
from tankcal.report.workbook.look import (
    ACCENT,
    DATE,
    LINE_PT,
    MUTED,
    Column,
    lines_of,
    number_format,
)
from tankcal.report.workbook.sections import (
    HEAD_ROW,
    CellTable,
    DrawnPart,
    Facts,
    Sentences,
    SheetContent,
    cell_table,
    columns_of,
    set_widths,
    write_sheet,
)
from tankcal.text.digits import decimals_of, decimals_of_height
from tankcal.text.words import (
    choice_sentence,
    datum_sentences,
    global_test_sentence,
    make_sentence,
    scale_sentence,
    sentence,
    snooping_sentence,
    verdict_sentences,
)

_WIDTHS = (36, 20, 24, 14, 14)  # widths of the columns, letters
_LONG = 60  # largest number of letters beside a label
_DATES = ("date", "date_of_issue")  # keys of the job with dates
_ELSEWHERE = (  # keys of the certificate that other parts of the sheet show
    *("notice", "survey_end", "authorised_by", "authorised_role"),
    *("next_verification", "next_verification_rule"),
)


def certificate_sheet(book, record):
    """Write the first sheet of the workbook."""
    words, paper = book.words, book.paper
    rules = ()
    if record.get("rule"):
        facts = _facts(paper, paper.word("headings.rule"), rule.facts)
        rules = ((facts, Sentences(rule.sentences(paper))),)
    choices = [choice_sentence(words, choice) for choice in record["choices"]]
    sections = [
        *([DrawnPart(_draw_notice)] if book.notice else []),
        DrawnPart(partial(_draw_result, record), sentence(words, "headings", "result")),
        Sentences([limits_of_u(paper)]),
        Sentences(
            doubts_of(record["warnings"]),
            title=words["certificate"]["doubtful"],
            look={"bold": True, "font_color": ACCENT},
        ),
        Facts(
            _declared_facts(book, tank_facts(record)),
            sentence(words, "headings", "tank"),
            longest=_LONG,
        ),
        Facts(_certificate(record, words), book.word("headings.certificate"), longest=_LONG),
        Facts(
            _declared_facts(book, SURVEY_DATE, SURVEY, REFERENCES),
            book.word("headings.survey"),
            longest=_LONG,
        ),
        _facts(paper, paper.word("headings.calibration"), calibration_facts),
        Sentences(
            method.sentences(paper, f'"{paper.word("intervals.monte_carlo")}"'),
            title=paper.word("headings.uncertainty"),
        ),
        _facts(paper, paper.word("headings.inputs"), method.inputs),
        *rules,
        DrawnPart(partial(_draw_corrections, record), sentence(words, "headings", "corrections")),
        Sentences(survey.sentences(paper), title=paper.word("headings.overrulings")),
        Sentences(choices, title=sentence(words, "headings", "choices")),
        DrawnPart(
            partial(_draw_authorisation, record), sentence(words, "headings", "authorisation")
        ),
    ]
    content = SheetContent("certificate", sections, landscape=False, tab="result", widths=_WIDTHS)
    write_sheet(book, content)


def _label(words, key):
    """Return the label of a key of the job; an unknown key vessel_no becomes "Vessel no"."""
    return words["labels"].get(key, key.replace("_", " ").capitalize())


def _certificate(record, words):
    """Return (label, value, DATE or None) for the entries of the certificate in the job."""
    labels = {"number": sentence(words, "page", "number")}
    return [
        (labels.get(key) or _label(words, key), value, DATE if key in _DATES else None)
        for key, value in record["job"]["certificate"].items()
        if key not in _ELSEWHERE
    ]


def _declared_facts(book, *tables):
    """Return (label, value, format) of declared facts with values; the format may be DATE."""
    words, lines = book.words, []
    for table in tables:
        (row,) = table.rows(book.paper.record)
        for column in table.in_workbook([row]):
            value = column.text(book.paper, row) if column.text else row.get(column.key)
            if value is not None:
                value = sentence(words, column.words, value) if column.words else value
                lines.append((_label(words, column.key), value, _format(column)))
    return lines


def _format(column):
    if column.key == SURVEY_DATE.name:
        return DATE
    return None if column.is_text else number_format(column.decimals, unit=unit(column.unit).symbol)


def _facts(paper, title, facts_of):
    """Return the `Facts` for the non-empty texts of facts_of(paper)."""
    lines = [(paper.label(key), text, None) for key, text in facts_of(paper) if text]
    return Facts(lines, title, longest=_LONG)


def _draw_notice(book, sheet, row):
    """Write the notice of the certificate in a frame; return the next row."""
    look = {"bold": True, "font_size": 14, "align": "center", "valign": "vcenter", "border": 2}
    book.paragraph(sheet, row, book.notice, _WIDTHS, border_color=ACCENT, **look)
    sheet.set_row(row, 26)
    return row + 1


def _draw_result(record, book, sheet, row):
    """Write the capacity at the top of the table with U and k; return the next row."""
    capacity, words = record["capacity"], book.words
    U, k = stated_U_m3(capacity)[-1], k_of_rows(capacity)[-1]
    factor, symbol = book.paper.volume_factor, book.paper.volume_symbol
    volume_format = number_format(decimals_of(factor * U), unit=symbol)
    top = number_format(decimals_of_height(capacity["height_m"][-1]), unit="m")
    lines = []
    for column, code in enumerate(("volume", "U", "k", "dip_height"), 1):
        text = book.word(f"labels.{code}")
        look = {"align": "right", "text_wrap": True, "font_color": MUTED}
        book.put(sheet, row, column, text, **look)
        lines.append(lines_of(text, _WIDTHS[column]))
    book.set_height(sheet, row, LINE_PT * max(lines))
    line = {"bold": True, "font_size": 12}
    sheet.set_row(row + 1, 20)
    book.put(sheet, row + 1, 0, book.word("labels.top_of_table"), **line)
    k = words["intervals"]["monte_carlo"] if k is None else k
    for column, value, shown in (
        (1, factor * capacity["volume_m3"][-1], volume_format),
        (2, factor * U, f'"± "{volume_format}'),
        (3, k, '"k = "0.00'),
        (4, capacity["height_m"][-1], top),
    ):
        book.put(sheet, row + 1, column, value, num_format=shown, align="right", **line)
    return row + 2


def _draw_corrections(record, book, sheet, row):
    """Write the applied corrections with their sizes; return the next row."""
    words = book.words
    applied = [correction for correction in record["corrections"] if correction["applied"]]
    factor, symbol = book.paper.volume_factor, book.paper.volume_symbol
    decimals = decimals_of(factor * stated_U_m3(record["capacity"])[-1]) + 1
    volume_format = number_format(decimals, unit=symbol)
    for correction in applied:
        book.put(sheet, row, 0, sentence(words, "corrections", correction["code"]))
        book.put(sheet, row, 1, factor * correction["size_m3"], num_format=volume_format)
        book.put(sheet, row, 2, correction["size_percent"], num_format='0.0000 "%"')
        row += 1
    if not applied:
        book.put(sheet, row, 0, sentence(words, "texts", "no_corrections"))
        row += 1
    return row


def _draw_authorisation(record, book, sheet, row):
    """Write lines for the authorising person, signature, place and date; return the next row."""
    line, person = book.format(bottom=1), authorising_person(record["job"]["certificate"])
    for below, key in ((1, "authorised_by"), (3, "signature"), (5, "place_and_date")):
        book.put(sheet, row + below, 0, _label(book.words, key))
        for column in (1, 2):
            sheet.write_blank(row + below, column, None, line)
    if person:
        book.put(sheet, row + 1, 1, person, bottom=1)
    return row + 6


MOST_READINGS = MOST_IN_SHEET  # largest number of readings; largest |w| first
MOST_POINTS = MOST_IN_SHEET  # largest number of points; unused, then least precise points first
_LEAST = (34, 12)  # smallest widths of the columns of labels and values
_MOST_ASIDE = 50  # largest number of sentences on rejected points
_MOST_LETTERS = 200  # largest number of letters of a heading with names of photographs


def adjustment_sheet(book, record):
    """Write statistics, groups, datum, instruments and check points of the adjustment."""
    adjustment, words = record["adjustment"], book.words
    headings = words["headings"]
    rejections = [make_sentence(entry) for entry in adjustment["aside"][:_MOST_ASIDE]]
    groups, *tables = (
        cell_table(book, table, title=headings[title], is_optional=True)
        for title, table in (
            ("adjusted_groups", GROUPS),
            ("adjusted_instruments", INSTRUMENTS),
            ("adjusted_systems", SYSTEMS),
            ("adjusted_checks", CHECK_POINTS),
        )
    )
    sections = [
        Facts(_statistics(adjustment, words)),
        Sentences(datum_sentences(words, adjustment), title=headings["adjusted_datum"]),
        Sentences(rejections),
        groups,
        Sentences(verdict_sentences(words, adjustment)),
        *tables,
    ]
    write_sheet(book, SheetContent("adjustment", sections, least=_LEAST))


def _statistics(adjustment, words):
    """Return (label, value, number format or None) of the statistics with values."""
    precision, checks = adjustment["precision"] or {}, adjustment["check_points"] or {}
    lines = [
        ("adjusted_points", len(adjustment["points"]), "0"),
        ("observations", adjustment["observations"], "0"),
        ("unknowns", adjustment["unknowns"], "0"),
        ("redundancy", adjustment["redundancy"], "0"),
        ("iterations", adjustment["iterations"], "0"),
        ("snooping", snooping_sentence(words, adjustment), None),
        ("sigma0", adjustment["sigma0"], "0.000"),
        ("global_test", global_test_sentence(words, adjustment), None),
        ("cov_scale", scale_sentence(words, adjustment), None),
        _millimetres("mean_sd", precision.get("mean_sd_m")),
        _millimetres("spherical_sd", precision.get("spherical_sd_m")),
        _millimetres("quadratic_sd", precision.get("quadratic_sd_m")),
        ("extent", precision.get("extent_m"), '0.0 "m"'),
        ("proportional", precision.get("proportional"), '"1 : "0'),
        _millimetres("r_xyz", checks.get("r_xyz_m")),
        _millimetres("largest_difference", checks.get("largest_m")),
        _millimetres("mean_difference", checks.get("mean_m")),
    ]
    labels = words["labels"]
    return [(labels[key], value, shown) for key, value, shown in lines if value is not None]


def _millimetres(label, size_m):
    """Return the line of a size in mm with three digits, as in the working papers."""
    size = None if size_m is None else 1000.0 * size_m
    return label, size, number_format(decimals_of(size, significant=3), unit="mm")


# ---- points


def points_sheet(book, record):
    """Write the surveyed points with their residuals and reasons of rejection.

    Points of an adjusted survey have standard deviations and error ellipsoids. Without a tank they
    have no residuals.
    """
    has_tank = record["capacity"] is not None
    code = "points" if has_tank else "adjusted_points"
    points = as_columns(record["points"])
    used = sum(points["used"]) if has_tank else 0
    subtitle = book.word(f"texts.{code}_subtitle", count=points.count, used=used)
    shown = _weakest(points)
    if len(shown) == MOST_POINTS:
        subtitle = book.word("texts.weakest_points", text=subtitle, shown=len(shown))
    without_sds = {} if record["adjustment"] else {f"s{axis}_m": {"sheet": None} for axis in "xyz"}
    muted = [index for index, row in enumerate(shown) if has_tank and not row["used"]]
    points = cell_table(
        book,
        POINTS.but(**without_sds),
        point_rows(record, shown),
        muted=muted,
        is_optional=True,
    )
    write_sheet(book, SheetContent(code, [points], subtitle, is_filtered=True))


def _weakest(points):
    """Return the rows; at most MOST_POINTS: unused points first, then the least precise."""
    if points.count >= MOST_POINTS:
        covariance = points.arrays["cov_m2"]
        is_known = covariance.ndim > 1
        # Trace of the covariance matrix of each point.
        variance = np.nan_to_num(np.einsum("nii->n", covariance)) if is_known else 0.0
        rank = np.lexsort((np.broadcast_to(-variance, points.count), points.arrays["used"]))
        points = points.take(np.sort(rank[:MOST_POINTS]))
    return list(points.rows())


# ---- observations


def observations_sheet(book, record):
    """Write a row for each reading; rejected readings are grey."""
    readings = as_columns(record["adjustment"]["residuals"])
    count = readings.count
    subtitle = book.word("texts.residuals_subtitle")
    if count > MOST_READINGS:
        subtitle = book.word("texts.worst_subtitle", shown=MOST_READINGS, all=count)
        size = np.abs(np.nan_to_num(readings.arrays["w"]))
        rank = np.lexsort((-size, ~readings.arrays["removed"]))
        readings = readings.take(np.sort(rank[:MOST_READINGS]))
    rows = list(convert_units(readings).rows())
    muted = [i for i, row in enumerate(rows) if row["removed"]]
    table = cell_table(book, READINGS, rows, name="observations", muted=muted)
    write_sheet(book, SheetContent("observations", [table], subtitle, is_filtered=True))


# ---- cameras and photographs


def cameras_sheet(book, record):
    """Write interior orientation with correlations, and photographs; no sheet without them."""
    adjustment = record["adjustment"]
    if not adjustment["photos"]:
        return
    sheet = book.sheet("cameras", landscape=True)
    photos = columns_of(book, PHOTOS)
    cameras = [
        columns_of(book, camera_table(camera["free"], book.words), camera_rows(camera))
        for camera in adjustment["cameras"]
    ]
    widths = set_widths(book, sheet, photos, *cameras)
    title = book.words["headings"]["adjusted_photos"]
    book.heading(sheet, HEAD_ROW, title, len(photos))
    row = HEAD_ROW + 1
    row = book.table(sheet, row, "photos", photos, autofilter=True, widths=widths) + 2
    for number, (camera, columns) in enumerate(zip(adjustment["cameras"], cameras, strict=True), 1):
        book.heading(sheet, row, _name_of_camera(camera), len(photos))
        book.put(sheet, row + 1, 0, _model_of_camera(book, camera))
        row = book.table(sheet, row + 2, f"camera_{number}", columns, widths=widths) + 2


def _name_of_camera(camera):
    if camera["photos"] is None:
        return camera["camera"]
    return f"{camera['camera']}: {', '.join(map(str, camera['photos']))}"[:_MOST_LETTERS]


def _model_of_camera(book, camera):
    """Return the convention of the distortion and the form of the affinity in words."""
    words, form = book.words, camera["affinity"]
    convention = words["conventions"][camera["convention"]]
    affinity = words["camera"]["affinities"].get(form, form)
    return book.word("texts.affinity", convention=convention, affinity=affinity)


_RULE_FACTS = (40, 16, 16, 16, 16, 16)  # widths of the columns of the facts of a rule
_FACT = 4  # column of the facts of the simulation, to the right of their labels


# ---- budgets


def budget_sheet(book, record):
    """Write the budgets of the top row and of all stated volumes and deliveries."""
    paper, capacity = book.paper, record["capacity"]
    top = {key: capacity[key][-1] for key in ("u_m3", "k", "U_m3")}
    height = paper.height(capacity["height_m"][-1])
    sheet = book.sheet("budget", book.word("texts.budget_subtitle", height=height), landscape=True)
    columns = _budget_columns(book, record["budget"], top["u_m3"])
    widths = set_widths(book, sheet, columns)
    row = _budget_table(book, sheet, HEAD_ROW, "budget", columns, widths)
    row = _totals(book, sheet, row, top)
    starts = []
    for number, stated in enumerate(record.get("budgets", []), 2):
        starts.append(row)
        columns = _budget_columns(book, stated["lines"], stated["u_m3"])
        high, low = paper.height(stated["high_m"]), paper.height(stated["low_m"])
        kind = "volume" if low is None else "delivery"
        title = book.word(f"headings.budget_{kind}", high=high, low=low)
        book.heading(sheet, row, title, len(columns))
        row = _budget_table(book, sheet, row + 1, f"budget_{number}", columns, widths)
        row = _totals(book, sheet, row, stated)
    book.keep_together(sheet, starts, row, widths)
    sheet.freeze_panes(HEAD_ROW + 1, 1)  # not repeated in print, since each budget has headings


def _budget_columns(book, lines, u_m3):
    return columns_of(book, budget.budget_table(decimals_of(u_m3) + 1), lines)


def _budget_table(book, sheet, row, name, columns, widths):
    """Write a budget with bars of the shares; return its last row."""
    last = CellTable(name, columns).write(book, sheet, row, widths) - 1
    heading = book.word("columns.share")
    share = next(i for i, column in enumerate(columns) if column.heading == heading)
    bar = {"type": "data_bar", "bar_color": "#B8CCE4", "bar_solid": True}
    bar |= {"min_type": "num", "min_value": 0, "max_type": "num", "max_value": 1}
    sheet.conditional_format(row + 1, share, last, share, bar)
    return last


def _totals(book, sheet, last, values):
    """Write u, k and k u below a budget; return the row of the next heading."""
    cubic = number_format(decimals_of(values["u_m3"]), unit="m³")
    for below, label, key, shown in (
        (2, "u_of_all", "u_m3", cubic),
        (3, "k_of_all", "k", "0.00"),
        (4, "U_of_all", "U_m3", cubic),
    ):
        book.put(sheet, last + below, 0, book.word(f"labels.{label}"), bold=True)
        book.put(sheet, last + below, 1, values[key], num_format=shown, bold=True)
    return last + 7


# ---- deliveries


def deliveries_sheet(book, record):
    """Write the stated volumes and deliveries, the operating levels, and the worst deliveries."""
    sections = [cell_table(book, stated_table(record), title=book.word("headings.stated"))]
    if record.get("limits"):
        title = book.word("headings.limits_of_tank")
        sections.append(cell_table(book, limits_table(record), title=title))
    worst = worst_delivery_rows(book.paper)
    if worst:
        title = book.word("headings.worst_deliveries")
        sections.append(cell_table(book, WORST_DELIVERIES, worst, title=title))
    write_sheet(book, SheetContent("deliveries", sections, tab="result"))


# ---- Monte Carlo


def monte_carlo_sheet(book, record):
    """Write mean, u and interval of the simulation with the GUM interval for all rows."""
    paper, sheet = book.paper, book.sheet("monte_carlo")
    columns = columns_of(book, monte_carlo.SIMULATED)
    widths = set_widths(book, sheet, columns)
    row = HEAD_ROW - 1
    for key, text in monte_carlo.facts(paper):
        row += 1
        book.put(sheet, row, 0, paper.label(key))
        book.paragraph_in(sheet, row, _FACT, text, widths[_FACT:])
    head = row + 2
    book.table(sheet, head, "monte_carlo", columns, autofilter=True, widths=widths)
    book.freeze(sheet, head, 1)


# ---- decision rule


def rule_sheet(book, record):
    """Write the rule, its verdict, the limits of U, and the limits of deviations."""
    paper = book.paper
    facts = [(paper.label(key), text, None) for key, text in rule.facts(paper) if text]
    tables = {"limits": rule.LIMITS}
    if record["rule"]["deviation"]:
        tables |= {"deviations": rule.DEVIATIONS, "acceptance": rule.ACCEPTANCE}
    sections = [
        Facts(facts, widths=_RULE_FACTS),
        *(
            cell_table(book, table, name=name, title=book.word(f"headings.{name}"))
            for name, table in tables.items()
        ),
        Sentences(rule.sentences(paper), widths=(*_RULE_FACTS, *_RULE_FACTS[1:4])),
    ]
    write_sheet(book, SheetContent("rule", sections, tab="result"))


_INSIDE_WIDTHS = (50, 16, 16, 16, 16)  # widths of the columns of the sheet inside, letters


def _course_tables(record):
    if not record["sections"]:
        return (tank.COURSES,)
    noise = (tank.HOMOGENEITY, tank.SECTION_NOISE) if record.get("homogeneity") else ()
    return (tank.COURSES, tank.SECTIONS, *noise, tank.modes_table(record), tank.SHELL)


def tables_sheets(book, record):
    """Write the sheet of courses, and the sheets of the methods whose content the record has."""
    if record.get("courses"):
        tables = _course_tables(record)
        _tables_sheet(
            book, "courses", "courses_subtitle", [(table.name, table) for table in tables]
        )
    for surveying in methods():
        if record.get(surveying.name):
            for code, subtitle, tables in surveying.sheets(record):
                _tables_sheet(book, code, subtitle, tables)


def _tables_sheet(book, code, subtitle, tables):
    """Write a sheet of tables, each under its heading [workbook.headings].<name>."""
    sections = [
        cell_table(book, table, name=name, title=book.word(f"headings.{name}"))
        for name, table in tables
    ]
    write_sheet(book, SheetContent(code, sections, book.word(f"texts.{subtitle}")))


def ship_sheet(book, record):
    """Write the corrections for trim and list: range of the pipe, and a table for each list."""
    sections = [cell_table(book, ship.CELLS, title=book.word("headings.ship_cells"))]
    for number, (list_deg, cells) in enumerate(ship.group_by_list(record), 1):
        columns = _correction_columns(book, record, cells)
        title = book.word("texts.ship_list", list=f"{list_deg:g}")
        sections.append(CellTable(f"ship_list_{number}", columns, title))
    write_sheet(book, SheetContent("ship", sections, book.word("texts.ship_subtitle")))


def _correction_columns(book, record, cells):
    """Return the columns soundings, correction (or state) at each trim, and largest U."""
    soundings, words = record["ship"]["sounding_m"], book.words["table_headings"]
    columns = [Column(f"{words['ship_sounding_m']}, m", soundings, 3, 12)]
    for cell in cells:
        values = [
            book.paper.word(f"ship_states.{state}") if state else 1000 * correction
            for state, correction in zip(cell["state"], cell["correction_m"], strict=True)
        ]
        heading = book.paper.word("texts.ship_trim", trim=f"{cell['trim_m']:g}")
        columns.append(Column(f"{heading}, mm", values, 1, 14))
    largest_U = [ship.largest_U_m(cells, index) for index in range(len(soundings))]
    in_mm = [None if U is None else 1000 * U for U in largest_U]
    return [*columns, Column(f"{words['ship_U']}, mm", in_mm, 1, 14)]


def corrections_sheet(book, record):
    """Write the corrections with their sizes at the top of the table."""
    digits = decimals_of(record["capacity"]["u_m3"][-1]) + 1
    table = cell_table(book, tank.CORRECTIONS.but(size_m3={"decimals": digits}))
    subtitle = book.word("texts.corrections_subtitle")
    sheet, row = write_sheet(book, SheetContent("corrections", [table], subtitle))
    gross_m3 = record["gross"] and record["gross"]["volume_m3"]
    for below, label, value in (
        (0, "gross_volume", gross_m3),
        (1, "top_row", record["capacity"]["volume_m3"][-1]),
    ):
        if value is not None:
            book.put(sheet, row + below, 0, book.word(f"labels.{label}"))
            book.put(sheet, row + below, 2, value, num_format=number_format(digits, unit="m³"))


def provenance_sheet(book, record):
    """Write choices, warnings, input files and versions of programs."""
    declared = (
        ("warnings", "warnings", tank.WARNINGS),
        ("files", "input_files", tank.FILES),
        ("programs", "programs", tank.PROGRAMS),
    )
    if record["job"].get("equipment"):
        declared += (("equipment", "equipment", tank.EQUIPMENT),)
    if record["job"].get("seals"):
        declared += (("seals", "seals", tank.SEALS),)
    choices = [choice_sentence(book.words, choice) for choice in record["choices"]]
    sections = [Sentences(choices, title=book.word("headings.choices"))]
    sections += [
        cell_table(book, table, name=name, title=book.word(f"headings.{title}"))
        for title, name, table in declared
    ]
    write_sheet(book, SheetContent("provenance", sections, landscape=False, tab="origin"))


# ---- the tank


def inside_sheet(book, record):
    """Write the dimensions of a solid, and bottom, deadwood, top and roof."""
    paper, corrections = book.paper, book.words["corrections"]
    sheet = book.sheet("inside")
    book.widths(sheet, *_INSIDE_WIDTHS)
    row = HEAD_ROW
    if record["solid"]:
        row = _write_facts(book, sheet, row, book.words["headings"]["dimensions"], record["solid"])
    for code in ("deadwood", "bottom", "top", "roof"):
        texts, declared = paper.choices(code), record.get(code)
        if not (texts or declared):
            continue
        title = corrections[code]
        if declared and code != "deadwood":
            row = _write_facts(book, sheet, row, title, declared) - 1
        else:
            book.heading(sheet, row, title, len(_INSIDE_WIDTHS))
            row += 1
        for text in texts:
            book.paragraph(sheet, row, text, _INSIDE_WIDTHS)
            row += 1
        if declared and code == "deadwood":
            row = book.table(sheet, row + 1, "deadwood", columns_of(book, tank.DEADWOOD)) + 1
        row += 1


def _write_facts(book, sheet, row, title, lines):
    """Write a heading and a line for each {code, value, unit}; return the next row."""
    words = book.words
    book.heading(sheet, row, title, len(_INSIDE_WIDTHS))
    for line in lines:
        row += 1
        value = line["value"]
        book.put(sheet, row, 0, words["labels"].get(line["code"], line["code"]))
        if line["unit"] is None:
            book.put(sheet, row, 1, words["parts"].get(value, value))
            continue
        shown, decimals = unit(line["unit"]), DECIMALS_OF_PARTS.get(line["unit"], 0)
        look = {"num_format": number_format(decimals)}
        book.put(sheet, row, 1, shown.factor * value, **look)
        book.put(sheet, row, 2, shown.symbol, indent=1)
    return row + 2
