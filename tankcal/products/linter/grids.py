"""Read any file as grids of cells: CSV, Excel workbook, text of a PDF, or record.

The text of a PDF keeps the layout of the page. Each heading with heights and volumes begins a
table, which may continue over pages; lines of prose are skipped. The cells of a line are assigned
to the columns of numbers on its page.

Text of a PDF in its layout, extracted with pypdf in a child process.

PDF libraries may hang or exhaust the memory. The child process limits the damage.
"""

import contextlib
import csv
import json
import re
import subprocess
import sys
from dataclasses import dataclass, field
from itertools import zip_longest

from tankcal.job.excel import Unreadable, read_sheets
from tankcal.job.folder import decode, has_too_many_lines, is_row, split_lines
from tankcal.job.sheets import is_read
from tankcal.job.tables import MAX_COLUMNS, read_bytes, shown, too_many_columns
from tankcal.messages import message
from tankcal.products.linter.units import heading_of, is_unit
from tankcal.products.linter.wide import are_even, read_label
from tankcal.record import FORMAT, altered_since, version_of
from tankcal.text.delimited import find_separator, split_cells

MOST_LINES = 100_000
MOST_PAGES = 300
MOST_CONTENT = 2_500_000  # largest size of the page content, bytes; layout takes some ten seconds
MOST_SECONDS = 15  # processor time of the child; a table of 200 pages takes about 6
LONGEST_WAIT_S = 120  # by the clock, on a busy machine
ENDED_BY_CPU_LIMIT = -24  # exit status: SIGXCPU
MEMORY_LIMIT = 2 << 30  # address space of the child, bytes
PAGES, ENCRYPTED, MANY_PAGES, LONG_TEXT = "pages", "encrypted", "many", "long"
DAMAGED, SLOW = "damaged", "slow"
_CODE = (
    "import json, sys; request = json.loads(sys.argv[1]); sys.path[:] = request['sys_path']; "
    "from tankcal.products.linter.grids import main; main(request)"
)


@dataclass(frozen=True)
class Grid:
    """Cells of a sheet as written.

    Attributes
    ----------
    name : str
        File, or file and sheet, as shown in messages.
    rows : tuple
        (row number, cells) of each row that is not blank.
    is_text : bool
        CSV: every number is text, and a row wider than its heading is an error.
    sheet : str
        Name of the sheet.
    """

    name: str
    rows: tuple
    is_text: bool = False
    sheet: str | None = None


def read_grids(path, log):
    """Return the `Grid`s of a file; () after reporting to `log` why it cannot be read."""
    if not path.exists():
        log.problem(
            path.name,
            message(
                "lint_not_found",
                "not found; expected a CSV file, a workbook (.xlsx), a PDF or a record.json",
            ),
        )
        return ()
    data = read_bytes(path, log)
    if data is None:
        return ()
    if data[:5] == b"%PDF-" or path.suffix.lower() == ".pdf":
        return _pdf(path, log)
    if data[:2] == b"PK" or data[:4] == b"\xd0\xcf\x11\xe0" or path.suffix.lower() == ".xlsx":
        return _workbook(path.name, data, log)
    text = decode(path.name, data, log, or_western=path.suffix.lower() != ".json")
    if text is None:
        return ()
    if path.suffix.lower() == ".json" or text.lstrip()[:1] == "{":
        altered = altered_since(path)
        if altered is not None:
            log.problem(path.name, altered)
        return _record(path.name, text, log)
    return _csv(path.name, text, log)


def _pdf(path, log):
    """Grids of the tables in a PDF."""
    tables = tables_in_text(read_pages(path, log) or ())
    longest = max(tables, key=len, default=())
    for rows in tables:
        if rows is not longest and len(rows) > 1:
            text = message(
                "lint_other_table",
                "another table of heights and volumes begins here; only the longest is read",
            )
            log.warning(path.name, text, rows[0][0])
    return tuple(Grid(path.name, tuple(rows), True) for rows in tables)


def _workbook(file, data, log):
    """Grids of the sheets of a workbook."""
    try:
        sheets = read_sheets(data, is_read)
    except Unreadable as reason:
        log.problem(file, reason.args[0])
        return ()
    return tuple(
        Grid(
            message("lint_sheet", "{file}, sheet {sheet}", file=file, sheet=sheet.title),
            tuple((number, tuple(cells)) for number, cells in sheet.grid.rows),
            sheet=sheet.title,
        )
        for sheet in sheets
        if sheet.grid.rows
    )


