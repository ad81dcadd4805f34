"""Files of `tankcal standard`: gross standard volumes as CSV, PDF or workbook."""

import csv

import numpy as np

from tankcal.messages import as_plain
from tankcal.report import blocks
from tankcal.report.folders import replace_file
from tankcal.report.plain import PlainPaper
from tankcal.text.digits import NOTHING, fixed, format_significant, shortest
from tankcal.text.words import load_words, message_sentence
from tankcal.version import find_version

SUFFIXES = (".csv", ".pdf", ".xlsx")
MOST_COLUMNS = 9  # temperatures side by side on a page
COLUMNS = ("dip_m", "density_kg_m3", "temperature_c", "vcf", "ctsh", "gsv_m3", "U_gsv_m3", "k")


def write_standard_table(standard, path, language):
    """Write a table of gross standard volumes; the ending of the path names the kind of file.

    Parameters
    ----------
    standard : products.quantity.standard_table.StandardTable
    path : Path
        File with an ending of SUFFIXES; an existing file is replaced.
    language : str
        One of `shipped.LANGUAGES`.
    """
    from tankcal.report.pdf import pdf

    paper = PlainPaper(load_words(language))
    with replace_file(path) as temporary:
        if path.suffix.lower() == ".csv":
            with temporary.open("w", encoding="utf-8", newline="") as stream:
                csv.writer(stream, lineterminator="\n").writerows([COLUMNS, *csv_rows(standard)])
        elif path.suffix.lower() == ".pdf":
            shown = pages(standard, paper, language)
            temporary.write_bytes(pdf([block.data for block in shown]))
        else:
            _write_workbook(standard, paper, temporary)


def csv_rows(standard):
    """Rows of the CSV file, a row for each dip, density and temperature (list of list)."""
    rows = []
    for place, volume in np.ndenumerate(standard.volume_m3):
        density, temperature, dip = place
        rows.append([
            float(standard.dip_m[dip]), float(standard.density_kg_m3[density]),
            float(standard.temperature_c[temperature]), float(standard.vcf[density, temperature]),
            float(standard.ctsh[place]),
            *("" if np.isnan(volume) else float(part[place])
              for part in (standard.volume_m3, standard.U_m3, standard.k)),
        ])  # fmt: skip
    return rows


def pages(standard, paper, language):
    """Return the blocks of the PDF: a table of dips by temperatures for each density."""
    table, title = standard.table, paper.word("standard.title")
    certificate = table.certificate
    shown = [
        blocks.document(
            title=f"{title} {table.tank}", language=language, date=table.date[:10],
            notice=str(certificate.get("notice") or ""),
            running=[title, " ".join([paper.word("page.tank"), table.tank])],
            footer=f"tankcal {find_version()} · record.json SHA-256 {table.digest[:16]}",
            record_sha256=table.digest,
        ),
        blocks.masthead(title),
        blocks.key_values(facts(standard, paper)),
        blocks.paragraph(note(standard, paper)),
    ]  # fmt: skip
    heads = headings(standard, paper)
    for place, density in enumerate(standard.density_kg_m3):
        shown += [
            blocks.heading(density_title(paper, density)),
            blocks.table(
                heads, _density_cells(standard, paper, place), align=["right"] * len(heads)
            ),
        ]
    return shown


def facts(standard, paper):
    """Labels and values above the tables (list of (str, str))."""
    table, marks = standard.table, paper.marks
    certificate = " · ".join(filter(None, (table.certificate.get("number"), table.date[:10])))
    name = as_plain(standard.correction.name)
    return [
        (paper.word("page.tank"), table.tank),
        (paper.word("chart.number"), certificate or NOTHING),
        (paper.word("standard.correction"),
         message_sentence(paper.words, str(standard.correction.name), **name)),
        (paper.word("chart.uncertainty"), paper.word(
            "standard.largest_U",
            U=format_significant(float(np.nanmax(standard.U_m3)), 2, marks),
            probability=paper.percent(standard.probability))),
    ]  # fmt: skip


def note(standard, paper):
    """Sentences on the contents of the volumes and of U."""
    marks = paper.marks
    texts = [paper.word("standard.use")]
    if standard.air_c is None:
        texts.append(paper.word("standard.shell_as_liquid"))
    else:
        air = shortest(standard.air_c, marks)
        texts.append(paper.word("standard.shell_in_air", temperature=air))
    if np.isnan(standard.volume_m3).any():
        texts.append(paper.word("standard.critical", sign=NOTHING))
    return " ".join(texts)


def density_title(paper, density):
    """Heading of the table of a density."""
    return paper.word("standard.density", density=shortest(float(density), paper.marks))


def headings(standard, paper):
    """Headings [text, unit] of the columns."""
    texts = [shortest(float(celsius), paper.marks) for celsius in standard.temperature_c]
    temperatures = [[f"{text} °C", "m³"] for text in texts]
    return [[paper.word("standard.dip"), "cm"], *temperatures, [paper.word("standard.U"), "m³"]]


def _density_cells(standard, paper, place):
    """Texts of the cells of a density, with the volume correction factors in the first row."""
    marks = paper.marks
    factors = [fixed(float(factor), 5, marks) for factor in standard.vcf[place]]
    rows = [[paper.word("standard.vcf"), *factors, ""]]
    for dip, volumes, largest in _lines(standard, place):
        cells = [None if np.isnan(volume) else fixed(volume, 3, marks) for volume in volumes]
        U = None if np.isnan(largest) else format_significant(largest, 2, marks)
        rows.append([shortest(dip, marks), *cells, U])
    return rows


def _lines(standard, place):
    """Yield (dip, cm; volumes at each temperature; largest U of the row) of a density."""
    for row, dip in enumerate(standard.dip_m):
        U = standard.U_m3[place, :, row]
        largest = float("nan") if np.isnan(U).all() else float(np.nanmax(U))
        yield round(100 * float(dip), 6), standard.volume_m3[place, :, row].tolist(), largest


def _write_workbook(standard, paper, path):
    """Write a sheet with the tables of all densities."""
    from tankcal.report.workbook.book import workbook_head
    from tankcal.report.workbook.look import Column
    from tankcal.report.workbook.sections import CellTable, Sentences, SheetContent, write_workbook

    table = standard.table

    def sheets(book):
        known = [f"{label}: {value}" for label, value in facts(standard, book.paper)]
        sections = [Sentences([*known, note(standard, book.paper)])]
        for place, density in enumerate(standard.density_kg_m3):
            dips, volumes, largest = zip(*_lines(standard, place), strict=True)
            values = [list(column) for column in zip(*volumes, strict=True)]
            heads = [f"{text} ({unit})" for text, unit in headings(standard, book.paper)]
            columns = [Column(heads[0], list(dips), 0)]
            for head, cells in zip(heads[1:-1], values, strict=True):
                columns.append(Column(head, [_number(cell) for cell in cells], 3))
            columns.append(Column(heads[-1], [_number(cell) for cell in largest], 3))
            title = density_title(book.paper, density)
            factors = "; ".join(fixed(float(factor), 5, book.paper.marks)
                                for factor in standard.vcf[place])  # fmt: skip
            vcf = book.paper.word("standard.vcf")
            title = f"{title}; {vcf} {factors}"
            sections.append(CellTable(f"standard_{place + 1}", columns, title))
        yield SheetContent("standard", sections, tab="result")

    head = workbook_head(
        find_version(), tank=table.tank, date=table.date[:10] or None,
        notice=str(table.certificate.get("notice") or ""),
    )  # fmt: skip
    write_workbook(paper, path, "standard", head, sheets)


def _number(value):
    return None if np.isnan(value) else value
