"""Files of `tankcal inspect`: the inspection as data, PDF and workbook.

All files are written from inspection.json; no number is computed here. No file belongs to a
capacity certificate.
"""

from tankcal.record.inspection import INSPECTION
from tankcal.report.inspection.tables import InspectionPaper
from tankcal.report.saved_document import SavedDocument

__all__ = ["DOCUMENT", "InspectionPaper", "rebuild", "refuse_foreign", "write_inspection"]


def _load_renderers():
    from tankcal.report.inspection.pages import pages, write_sheets

    return pages, write_sheets


DOCUMENT = SavedDocument(
    INSPECTION,
    InspectionPaper,
    _load_renderers,
    has_page=False,
)
refuse_foreign, rebuild = DOCUMENT.refuse_foreign, DOCUMENT.rebuild
write_inspection = DOCUMENT.write