def _record(file, text, log):
    """Grid of the capacity table in a record."""
    try:
        record = json.loads(text)
        is_ours = version_of(record) is not None
        if is_ours and record.get("capacity") is None:
            expected = message(
                "lint_record_of_points",
                "a record of points without a table; expected the record of a tank",
            )
            log.problem(file, expected, None, "capacity")
            return ()
        table = record["capacity"]
        columns = [list(table[key]) for key in ("height_m", "volume_m3")]
    except (ValueError, KeyError, TypeError, RecursionError):
        is_ours = False
    if not is_ours:
        log.problem(
            file,
            message(
                "lint_no_record",
                "not a record of tankcal; expected format {format!r} or an older version of it",
                format=FORMAT,
            ),
        )
        return ()
    if len(columns[0]) != len(columns[1]):
        expected = message(
            "lint_unequal_columns",
            "{heights} heights and {volumes} volumes; expected as many of each",
            heights=len(columns[0]),
            volumes=len(columns[1]),
        )
        log.problem(file, expected, None, "capacity")
        return ()
    rows = [(0, ("height_m", "volume_m3"))]
    rows += [(number, cells) for number, cells in enumerate(zip(*columns, strict=True), 1)]
    return (Grid(f"{file}, capacity", tuple(rows)),)


def _csv(file, text, log):
    """Grid of a CSV file."""
    if has_too_many_lines(file, text, log, MOST_LINES):
        return ()
    lines = [(number, line) for number, line in enumerate(split_lines(text), 1) if is_row(line)]
    if not lines:
        log.problem(file, message("lint_empty", "empty; expected a table of heights and volumes"))
        return ()
    separator = find_separator([line for _, line in lines])
    rows = []
    for number, line in lines:
        try:
            cells = split_cells(line, separator)
        except csv.Error:
            log.problem(
                file,
                message(
                    "lint_quotes",
                    "found {found}; expected quotation marks in pairs",
                    found=shown(line),
                ),
                number,
            )
            continue
        if len(cells) > MAX_COLUMNS:
            log.problem(file, too_many_columns(len(cells)), number)
        elif any(cells):
            rows.append((number, tuple(cells)))
    return (Grid(file, tuple(rows), True),)


MOST_LINES_OF_PAGE = 1000  # row 4032: line 32 of page 4
_CELL = re.compile(r"\S+(?:[ \t]\S+)*")
_NUMBER_CELL = re.compile(
    r"[+-]?[\d.,'\u2019\u00a0\u2009\u202f ]*\d[\d.,'\u2019\u00a0\u2009\u202f ]*"
)
_FEET_CELL = re.compile(r"\d+ ?(?:'|\u2032|\u2019|ft)[\d /.]*(?:\"|\u2033|\u201d|''|in)?|"
                   r"\d{1,3}-\d{1,2}(?:-\d{1,2}|[ -]\d{1,2}/\d{1,2})?")  # fmt: skip
_GROUPED = re.compile(r"\d{1,3}(?: \d{3})+(?:[.,]\d+)?")
_MARKS = "*\u2020\u2021"  # footnote marks
_MOSTLY = 0.6
_LINES_OF_HEADING = 3
_FEWEST_PARTS = 9  # parts of a height in the heading of a wide table, such as 0 to 9 cm
_HALF_OF_LINES = 0.5  # share of the lines


@dataclass(frozen=True)
class Word:
    """A cell on its line, from column `start` of the text to `end`."""

    start: int
    end: int
    text: str


@dataclass
class _Section:
    """A heading, and the lines below it on each page."""

    heading: list
    units: list = field(default_factory=list)
    row: int = 0
    pages: dict = field(default_factory=dict)  # {page: [(row, words)]}


def tables_in_text(pages):
    """Return rows (number, cells) of each table in the text of pages, heading first."""
    sections, current, since = [], None, 0
    for page, text in enumerate(pages, 1):
        for line, content in enumerate(text.split("\n")[: MOST_LINES_OF_PAGE - 1], 1):
            words, row = split_words(content), MOST_LINES_OF_PAGE * page + line
            may_be_units = words and current is not None and since < _LINES_OF_HEADING
            if may_be_units and all(is_unit(word.text) for word in words):
                current.units, since = current.units or words, since + 1
            elif _is_heading(words):
                current, since = _Section(words, row=row), 0
                sections.append(current)
            elif current is not None and is_data(words):
                current.pages.setdefault(page, []).append((row, words))
                since = _LINES_OF_HEADING
            elif words:
                since += 1
    return _merge_pages([page for section in sections for page in _rows_by_page(section)])


