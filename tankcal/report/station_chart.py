"""Field chart of a small tank: litres at each centimetre on a page, in large type.

The chart is for the wall of a fuel station, where a dip stick is read in whole centimetres. Volumes
between two rows of the table are interpolated linearly and rounded to litres once.
"""

import math
from bisect import bisect_left
from pathlib import Path

import numpy as np

from tankcal import record as records
from tankcal.errors import InputError, Problem
from tankcal.messages import message
from tankcal.record.manifest import digest_of
from tankcal.report import blocks
from tankcal.report.folders import replace_file
from tankcal.report.plain import PlainPaper
from tankcal.report.uncertainty.stated import critical_zone, k_of_rows, stated_U_m3
from tankcal.text.digits import NOTHING, fixed, format_significant, shortest
from tankcal.text.words import language_of, load_words

MOST_ROWS = 400  # rows of a page in type that can be read from arm's length
_TABLE_PT = 630.0, 500.0  # height and width of the rows on the page, points
_ROW = 1.3  # height of a row in units of the type size
_LETTER, _BESIDE = 0.56, 1.9  # width of a digit, and of margins of a column, in the type size
_ACROSS = range(1, 10)  # numbers of columns side by side
_MOST_PT = 20.0  # largest type


def write_chart(
    source, out, language=None, product=None, step_cm=1, *, by_ullage=False, water_mm=None
):
    """Write the field chart of a record as a PDF.

    Parameters
    ----------
    source : Path
        A record.json.
    out : Path
        Path of the PDF; an existing file is replaced.
    language : str, optional
        One of `shipped.LANGUAGES`; None: the language of the job.
    product : str, optional
        Name of the product; None: that of the job.
    step_cm : int, optional
        Centimetres between two rows.
    by_ullage : bool, optional
        True: the rows are ullages from the reference height in place of dips.
    water_mm : int, optional
        Millimetres between two rows of a table of free water, from the lowest dip of the table to
        the end of the page; None: the chart of the product.

    Returns
    -------
    int
        Number of rows.

    Raises
    ------
    InputError
        For a record without a table or, for ullages, without a reference height, and for a table
        with too many rows for a page.
    """
    from tankcal.report.pdf import pdf

    record = records.load(source)
    if not record["capacity"]:
        text = message("chart_no_table", "the record of a survey without a tank; expected a table")
        raise InputError(Problem(source.name, text))
    if by_ullage and record["job"]["datum"]["reference_height_m"] is None:
        text = message(
            "chart_no_reference",
            "the record has no reference height; expected a job with datum.reference_height_m",
        )
        raise InputError(Problem("--ullage", text))
    if water_mm is None:
        rows = chart_rows(record, step_cm, by_ullage=by_ullage)
    else:
        rows = water_rows(record, water_mm)
    if not rows:
        text = message(
            "chart_no_rows", "no dip of the chart is in the table; expected a smaller step"
        )
        raise InputError(Problem(source.name, text))
    if len(rows) > MOST_ROWS:
        text = message(
            "chart_many_rows",
            "the chart would have {count} rows; a page has at most {most}: expected a larger step",
            count=len(rows), most=MOST_ROWS,
        )  # fmt: skip
        raise InputError(Problem("--step-cm", text))
    language = language or language_of(record)
    kind = "water" if water_mm is not None else "ullage" if by_ullage else "dip"
    shown = pages(record, rows, language, product, digest_of(source), kind=kind)
    content = pdf([block.data for block in shown], source.parent)
    with replace_file(Path(out)) as temporary:
        temporary.write_bytes(content)
    return len(rows)


def chart_rows(record, step_cm=1, *, by_ullage=False):
    """Rows (cm, litres or None) of each step within the table; None in a critical zone.

    With `by_ullage` the centimetres are ullages: the reference height less the dip.
    """
    capacity, critical = record["capacity"], critical_zone(record)
    heights, volumes = capacity["height_m"], capacity["volume_m3"]
    # The tolerance keeps the errors of binary fractions from losing a row at a whole centimetre.
    reference = record["job"]["datum"]["reference_height_m"]
    low, high = heights[0], heights[-1]
    if by_ullage:
        low, high = reference - high, reference - low
    first, last = math.ceil(100 * low - 1e-7), math.floor(100 * high + 1e-7)
    shown = [cm for cm in range(first, last + 1) if cm % step_cm == 0]
    dips = np.array(shown) / 100
    if by_ullage:
        dips = reference - dips
    litres = 1000 * np.interp(dips, heights, volumes)
    return [
        (cm, None if critical and critical[0] < dip < critical[1] else volume)
        for cm, dip, volume in zip(shown, dips.tolist(), litres.tolist(), strict=True)
    ]


