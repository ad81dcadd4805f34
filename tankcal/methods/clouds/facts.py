"""Fact of a scanned wall on certificate and workbook."""

from tankcal.report.tables.table import Column


def _scanned(paper, row):
    """Return a sentence on the point clouds with their numbers of points, or None."""
    clouds = paper.record.get("clouds")
    if not clouds:
        return None
    scans = clouds["scans"]
    return paper.word(
        "texts.cloud_method",
        scans=len(scans),
        files=len(clouds["files"]),
        wall=sum(scan["of_wall"] for scan in scans),
        read=sum(scan["delivered"] for scan in scans),
        means=sum(scan["readings"] for scan in scans),
    )


FACTS = (Column("scanned", text=_scanned, sheet=True),)