def split_words(line):
    """Return the `Word`s of a line; cells are two blanks apart, or numbers one blank apart."""
    words = []
    for match in _CELL.finditer(line):
        text = match[0].rstrip(_MARKS + " ")
        parts = text.split(" ")
        is_split = len(parts) > 1 and all(map(_NUMBER_CELL.fullmatch, parts))
        if is_split and not _GROUPED.fullmatch(text):
            start = match.start()
            for part in parts:
                words.append(Word(start, start + len(part), part))
                start += len(part) + 1
        elif text:
            words.append(Word(match.start(), match.start() + len(text), text))
    return words


def is_data(words):
    """Whether a line is a row of a table: at least two cells, most of them numbers."""
    numbers = sum(
        (
            _NUMBER_CELL.fullmatch(word.text) is not None
            or _FEET_CELL.fullmatch(word.text) is not None
        )
        for word in words
    )
    return len(words) > 1 and numbers > _MOSTLY * len(words) and numbers > 1


def _is_heading(words):
    """Whether a line has headings of heights and volumes, or of heights and their parts."""
    if len(words) < 2:  # a line of prose is one cell
        return False
    roles = [heading_of(word.text).role for word in words]
    has_heights = "height" in roles or "ullage" in roles
    labels = [read_label(word.text) for word in words[1:]]
    if len(labels) >= _FEWEST_PARTS and None not in labels and are_even(labels):
        return has_heights or is_unit(words[0].text)
    return "volume" in roles and has_heights


def _rows_by_page(section):
    """Return the rows (number, cells) of a section by page, each page with the heading first."""
    pages, heading = [], None
    for lines in section.pages.values():
        columns = _columns(lines)
        if heading is None:
            columns = _add_empty_columns(columns, section.heading)
            heading = _assign_to_columns(section.heading, columns)
            units = _assign_to_columns(section.units, columns)
            both = zip_longest(heading, units)
            heading = tuple(" ".join(filter(None, pair)) or None for pair in both)
        rows = [(section.row if not pages else lines[0][0], heading)]
        for row, words in lines:
            cells = [None] * len(columns)
            for word in words:
                cells[_column(word, columns)] = word.text
            rows.append((row, tuple(cells)))
        pages.append(_drop_unnamed_column(rows))
    return pages


def _columns(lines):
    """Return [(start, end)] covered by the words of lines, overlapping ranges merged."""
    spans = sorted((word.start, word.end) for _, words in lines for word in words)
    joined = [list(spans[0])]
    for start, end in spans[1:]:
        if start < joined[-1][1]:
            joined[-1][1] = max(joined[-1][1], end)
        else:
            joined.append([start, end])
    return joined


def _add_empty_columns(columns, heading):
    """Return the columns, including columns of the heading without numbers."""
    if len(heading) <= len(columns):
        return columns
    empty = [
        [word.start, word.end]
        for word in heading
        if not any(word.start < end and start < word.end for start, end in columns)
    ]
    return sorted(columns + empty)


def _column(word, columns):
    """Index of the column that contains a word, or is nearest to it."""

    def misfit(column):
        overlap = min(word.end, column[1]) - max(word.start, column[0])
        middle = abs(word.start + word.end - column[0] - column[1]) / 2
        return (-min(overlap, 1), middle)

    return min(range(len(columns)), key=lambda k: misfit(columns[k]))


def _assign_to_columns(words, columns):
    """Return the heading texts by column; texts of one column are joined."""
    if len(words) == len(columns):
        return [word.text for word in words]
    texts = [None] * len(columns)
    for word in words:
        k = _column(word, columns)
        texts[k] = word.text if texts[k] is None else f"{texts[k]} {word.text}"
    return texts


def _merge_pages(pages):
    """Merge pages with the same heading, and pages that have only its first columns."""
    headings = [page[0][1] for page in pages]
    merged = {}
    for (row, heading), *rows in pages:
        wider = [
            known_heading for known_heading in headings if known_heading[: len(heading)] == heading
        ]
        widest = max(wider, key=len)
        merged.setdefault(widest, []).extend([(row, widest), *rows])
    return list(merged.values())