def water_rows(record, step_mm=1):
    """Rows (mm, litres) of a table of free water, from the lowest dip of the table.

    The table ends with the page, with the table of the tank, or where a floating roof would rest in
    the water: its displacement is part of the volumes above.
    """
    capacity, critical = record["capacity"], critical_zone(record)
    heights = capacity["height_m"]
    low, high = heights[0], critical[0] if critical else heights[-1]
    first, last = math.ceil(1000 * low - 1e-6), math.floor(1000 * high + 1e-6)
    shown = [mm for mm in range(first, last + 1) if mm % step_mm == 0][:MOST_ROWS]
    litres = 1000 * np.interp(np.array(shown) / 1000, heights, capacity["volume_m3"])
    return list(zip(shown, litres.tolist(), strict=True))


def pages(record, rows, language, product=None, digest="", *, kind="dip"):
    """Return the blocks of the page.

    Parameters
    ----------
    record : dict
        Loaded record.json.
    rows : list of (int, float or None)
        Result of `chart_rows` or `water_rows`.
    language : str
        One of `shipped.LANGUAGES`.
    product : str, optional
        Name of the product; None: that of the job.
    digest : str, optional
        SHA-256 of the record.
    kind : {"dip", "ullage", "water"}, optional
        Kind of the rows.

    Returns
    -------
    list of Block
    """
    words = load_words(language)
    paper, job = PlainPaper(words), record["job"]
    marks, certificate = paper.marks, job["certificate"]
    tank = job["tank"]
    title = paper.word(f"chart.title_of_{kind}")
    product = product or tank["details"].get("product") or ""
    survey = (job["survey"] or {}).get("date")
    day = certificate.get("date_of_issue") or survey
    facts = [
        (paper.word("chart.product"), product or NOTHING),
        (paper.word("chart.number"), certificate.get("number") or NOTHING),
        (paper.word("chart.date"), NOTHING if day is None else str(day)[:10]),
        (paper.word("chart.uncertainty"), _uncertainty(paper, record, rows, kind)),
    ]
    temperature = shortest(job["table"]["reference_temperature_c"], marks)
    reference = job["datum"]["reference_height_m"]
    values = {"reference": fixed(reference, 3, marks)} if kind == "ullage" else {}
    texts = [paper.word(f"chart.use_{kind}", temperature=temperature, **values)]
    if any(litres is None for _, litres in rows):
        texts.append(paper.word("chart.critical", sign=NOTHING))
    cells = [
        [str(cm), NOTHING if litres is None else fixed(litres, 0, marks)] for cm, litres in rows
    ]
    across, size_pt = layout(len(cells), max(len(text) for row in cells for text in row))
    return [
        blocks.document(
            title=f"{title} {tank['id']}",
            language=language,
            date=str(day)[:10] if day else "",
            notice=str(certificate.get("notice") or ""),
            running=[title, certificate.get("laboratory") or ""],
            footer=f"tankcal {record['tankcal']} · record.json SHA-256 {digest[:16]}",
            record_sha256=digest,
            dense=True,
        ),
        blocks.chart(
            f"{paper.word('page.tank')} {tank['id']}",
            facts,
            [("mm" if kind == "water" else "cm", "L")],
            cells,
            across=across,
            size_pt=size_pt,
            note=" ".join(texts),
            marked=[place for place, (_, litres) in enumerate(rows) if litres is None],
        ),
    ]


def _uncertainty(paper, record, rows, kind):
    """Text of the largest U of the rows, in litres, with k and the coverage probability."""
    capacity = record["capacity"]
    U = stated_U_m3(capacity)
    count = len(U)
    if kind == "water":  # the rows of the tank that the page contains, and the next row
        highest = rows[-1][0] / 1000 if rows else capacity["height_m"][0]
        count = min(bisect_left(capacity["height_m"], highest) + 1, count)
    row = max(range(count), key=U.__getitem__)
    largest = format_significant(1000 * U[row], 2, paper.marks)
    k = k_of_rows(capacity)[row]
    values = {"U": largest, "coverage": paper.word("chart.probability", percent=shortest(
        100 * record["job"]["table"]["coverage_probability"], paper.marks))}  # fmt: skip
    if k is None:
        return paper.word("chart.largest_U", **values)
    return paper.word("chart.largest_U_k", k=fixed(k, 2, paper.marks), **values)


def layout(count, letters):
    """Number of columns side by side, and the type size in points, for the largest type.

    Parameters
    ----------
    count : int
        Number of rows.
    letters : int
        Letters of the longest volume.

    Returns
    -------
    int, float
    """
    height, width = _TABLE_PT

    def size(across):
        by_height = height / (math.ceil(count / across) + 1) / _ROW
        by_width = width / across / (_LETTER * (letters + 4) + _BESIDE)
        return min(by_height, by_width, _MOST_PT)

    across = max(_ACROSS, key=size)
    return across, round(size(across), 2)
