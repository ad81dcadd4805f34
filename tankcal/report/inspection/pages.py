"""Report of an inspection, and its workbook with numbers as numbers.

Result, subject, checks and limits; the blocks of wall, welds and bottom are in `wall` and `bottom`.
"""

from tankcal.report import blocks
from tankcal.report.comparison.pages import FILE_COLUMNS
from tankcal.report.inspection.bottom import edges, points, settlements
from tankcal.report.inspection.paper import UNVERIFIED, verdict_of
from tankcal.report.inspection.tables import (
    CHECKS,
    COURSES,
    EDGES,
    GAPS,
    GENERATRICES,
    LEVELS,
    LIMITS,
    PLACES,
    PLANES,
    POINTS,
    READINGS,
    SHEET_OF_CHECKS,
    course_rows,
    gap_rows,
    generatrix_rows,
    level_rows,
    limit_rows,
    place_rows,
    plane_rows,
    point_rows,
    reading_rows,
    sheet_rows,
)
from tankcal.report.inspection.wall import courses, departures, levels, welds
from tankcal.report.saved_document import bearable, shortened
from tankcal.report.workbook.book import workbook_head
from tankcal.report.workbook.sections import (
    FIRST_LINE,
    Sentences,
    SheetContent,
    cell_table,
    write_workbook,
)
from tankcal.text.digits import NOTHING

SHOWN = ("table", "columns_table", "figure")
SHORT = 12  # largest number of rows of a table that page.typ keeps on one page

# Verdicts, the most severe first.
ORDER = ("failed", "guard_band_beyond", "guard_band", "not_determined", "no_limit", "passed")
# Tables of each sheet after the checks, with the function of their rows.
SHEETS = {
    "generatrices": ((GENERATRICES, generatrix_rows),),
    "levels": ((LEVELS, level_rows), (COURSES, course_rows), (PLACES, place_rows)),
    "welds": ((GAPS, gap_rows),),
    "settlement": ((PLANES, plane_rows), (POINTS, point_rows)),
    "edges": ((EDGES, EDGES.rows), (READINGS, reading_rows)),
}


def pages(paper, folder=None):
    """List the blocks of an InspectionPaper; `folder` has the files attached to the PDF."""
    return keep_end_together(
        [
            *paper.head(folder),
            *result(paper),
            *subject(paper),
            *checks(paper),
            *limits(paper),
            *reading(paper),
            *departures(paper),
            *levels(paper),
            *courses(paper),
            *welds(paper),
            *settlements(paper),
            *edges(paper),
            *points(paper),
        ]
    )


def keep_end_together(page_blocks):
    """Keep the last table on one page with the table or figure before it.

    A few rows alone would leave the last page nearly empty. Long tables are not kept together.
    """
    shown = [i for i, block in enumerate(page_blocks) if block.data["kind"] in SHOWN]
    if len(shown) < 2:
        return page_blocks
    first, last = shown[-2:]
    page_blocks = list(page_blocks)
    if SHORT < len(page_blocks[last].data.get("rows", ())) <= 2 * SHORT:
        page_blocks[last] = blocks.whole(page_blocks[last])
    before = page_blocks[first].data
    if len(before.get("rows", ())) <= SHORT * before.get("across", 1):
        page_blocks[first:last] = map(blocks.with_next, page_blocks[first:last])
    return page_blocks


def result(paper):
    """Frame with the number of checks of each verdict; there is no verdict of all checks."""
    return [
        blocks.result(paper.word("labels.result"), counts(paper), rule_text(paper)),
        paper.paragraph("not_of_certificate"),
    ]


def rule_text(paper):
    """Sentence with the rule, and whether it was read in the standard itself."""
    rule = paper.record["rule"]
    if not rule:
        return paper.word("texts.no_rule")
    verified = paper.word(f"verified.{rule['verified']}")
    return paper.word("texts.by_rule", rule=bearable(rule["name"]), verified=verified)


def counts(paper):
    """Text with the number of checks of each verdict: "1 beyond the limit, 8 within it"."""
    verdicts = [verdict_of(check) for check in paper.record["checks"]]
    counted = [
        paper.word(f"counted.{code}_{'one' if verdicts.count(code) == 1 else 'many'}",
                   count=verdicts.count(code))
        for code in ORDER
        if code in verdicts
    ]  # fmt: skip
    return "; ".join(counted) or paper.word("texts.no_checks")


def subject(paper):
    """Blocks on the tank, its survey and the rule."""
    tank, rule = paper.record["tank"], paper.record["rule"]
    files = [{"file": shortened(tank["file"]), "sha256": tank["sha256"]}]
    return [
        paper.heading("subject"),
        paper.facts([*_tank(paper, tank), *_survey(paper, tank)]),
        *([paper.table("files", files, FILE_COLUMNS)] if tank["sha256"] else []),
        *([paper.facts(_rule(paper, rule))] if rule else []),
    ]


def _tank(paper, tank):
    """Facts about the tank."""
    diameter = paper.number(tank["nominal_diameter_m"], "m", decimals=3)
    if diameter is not None:
        source = paper.words["nominal_sources"].get(tank["nominal_source"], tank["nominal_source"])
        diameter = f"{diameter} ({source})"
    return [
        ("tank", bearable(tank["id"])),
        ("job", bearable(tank["name"])),
        ("nominal_diameter", diameter),
        ("shell_height", paper.number(tank["height_m"], "m", decimals=3)),
    ]


