"""Table of gross standard volumes: dips by densities and temperatures, each with its U, as files.

A table replaces the steps of a ticket where only dip, temperature and density are read. Readings
are exact: U contains the capacity table, its interpolation, the volume correction and the expansion
of the shell. The files are CSV, PDF or a workbook.
"""

import csv
import math
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from tankcal.errors import InputError, Problem
from tankcal.job.tables import Log
from tankcal.messages import as_plain, message
from tankcal.products.quantity.chain import QUANTITIES, Gauging, Transfer, values_of
from tankcal.products.quantity.reading import SECTIONS, SETTINGS_NAME, read_tickets
from tankcal.products.quantity.table import TankTable
from tankcal.products.settings import drop_blanks, read_sections
from tankcal.report import blocks
from tankcal.report.folders import replace_file
from tankcal.report.plain import PlainPaper
from tankcal.tank.volume_correction.petroleum import OutsideRangeError
from tankcal.text.digits import NOTHING, fixed, format_significant, shortest
from tankcal.text.words import load_words, message_sentence
from tankcal.version import find_version

MOST_CELLS = 200_000
_READINGS = ("u_dip_mm", "u_tape_ppm", "u_water_dip_mm", "u_temperature_k", "u_thermometer_k",
             "u_ambient_k", "u_density_kg_m3", "u_sw_percent")  # fmt: skip
_OPTIONS = {"temperature_c": "--temperatures", "density_kg_m3": "--densities"}


@dataclass(frozen=True)
class StandardTable:
    """Gross standard volumes of a tank.

    Attributes
    ----------
    table : TankTable
    correction : object
        Volume correction.
    dip_m : ndarray, shape (dips,)
    density_kg_m3 : ndarray, shape (densities,)
        Densities at the base temperature.
    temperature_c : ndarray, shape (temperatures,)
        Temperatures of the liquid.
    air_c : float or None
        Temperature of the air; None: the shell has the temperature of the liquid.
    vcf : ndarray, shape (densities, temperatures)
    ctsh : ndarray, shape (densities, temperatures, dips)
        Correction of the shell.
    volume_m3, U_m3, k : ndarray, shape (densities, temperatures, dips)
        Gross standard volume and its expanded uncertainty; nan where a floating roof does not
        float.
    probability : float
        Coverage probability.
    """

    table: TankTable
    correction: object
    dip_m: np.ndarray
    density_kg_m3: np.ndarray
    temperature_c: np.ndarray
    air_c: float | None
    vcf: np.ndarray
    ctsh: np.ndarray
    volume_m3: np.ndarray
    U_m3: np.ndarray
    k: np.ndarray
    probability: float


def compute_standard_table(table, settings, temperatures_c, densities, step_cm=10, air_c=None):
    """Compute gross standard volumes at each dip, density and temperature.

    Parameters
    ----------
    table : TankTable
    settings : Path
        A ticket.toml; its sections [product], [shell] and [uncertainty] are used.
    temperatures_c, densities : sequence of float
        Temperatures of the liquid, degC, and densities at the base, kg/m3.
    step_cm : int, optional
        Centimetres between two dips.
    air_c : float, optional
        Temperature of the air; None: the shell has the temperature of the liquid.

    Returns
    -------
    StandardTable

    Raises
    ------
    InputError
        For invalid settings, values outside the range of the volume correction, and a table with
        too many cells.
    """
    dips = list_dips(table, step_cm)
    shape = len(densities), len(temperatures_c), len(dips)
    _check_size(shape)
    plain = _transfer(table, settings, densities[0])
    density, temperature, dip = (
        part.ravel() for part in np.meshgrid(densities, temperatures_c, dips, indexing="ij")
    )
    correction = plain.product.correction
    _check_range(correction, densities, temperatures_c)
    # A roof that does not float has no valid volume; its cells are computed at a valid dip.
    is_critical = table.is_critical(dip)
    level = np.where(is_critical, table.height_m[-1], dip)
    count = len(level)
    product = replace(
        plain.product, density=density, sample_c=None, glass=np.ones(count),
        water_share=np.zeros(count), is_insulated=air_c is None,
        expansion_per_k=np.full(count, plain.product.expansion_per_k[0]),
    )  # fmt: skip
    air = np.full(count, np.nan if air_c is None else air_c)
    gauging = Gauging(level, np.full(count, np.nan), temperature, air, np.zeros(count))
    u = plain.u | dict.fromkeys(_READINGS, 0.0)
    transfer = Transfer(
        table, {"closing": gauging}, {"closing": level}, product, u, plain.probability
    )
    result, place = transfer.quantities()["closing"], QUANTITIES.index("gsv_m3")
    steps = values_of(transfer.steps["closing"])

    def cells(values):
        return np.where(is_critical, np.nan, values).reshape(shape)

    return StandardTable(
        table, correction, dips, np.array(densities), np.array(temperatures_c), air_c,
        steps["vcf"].reshape(shape)[:, :, 0], steps["ctsh"].reshape(shape),
        cells(result.value[:, place]), cells(result.U[:, place]), cells(result.k[:, place]),
        plain.probability,
    )  # fmt: skip


