"""Prediction and field sheets as PDFs, and the figure of what helps as a picture."""

from tankcal.report.pdf import pdf
from tankcal.report.planning import figures
from tankcal.report.planning.field_sheets import sheets
from tankcal.report.planning.outlook import outlook


def write(paper, folder):
    """Write prediction.pdf, field-sheets.pdf and, where changes were tried, changes.png."""
    for name, blocks in (("prediction.pdf", outlook(paper)), ("field-sheets.pdf", sheets(paper))):
        (folder / name).write_bytes(pdf([block.data for block in blocks], folder))
    if any(not one.why for one in paper.effects):
        figures.changes(paper).savefig(folder / "changes.png", dpi=150)