def _survey(paper, tank):
    """Facts about the survey."""
    source = paper.words["sources_of_inspections"].get(tank["source"], tank["source"])
    methods = [paper.words["methods"].get(method, bearable(method)) for method in tank["methods"]]
    side = tank["survey_side"]
    return [
        ("survey_date", paper.day(paper.date() or None) or paper.word("texts.not_known")),
        ("methods", ", ".join(methods)),
        ("surface", side and paper.words["surfaces"].get(side, side)),
        ("state", side and paper.words["states"].get(tank["state"], tank["state"])),
        ("made_of", source if tank["sha256"] else f"{source}: {shortened(tank['file'])}"),
    ]


def _rule(paper, rule):
    """Facts about the rule."""
    return [
        ("rule", bearable(rule["name"])),
        ("rule_file", shortened(rule["file"])),
        ("rule_source", bearable(rule["source"])),
        ("rule_verified", paper.word(f"verified.{rule['verified']}")),
        ("rule_remark", bearable(rule["remark"])),
    ]


# ---- the checks


def checks(paper):
    """Blocks with the table of checks, the decision rule, and remarks on checks."""
    entries = paper.record["checks"]
    if not entries:
        return []
    sentences = remarks(paper)
    unread = any(check["limit"] is not None and not check["limit"]["verified"] for check in entries)
    return [
        paper.heading("checks"),
        paper.show(CHECKS, CHECKS.rows(paper.record)),
        *([paper.paragraph("unverified", mark=UNVERIFIED)] if unread else []),
        blocks.paragraph(_decision(paper)),
        *([paper.heading("remarks", 2), blocks.listing(sentences)] if sentences else []),
    ]


def remarks(paper):
    """Sentences with the remarks on checks; equal remarks on several checks are joined."""
    places_by_remark = {}
    for check in paper.record["checks"]:
        if check["remark"] is not None:
            remark = (paper.check_name(check["code"]), paper.remark(check))
            places_by_remark.setdefault(remark, []).append(paper.place(check))
    return [
        f"{name}{_place_in_brackets(places)}: {remark}"
        for (name, remark), places in places_by_remark.items()
    ]


def _place_in_brackets(places):
    """The place of a remark in brackets; "" for several places or no place."""
    return f" ({places[0]})" if len(places) == 1 and places != [NOTHING] else ""


def _decision(paper):
    """Sentence with the decision rule of this file and its coverage factors."""
    factors = sorted({round(check["k"], 2) for check in paper.record["checks"] if check["k"]})
    k = "; ".join(paper.number(factor, decimals=2) for factor in factors)
    decision = paper.record["decision"]
    rule = "" if decision == "guarded" else f"_{decision}"
    return paper.word(f"texts.decision{'' if k else '_without_k'}{rule}", k=k)


def limits(paper):
    """Blocks with the clause of each limit, and whether the limit was read there."""
    rows = limit_rows(paper)
    return [paper.heading("limits"), paper.show(LIMITS, rows)] if rows else []


def reading(paper):
    """Blocks with the limitations of an inspection, and its warnings."""
    inspection = paper.record
    sentences = [
        paper.word("texts.as_built" if inspection["as_built"] else "texts.as_built_unknown")
    ]
    if inspection["rule"] and not inspection["rule"]["verified"]:
        sentences.append(paper.word("texts.rule_not_read"))
    if inspection["generatrices"] is not None or inspection["levels"]:
        sentences.append(paper.word("texts.surface_of_radii"))
    sentences += paper.words["standing_limits"].values()
    sentences += [paper.warning(warning) for warning in inspection["warnings"]]
    return [paper.heading("reading"), blocks.listing(sentences)]


# ---- workbook


def write_sheets(paper, path):
    """Write the workbook of an InspectionPaper; equal inspections give equal bytes."""
    inspection, tank = paper.record, paper.record["tank"]
    head = workbook_head(
        inspection["tankcal"],
        tank=bearable(tank["id"]),
        date=tank["survey_date"],
        notice=inspection["notice"],
    )
    write_workbook(paper, path, "inspection", head, sheets)


def sheets(book):
    """Yield the content of each sheet, in order; tables without rows are omitted."""
    yield _checks_sheet(book, book.paper)
    for code, declared in SHEETS.items():
        tables = [
            cell_table(book, table, rows)
            for table, rows_of in declared
            if (rows := rows_of(book.paper.record))
        ]
        if tables:
            is_single = len(tables) == 1
            yield SheetContent(code, tables, is_filtered=is_single, repeats_headings=True)


def _checks_sheet(book, paper):
    """Return the result and its scope, all checks with their limits, remarks and warnings."""
    inspection = paper.record
    as_built = paper.word("texts.as_built" if inspection["as_built"] else "texts.as_built_unknown")
    scope = [rule_text(paper), paper.word("texts.not_of_certificate"), as_built]
    sections = [
        (Sentences([counts(paper)], look=FIRST_LINE), Sentences(scope)),
        cell_table(book, SHEET_OF_CHECKS, sheet_rows(paper)),
        Sentences([*remarks(paper), *map(paper.warning, inspection["warnings"])]),
    ]
    return SheetContent("checks", sections, tab="result", repeats_headings=True)