def list_dips(table, step_cm):
    """Dips of the table at whole multiples of a step in centimetres, m."""
    first, last = (100 * table.height_m[end] / step_cm for end in (0, -1))
    # The tolerance keeps a dip at a whole centimetre in spite of binary fractions.
    return np.arange(math.ceil(first - 1e-7), math.floor(last + 1e-7) + 1) * step_cm / 100


def _check_size(shape):
    """Refuse a table without dips, and too many cells."""
    count = math.prod(shape)
    if not 0 < count <= MOST_CELLS:
        text = message(
            "standard_cells", "the table would have {count} cells; expected 1 to {most}",
            count=count, most=MOST_CELLS,
        )  # fmt: skip
        raise InputError(Problem("--step-cm", text))


def _transfer(table, settings, density):
    """`Transfer` of a full tank with the product of a ticket.toml, which is checked so."""
    log = Log()
    product = [replace(field, required=field.required and field.name != "density_is")
               for field in SECTIONS["product"]]  # fmt: skip
    sections, _, _ = read_sections(settings, SECTIONS | {"product": product}, log)
    log.stop_if_problems()
    filled = drop_blanks(sections)
    product = filled.get("product", {}) | {"density_is": "base", "density_kg_m3": density}
    for key in ("density_temperature_c", "hydrometer", "sw_percent"):
        product.pop(key, None)
    if "factor_table" in product:  # beside the file of the settings
        product["factor_table"] = str(Path(settings).absolute().parent / product["factor_table"])
    kept = {name: filled[name] for name in ("ticket", "uncertainty") if name in filled}
    shell = filled.get("shell", {}) | {"insulated": True}
    correction_c = {"GPA-TP27": (60 - 32) / 1.8}.get(product.get("correction"), 15.0)
    closing = {"dip_m": float(table.height_m[-1]), "temperature_c": correction_c}
    probe = {**kept, "product": product, "shell": shell, "closing": closing}
    try:
        return read_tickets(table, probe).transfer
    except InputError as error:
        raise InputError(
            [_place_problem(problem, settings) for problem in error.problems]
        ) from error


def _place_problem(problem, settings):
    """Problem of the probe, with the file of the settings or the option of the density."""
    if problem.column == "product.density_kg_m3":
        return Problem(_OPTIONS["density_kg_m3"], problem.expected)
    is_setting = problem.file == str(SETTINGS_NAME)
    return replace(problem, file=Path(settings).name) if is_setting else problem


def _check_range(correction, densities, temperatures_c):
    """Report each density and temperature outside the range of the volume correction."""
    problems = {}
    for density in densities:
        for celsius in temperatures_c:
            try:
                correction.factor(np.array([density]), np.array([celsius]))
            except OutsideRangeError as error:
                option = _OPTIONS.get(error.quantity, "product")
                problem = Problem(option, error.expected_at((0,)))
                problems[str(problem)] = problem
    if problems:
        raise InputError([*problems.values()])


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
