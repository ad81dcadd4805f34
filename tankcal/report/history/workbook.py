"""A history as a workbook: every certificate, volume, radius, change and check, to sort."""

from dataclasses import replace

from tankcal.report.history.tables import (
    CERTIFICATES,
    CHANGES,
    CHECKS,
    RADII,
    VOLUMES,
    check_rows,
    radius_rows,
    volume_rows,
)
from tankcal.report.workbook.book import Book, about_saved
from tankcal.report.workbook.tables import HEAD_ROW, table_sheet

OF_ORIGINS = ("certificate", "tank", "origin", "tankcal", "method", "file", "sha256")
OF_TABLES = (
    "certificate", "date", "superseded", "number", "laboratory", "top_dip_m", "top_volume_m3",
    "U_top_m3", "k", "reference_temperature_c", "liquid_density_kg_m3", "reference_height_m",
    "nominal_diameter_m", "nominal_height_m", "zero", "sigma0", "global_test_passed",
    "rule_verdict",
)  # fmt: skip


def write(paper, path):
    """Write the workbook of a HistoryPaper; the same history gives the same bytes."""
    found = paper.found
    with Book(path, _about(paper), paper.words, about="history") as book:
        book.paper = paper
        certificates = found["certificates"]
        sheets = {
            "certificates": (CERTIFICATES.only(*OF_TABLES), certificates),
            "volumes": (VOLUMES, volume_rows(found)),
            "radii": (RADII, radius_rows(found)),
            "changes": (CHANGES, found["changes"]),
            "inspections": (CHECKS, check_rows(found)),
            "origins": (replace(CERTIFICATES.only(*OF_ORIGINS), name="origins"), certificates),
        }
        for code, (table, rows) in sheets.items():
            if rows:
                table_sheet(book, code, table, rows)
        _warnings(book, paper)


def _about(paper):
    found, newest = paper.found, paper.newest
    return about_saved(
        found["tankcal"],
        tank=found["tank"] or newest["file"],
        date=newest["date"],
        notice=found["notice"],
        laboratory=newest["laboratory"],
    )


def _warnings(book, paper):
    """What was left out, and what should be read."""
    sheet, row = book.sheet("warnings"), HEAD_ROW
    widths = (100,)
    book.widths(sheet, *widths)
    found = paper.found
    said = [paper.warning(one) for one in (*found["left_out"], *found["warnings"])]
    for text in (*said, *paper.words["standing_limits"].values()):
        book.paragraph(sheet, row, f"– {text}", widths)
        row += 1
