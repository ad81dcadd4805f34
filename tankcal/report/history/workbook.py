"""Workbook of a history: all certificates, volumes, radii, changes and checks, to sort."""

from dataclasses import replace

from tankcal.report.history.tables import (
    CERTIFICATES,
    CHANGES,
    CHECKS,
    RADII,
    VOLUMES,
)
from tankcal.report.workbook.book import workbook_head
from tankcal.report.workbook.sections import Sentences, SheetContent, cell_table, write_workbook

ORIGIN_COLUMNS = ("certificate", "tank", "origin", "tankcal", "method", "file", "sha256")
CERTIFICATE_COLUMNS = (
    "certificate", "date", "superseded", "number", "laboratory", "top_dip_m", "top_volume_m3",
    "U_top_m3", "k", "reference_temperature_c", "liquid_density_kg_m3", "reference_height_m",
    "nominal_diameter_m", "nominal_height_m", "zero", "sigma0", "global_test_passed",
    "rule_verdict",
)  # fmt: skip
SHEETS = {
    "certificates": CERTIFICATES.only(*CERTIFICATE_COLUMNS),
    "volumes": VOLUMES,
    "radii": RADII,
    "changes": CHANGES,
    "inspections": CHECKS,
    "origins": replace(CERTIFICATES.only(*ORIGIN_COLUMNS), name="origins"),
}


def write(paper, path):
    """Write the workbook of a HistoryPaper; equal histories give equal bytes."""
    history, newest = paper.record, paper.newest
    head = workbook_head(
        history["tankcal"],
        tank=history["tank"] or newest["file"],
        date=newest["date"],
        notice=history["notice"],
        laboratory=newest["laboratory"],
    )
    write_workbook(paper, path, "history", head, sheets)


def sheets(book):
    """Yield the content of each sheet, in order; no sheet for a table without rows."""
    paper, history = book.paper, book.paper.record
    for code, table in SHEETS.items():
        if table.rows(history):
            yield SheetContent(code, [cell_table(book, table)], tab="result", is_filtered=True)
    # The files left out, the warnings, and the limits of every history.
    entries = (*history["left_out"], *history["warnings"])
    texts = [paper.warning(entry) for entry in entries]
    texts += paper.words["standing_limits"].values()
    sentences = Sentences([f"– {text}" for text in texts])
    yield SheetContent("warnings", [sentences], landscape=False, widths=(100,))