def _drop_unnamed_column(rows):
    """Remove one column without a heading from the rows; several are kept, to be refused."""
    width = max(len(cells) for _, cells in rows)
    texts = [rows[0][1][k] if k < len(rows[0][1]) else None for k in range(width)]
    filled = [sum(k < len(cells) and bool(cells[k]) for _, cells in rows[1:]) for k in range(width)]
    unnamed = [
        k for k in range(width) if not texts[k] and filled[k] > _HALF_OF_LINES * (len(rows) - 1)
    ]
    kept = [k for k in range(width) if texts[k] or (len(unnamed) > 1 and k in unnamed)]
    return [(row, tuple(cells[k] if k < len(cells) else None for k in kept)) for row, cells in rows]


# ---- text of a PDF in its layout, extracted with pypdf in a child process


def read_pages(path, log, mode="layout"):
    """Return the text of each page, or None after reporting to `log` why there is none.

    `mode` is that of pypdf: "layout", or "plain" for the order in which the text was written.
    """
    kind, answer = _ask_child(path, mode)
    if kind == PAGES and any(page.strip() for page in answer):
        return tuple(answer)
    log.problem(path.name, _refusal(kind, answer))
    return None


def _refusal(kind, answer):
    """Message that a PDF has no readable text."""
    if kind == PAGES:
        return message(
            "lint_scanned_pdf",
            "no text in it: is it a scan? expected a PDF whose text can be selected, or the table "
            "typed as CSV or workbook",
        )
    if kind == ENCRYPTED:
        return message("lint_encrypted_pdf", "a PDF with a password; expected one without")
    if kind == MANY_PAGES:
        return message(
            "lint_long_pdf",
            "{count} pages; expected at most {most}: only those of the table",
            count=answer,
            most=MOST_PAGES,
        )
    if kind == LONG_TEXT:
        return message(
            "lint_much_text",
            "more than {most:.1f} MB of text and drawings on its pages; expected only the pages of "
            "the table",
            most=MOST_CONTENT / 1e6,
        )
    if kind == SLOW:
        return message(
            "lint_slow_pdf",
            "not read within {most} seconds; expected only the pages of the table",
            most=MOST_SECONDS,
        )
    return message("lint_damaged_pdf", "not a PDF that can be read, or damaged")


def _ask_child(path, mode):
    """Return the answer of a child process: (kind, pages or message)."""
    request = {"path": str(path.resolve()), "sys_path": sys.path, "seconds": MOST_SECONDS}
    request["mode"] = mode
    try:
        done = subprocess.run(
            [sys.executable, "-c", _CODE, json.dumps(request)],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            timeout=LONGEST_WAIT_S,
            check=False,
        )
    except subprocess.TimeoutExpired:
        return SLOW, None
    except OSError:
        return DAMAGED, None
    if done.returncode == ENDED_BY_CPU_LIMIT:
        return SLOW, None
    try:
        kind, answer = json.loads(done.stdout)
    except ValueError:
        return DAMAGED, None
    return kind, answer


def main(request):
    """Print [kind, answer] for the PDF of a request, as JSON."""
    with contextlib.suppress(ImportError, ValueError, OSError):
        import resource

        resource.setrlimit(resource.RLIMIT_AS, (MEMORY_LIMIT, MEMORY_LIMIT))
        limit = request["seconds"]
        resource.setrlimit(resource.RLIMIT_CPU, (limit, limit + 1))
    try:
        answer = _answer(request["path"], request["mode"])
    except Exception as error:
        answer = [DAMAGED, type(error).__name__]
    sys.stdout.write(json.dumps(answer))


def _answer(path, mode):
    """Answer of the child process: kind, and the text of the pages or None."""
    import pypdf

    reader = pypdf.PdfReader(path)
    if reader.is_encrypted and not reader.decrypt(""):
        return [ENCRYPTED, None]
    if len(reader.pages) > MOST_PAGES:
        return [MANY_PAGES, len(reader.pages)]
    if not _is_short(reader.pages):
        return [LONG_TEXT, None]
    return [PAGES, [page.extract_text(extraction_mode=mode) for page in reader.pages]]


def _is_short(pages):
    """Whether the page content is at most MOST_CONTENT; counting is fast, the layout is slow."""
    size = 0
    for page in pages:
        content = page.get_contents()
        size += len(content.get_data()) if content is not None else 0
        if size > MOST_CONTENT:
            return False
    return True
