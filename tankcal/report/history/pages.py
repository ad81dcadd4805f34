"""What a history says, block by block: certificates, volumes, radii, changes, inspections."""

from tankcal.report import blocks
from tankcal.report.history import figures
from tankcal.report.history.tables import (
    CERTIFICATES,
    CHANGES,
    CHECKS,
    DIGEST,
    RADII,
    VOLUMES,
    check_rows,
    radius_rows,
    volume_rows,
)
from tankcal.report.plain import Column
from tankcal.report.saved_paper import bearable

MOST_ROWS = 60  # of one table of the PDF: workbook, page and CSV have the others
FILES = (Column("certificate", decimals=0), Column("file"), Column("sha256"))


def pages(paper, folder=None, whole=False):
    """The blocks of a HistoryPaper.

    folder  of the files that the PDF holds inside; None: none
    whole   True: with every row, for the web page
    """
    return [
        *paper.head(folder),
        blocks.result(paper.word("labels.history"), _span(paper), _summary(paper)),
        *certificates(paper),
        *volumes(paper, whole),
        *radii(paper, whole),
        *changes(paper),
        *inspections(paper),
        *limits(paper),
        *files(paper),
    ]


def _span(paper):
    found = paper.found["certificates"]
    values = {"first": paper.day(found[0]["date"]), "last": paper.day(found[-1]["date"])}
    if len(found) == 1:
        return paper.word("texts.one_certificate", **values)
    return paper.word("texts.span", count=len(found), **values)


def _summary(paper):
    """How many of the changes are more than the uncertainties explain."""
    changes = paper.found["changes"]
    known = [one for one in changes if one["worst_E_n"] is not None]
    if not changes:
        return paper.word("texts.nothing_to_compare")
    if not known:
        return paper.word("texts.no_E_n_at_all")
    beyond = [one for one in known if abs(one["worst_E_n"]) > 1]
    return paper.word("texts.changes_beyond", beyond=len(beyond), known=len(known))


def certificates(paper):
    """The list, and what each table is for; columns that say nothing are left out."""
    rows = paper.found["certificates"]
    known = {key for row in rows for key, value in row.items() if value is not None}
    table = CERTIFICATES.only(*known)
    return [
        paper.heading("certificates"),
        paper.show(table, rows),
        paper.show(table, rows, on="certificate_facts"),
    ]


def volumes(paper, whole):
    """Volumes at some dips on one basis, and their figure."""
    rows = volume_rows(paper.found)
    newest = paper.newest
    return [
        paper.heading("volumes"),
        paper.paragraph(
            "volumes",
            date=paper.day(newest["date"]),
            k=paper.number(paper.found["coverage_k"], decimals=2),
        ),
        paper.figure(figures.volumes(paper), "volumes"),
        *_table(paper, VOLUMES, rows, whole),
    ]


def radii(paper, whole):
    """Radii of the courses on one basis, and their figure."""
    rows = radius_rows(paper.found)
    if not rows:
        return [paper.heading("radii"), paper.paragraph("no_radii")]
    return [
        paper.heading("radii"),
        paper.paragraph("radii"),
        paper.figure(figures.radii(paper), "radii"),
        *_table(paper, RADII, rows, whole),
    ]


def changes(paper):
    """Each table against the one before."""
    found = paper.found["changes"]
    if not found:
        return []
    lacking = [one for one in found if one["not_made"]]
    said = [
        paper.word(
            "texts.not_made",
            former=str(one["former"]),
            new=str(one["new"]),
            steps=", ".join(paper.words["steps"].get(step, step) for step in one["not_made"]),
        )
        for one in lacking
    ]
    known = any(one["worst_E_n"] is not None for one in found)
    return [
        paper.heading("changes"),
        paper.paragraph("changes"),
        *([paper.figure(figures.normalised(paper), "normalised")] if known else []),
        paper.show(CHANGES, found),
        *([blocks.listing(said)] if said else []),
    ]


def inspections(paper):
    """The worst figure of each check of each inspection."""
    rows = check_rows(paper.found)
    if not rows:
        return []
    drawn = figures.limited_checks(paper.found)
    return [
        paper.heading("inspections"),
        paper.paragraph("inspections"),
        *([paper.figure(figures.checks(paper), "inspections")] if drawn else []),
        paper.show(CHECKS, rows),
    ]


def limits(paper):
    """What was left out, warnings, and what limits every history."""
    found = paper.found
    out = [paper.warning(one) for one in found["left_out"]]
    said = [paper.warning(one) for one in found["warnings"]]
    said += paper.words["standing_limits"].values()
    return [
        *([paper.heading("left_out"), blocks.listing(out)] if out else []),
        paper.heading("limits"),
        blocks.listing(said),
    ]


def files(paper):
    """Where each table was found, by its hash."""
    rows = [
        {
            "certificate": one["certificate"],
            "file": bearable(one["file"]),
            "sha256": f"{one['sha256'][:DIGEST]}…",
        }
        for one in paper.found["certificates"]
    ]
    return [paper.heading("files"), paper.table("files", rows, FILES)]


def _table(paper, table, rows, whole):
    """A table, of its first rows where the page has no room for all of them."""
    if whole or len(rows) <= MOST_ROWS:
        return [paper.show(table, rows, across=1 if len(rows) > MOST_ROWS else None)]
    return [
        paper.show(table, rows[:MOST_ROWS]),
        paper.paragraph("first_rows", shown=MOST_ROWS, all=len(rows)),
    ]
