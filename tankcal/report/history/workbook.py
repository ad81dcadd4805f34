"""Workbook of a history: all certificates, volumes, radii, changes and checks, to sort."""

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

ORIGIN_COLUMNS = ("certificate", "tank", "origin", "tankcal", "method", "file", "sha256")
CERTIFICATE_COLUMNS = (
    "certificate", "date", "superseded", "number", "laboratory", "top_dip_m", "top_volume_m3",
    "U_top_m3", "k", "reference_temperature_c", "liquid_density_kg_m3", "reference_height_m",
    "nominal_diameter_m", "nominal_height_m", "zero", "sigma0", "global_test_passed",
    "rule_verdict",
)  # fmt: skip


def write(paper, path):
    """Write the workbook of a HistoryPaper; equal histories give equal bytes."""
    history, newest = paper.found, paper.newest
    about = about_saved(
        history["tankcal"],
        tank=history["tank"] or newest["file"],
        date=newest["date"],
        notice=history["notice"],
        laboratory=newest["laboratory"],
    )
    certificates = history["certificates"]
    origins = replace(CERTIFICATES.only(*ORIGIN_COLUMNS), name="origins")
    sheets = {
        "certificates": (CERTIFICATES.only(*CERTIFICATE_COLUMNS), certificates),
        "volumes": (VOLUMES, volume_rows(history)),
        "radii": (RADII, radius_rows(history)),
        "changes": (CHANGES, history["changes"]),
        "inspections": (CHECKS, check_rows(history)),
        "origins": (origins, certificates),
    }
    with Book(path, about, paper.words, about="history") as book:
        book.paper = paper
        for code, (table, rows) in sheets.items():
            if rows:
                table_sheet(book, code, table, rows)
        _warnings(book, paper)


def _warnings(book, paper):
    """Write the files left out, the warnings, and the limits of every history."""
    sheet, widths = book.sheet("warnings"), (100,)
    book.widths(sheet, *widths)
    entries = (*paper.found["left_out"], *paper.found["warnings"])
    texts = [paper.warning(entry) for entry in entries]
    texts += paper.words["standing_limits"].values()
    for row, text in enumerate(texts, HEAD_ROW):
        book.paragraph(sheet, row, f"– {text}", widths)
