"""Blocks of the report of a history: certificates, volumes, radii, changes, inspections."""

from tankcal.report import blocks
from tankcal.report.history import figures
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
from tankcal.report.plain import Column
from tankcal.report.saved_paper import bearable

MOST_ROWS = 60  # largest number of rows of a table in the PDF; workbook, page and CSV have all
DIGEST = 12  # number of printed digits of a SHA-256
FILE_COLUMNS = (Column("certificate", decimals=0), Column("file"), Column("sha256"))


def pages(paper, folder=None, whole=False):
    """Return the blocks of a HistoryPaper.

    Parameters
    ----------
    paper : HistoryPaper
    folder : Path, optional
        Folder of the files that the PDF embeds; None: no files.
    whole : bool, optional
        Whether every row is shown, as on the web page.

    Returns
    -------
    list of Block
    """
    return [
        *paper.head(folder),
        blocks.result(paper.word("labels.history"), _span(paper), _summary(paper)),
        *_certificates(paper),
        *_volumes(paper, whole),
        *_radii(paper, whole),
        *_changes(paper),
        *_inspections(paper),
        *_limits(paper),
        *_files(paper),
    ]


def _span(paper):
    """Return the number of certificates, and the dates of the first and the last one."""
    certificates = paper.record["certificates"]
    dates = {
        "first": paper.day(certificates[0]["date"]),
        "last": paper.day(certificates[-1]["date"]),
    }
    if len(certificates) == 1:
        return paper.word("texts.one_certificate", **dates)
    return paper.word("texts.span", count=len(certificates), **dates)


def _summary(paper):
    """Return how many changes exceed their uncertainty."""
    changes = paper.record["changes"]
    known = [change for change in changes if change["worst_E_n"] is not None]
    if not changes:
        return paper.word("texts.nothing_to_compare")
    if not known:
        return paper.word("texts.no_E_n_at_all")
    beyond = [change for change in known if abs(change["worst_E_n"]) > 1]
    return paper.word("texts.changes_beyond", beyond=len(beyond), known=len(known))


def _certificates(paper):
    """Return the certificates and the basis of their tables, without empty columns."""
    rows = paper.record["certificates"]
    known = {key for row in rows for key, value in row.items() if value is not None}
    table = CERTIFICATES.only(*known)
    return [
        paper.heading("certificates"),
        paper.show(table, rows),
        paper.show(table, rows, on="certificate_facts"),
    ]


def _volumes(paper, whole):
    """Return the volumes at some dips on one basis, and their figure."""
    return [
        paper.heading("volumes"),
        paper.paragraph(
            "volumes",
            date=paper.day(paper.newest["date"]),
            k=paper.number(paper.record["coverage_k"], decimals=2),
        ),
        paper.figure(figures.volumes(paper), "volumes"),
        *_table(paper, VOLUMES, volume_rows(paper.record), whole),
    ]


def _radii(paper, whole):
    """Return the radii of the courses on one basis, and their figure."""
    rows = radius_rows(paper.record)
    if not rows:
        return [paper.heading("radii"), paper.paragraph("no_radii")]
    return [
        paper.heading("radii"),
        paper.paragraph("radii"),
        paper.figure(figures.radii(paper), "radii"),
        *_table(paper, RADII, rows, whole),
    ]


def _changes(paper):
    """Return the comparisons of each table with the one before, and their omitted steps."""
    changes = paper.record["changes"]
    if not changes:
        return []
    omissions = [
        paper.word(
            "texts.not_made",
            former=str(change["former"]),
            new=str(change["new"]),
            steps=", ".join(paper.words["steps"].get(step, step) for step in change["not_made"]),
        )
        for change in changes
        if change["not_made"]
    ]
    is_E_n_known = any(change["worst_E_n"] is not None for change in changes)
    return [
        paper.heading("changes"),
        paper.paragraph("changes"),
        *([paper.figure(figures.normalised(paper), "normalised")] if is_E_n_known else []),
        paper.show(CHANGES, changes),
        *([blocks.listing(omissions)] if omissions else []),
    ]


def _inspections(paper):
    """Return the worst result of each check of each inspection."""
    rows = check_rows(paper.record)
    if not rows:
        return []
    has_figure = bool(figures.limited_checks(paper.record))
    return [
        paper.heading("inspections"),
        paper.paragraph("inspections"),
        *([paper.figure(figures.checks(paper), "inspections")] if has_figure else []),
        paper.show(CHECKS, rows),
    ]


def _limits(paper):
    """Return the files left out, the warnings, and the limits of every history."""
    left_out = [paper.warning(entry) for entry in paper.record["left_out"]]
    texts = [paper.warning(entry) for entry in paper.record["warnings"]]
    texts += paper.words["standing_limits"].values()
    return [
        *([paper.heading("left_out"), blocks.listing(left_out)] if left_out else []),
        paper.heading("limits"),
        blocks.listing(texts),
    ]


def _files(paper):
    """Return the file of each table, with the first digits of its SHA-256."""
    rows = [
        {
            "certificate": entry["certificate"],
            "file": bearable(entry["file"]),
            "sha256": f"{entry['sha256'][:DIGEST]}…",
        }
        for entry in paper.record["certificates"]
    ]
    return [paper.heading("files"), paper.table("files", rows, FILE_COLUMNS)]


def _table(paper, table, rows, whole):
    """Return a table, or its first rows and a note if the PDF has no space for all rows."""
    if whole or len(rows) <= MOST_ROWS:
        return [paper.show(table, rows, across=1 if len(rows) > MOST_ROWS else None)]
    return [
        paper.show(table, rows[:MOST_ROWS]),
        paper.paragraph("first_rows", shown=MOST_ROWS, all=len(rows)),
    ]
