"""A job as one Excel workbook: a sheet `job` for the settings and a sheet for each table.

The file is looked at before any of it is parsed, for it may come from anywhere: password,
macros, entity declarations and archives that unpack to far more than they are get refused.
"""

import hashlib
import io
import re
import warnings
import zipfile
from itertools import zip_longest

from tankcal.job.tables import (
    COVARIANCE_FILE,
    LATER_TABLES,
    REGISTERS,
    TABLES,
    TANK_TABLES,
    BadCell,
    RawJob,
    Register,
    Value,
    make_table,
    nearest,
    read_bytes,
    shown,
)

SETTINGS_SHEET = "job"
README_SHEET = "read me"
SETTINGS_HEADINGS = ("section", "key", "value", "note")

MAX_UNPACKED_BYTES = 100_000_000
MAX_MEMBERS = 5000
MAX_RATIO, RATIO_FROM_BYTES = 300, 10_000_000
MAX_COLUMNS = 100
MAX_ROWS = 1_048_576  # of Excel itself

_OLE = b"\xd0\xcf\x11\xe0"
_FORMULA = re.compile(rb"<(?:\w+:)?f[\s/>]")
_BLANK_CELL = re.compile(rb"<(?:\w+:)?c(?:\s[^<>]*)?(?:/>|></(?:\w+:)?c>)")
_BLANK_ROW = re.compile(rb"<(?:\w+:)?row(?:\s[^<>]*)?(?:/>|>\s*</(?:\w+:)?row>)")
_NOT_A_WORKBOOK = "not an Excel workbook (.xlsx)"


def read_workbook(path, log):
    """RawJob of a workbook (a Path), or None after telling `log` why it cannot be read."""
    data = read_bytes(path, log)
    if data is None:
        return None
    complaint = _complaint(data)
    if complaint:
        log.problem(path.name, complaint)
        return None
    try:
        cells = _read_cells(data)
    except Exception:  # openpyxl raises whatever a damaged part happens to trip over
        log.problem(path.name, "damaged: open it in Excel or LibreOffice and save it again")
        return None
    sheets = _known_sheets(path.name, cells, log)
    tables = {
        name: make_table(f"sheet {name}", _checked_width(name, rows, log), None, log)
        for name, rows in sheets.items()
    }
    settings, sections = None, {}
    if SETTINGS_SHEET not in tables:
        log.problem(f"sheet {SETTINGS_SHEET}", "missing sheet; " + expected_sheets())
    elif tables[SETTINGS_SHEET] is not None:
        settings, sections = _settings(tables[SETTINGS_SHEET], "section", log)
    files = ((path.name, hashlib.sha256(data).hexdigest(), len(data)),)
    wanted = {name: tables[name] for name in TABLES if name in tables}
    place = f"sheet {SETTINGS_SHEET}"
    registers = {
        name: _register(tables[name], owner, log)
        for name, owner in REGISTERS.items()
        if name in tables
    }
    return RawJob(path.name, path.parent, place, settings, sections, wanted, None, files, registers)


def expected_sheets():
    """One phrase that names the sheets of a workbook."""
    return (
        f"a workbook has the sheets {SETTINGS_SHEET}, {', '.join(TANK_TABLES)} (the last three"
        " optional), or those of a survey in place of the points"
    )


def _complaint(data):
    """Why the bytes are not a workbook to be opened, in words, or None."""
    if data.startswith(_OLE):
        return "an old .xls or a workbook with a password; save it as .xlsx without password"
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            return _archive_complaint(archive, len(data))
    except Exception:  # zipfile and zlib raise whatever a damaged part happens to trip over
        return f"{_NOT_A_WORKBOOK}, or damaged"


def _archive_complaint(archive, packed_bytes):
    members = archive.infolist()
    names = {member.filename for member in members}
    unpacked = sum(member.file_size for member in members)
    if len(members) > MAX_MEMBERS:
        return f"{len(members)} parts inside, expected at most {MAX_MEMBERS}"
    if unpacked > MAX_UNPACKED_BYTES:
        return (
            f"unpacks to {unpacked / 1e6:.0f} MB, expected at most {MAX_UNPACKED_BYTES / 1e6:.0f}"
            " MB; hand in a folder with CSV files"
        )
    if unpacked > RATIO_FROM_BYTES and unpacked > MAX_RATIO * packed_bytes:
        return f"unpacks to more than {MAX_RATIO} times its size, which no workbook of a job does"
    if "xl/workbook.xml" not in names:
        return _NOT_A_WORKBOOK
    if any("vbaproject" in name.lower() for name in names):
        return "holds macros; save it as .xlsx (a workbook without macros)"
    usual = (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED)
    if any(member.flag_bits & 1 or member.compress_type not in usual for member in members):
        return "packed in an unusual way; open it in Excel or LibreOffice and save it as .xlsx"
    for member in members:
        if member.filename.lower().endswith((".xml", ".rels", ".vml")):
            content = archive.read(member)
            if b"<!DOCTYPE" in content or b"<!ENTITY" in content or _is_disguised(content):
                return "holds XML declarations that no workbook needs (DOCTYPE, ENTITY, encoding)"
    return None


def _is_disguised(content):
    """Is the XML in an encoding in which a DOCTYPE would not be seen?"""
    encoding = re.match(rb"\s*(?:\xef\xbb\xbf)?<\?xml[^>]*?encoding\s*=\s*[\"']([^\"']*)", content)
    usual = (b"utf-8", b"us-ascii", b"ascii", b"iso-8859-1", b"windows-1252")
    return b"\0" in content or (encoding is not None and encoding[1].lower() not in usual)


def _read_cells(data):
    """{sheet title: list of (row, cells)}; blank rows are left out."""
    from openpyxl import load_workbook

    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # about drop-down lists, styles: of no account here
        data, has_formulas = _without_blank_cells(data)
        values = load_workbook(io.BytesIO(data), read_only=True, data_only=True)
        formulas = None
        if has_formulas:
            formulas = load_workbook(io.BytesIO(data), read_only=True, data_only=False)
        sheets = {}
        for sheet in values.worksheets:
            rows = _rows(sheet)
            if formulas is not None and not _is_ignored(sheet.title):
                rows = _mark_uncalculated(rows, _rows(formulas[sheet.title]))
            sheets[sheet.title] = [] if _is_ignored(sheet.title) else list(rows)
    return sheets


def _without_blank_cells(data):
    """(the workbook without cells that only carry a format, does it hold formulas?)

    A sheet formatted down to its last row holds millions of them, and would cost minutes.
    """
    has_formulas, packed = False, io.BytesIO()
    with zipfile.ZipFile(io.BytesIO(data)) as old, zipfile.ZipFile(packed, "w") as new:
        for name in dict.fromkeys(old.namelist()):
            content = old.read(name)
            if name.startswith("xl/worksheets/") and name.endswith(".xml"):
                has_formulas = has_formulas or _FORMULA.search(content) is not None
                content = _BLANK_ROW.sub(b"", _BLANK_CELL.sub(b"", content))
            new.writestr(name, content)
    return packed.getvalue(), has_formulas


def _rows(sheet):
    """(row, values) of each row of a sheet that is not blank, one column more than is allowed."""
    sheet.reset_dimensions()  # what the file declares may be wrong, or a million rows
    last_row = None
    cells = sheet.iter_rows(max_row=MAX_ROWS, max_col=MAX_COLUMNS + 1)
    for number, row in enumerate(cells, 1):
        if row is last_row:  # openpyxl fills every gap with the same blank row
            continue
        last_row = row
        values = [_value(cell) for cell in row]
        if any(value is not None for value in values):
            yield number, values


def _value(cell):
    value = cell.value
    if value is None:
        return None
    if cell.data_type == "e":
        return BadCell(f"the cell shows {shown(str(value))}")
    return value


def _mark_uncalculated(rows, formula_rows):
    """The rows, with a BadCell for each formula whose result is not stored in the file.

    A formula without a result looks blank; without this an optional cell would count as not given.
    """
    results = dict(rows)
    for number, formulas in formula_rows:
        values = results.get(number, [None] * len(formulas))
        complaint = BadCell(
            "a formula without its result; open the workbook in Excel or LibreOffice, save it"
        )
        yield (
            number,
            [
                complaint if value is None and formula is not None else value
                for value, formula in zip_longest(values, formulas)
            ],
        )


def _is_ignored(title):
    return title.strip().lower() == README_SHEET or title.strip().startswith("#")


def _known_sheets(file, cells, log):
    """{name: rows} of the sheets that a job has; the others are told to `log`."""
    known = (SETTINGS_SHEET, *TABLES, *REGISTERS)
    sheets = {}
    for title, rows in cells.items():
        name = title.strip().lower()
        if _is_ignored(title):
            continue
        if name in sheets:
            log.problem(file, f"two sheets are called {shown(name)}; expected one")
        elif name in known:
            sheets[name] = rows
        elif name in LATER_TABLES:
            log.problem(f"sheet {name}", "not available in this version of tankcal: remove it")
        elif name == COVARIANCE_FILE.rpartition(".")[0]:
            log.problem(f"sheet {name}", "a full covariance needs the job as a folder")
        else:
            expected = f"unknown sheet {shown(title)}{nearest(name, known)}; {expected_sheets()}"
            log.problem(file, expected + "; name it '# notes' to keep it")
    return sheets


def _checked_width(name, rows, log):
    for number, cells in rows:
        if len(cells) > MAX_COLUMNS and cells[MAX_COLUMNS] is not None:
            log.problem(f"sheet {name}", f"cells beyond column {MAX_COLUMNS}", number)
        yield number, cells[:MAX_COLUMNS]


def _register(table, owner, log):
    """Register of the sheet cameras or instruments, or None."""
    if table is None:
        return None
    entries, rows = _settings(table, owner, log)
    return None if entries is None else Register(table.file, entries, rows)


def _settings(table, owner, log):
    """({section: {key: Value}}, {section: row}) of a sheet of settings, or (None, {}).

    owner  heading of the column of sections: "section", "camera" or "instrument"
    """
    wanted = (owner, *SETTINGS_HEADINGS[1:])
    unknown = [heading for heading in table.headings if heading not in wanted]
    missing = [heading for heading in wanted[:3] if heading not in table.headings]
    for heading in unknown:
        log.problem(
            table.file,
            f"unknown column{nearest(heading, wanted)}; expected {owner}, key, value and note",
            table.heading_row,
            heading,
        )
    for heading in missing:
        log.problem(table.file, "missing column", table.heading_row, heading)
    if missing:
        return None, {}
    place = [table.headings.index(heading) for heading in wanted[:3]]
    settings, sections = {}, {}
    for row, cells in zip(table.row_numbers, table.rows, strict=True):
        section, key, value = (cells[position] for position in place)
        if key is None and value is None:
            continue  # a row that only names a section or carries a note
        if owner != "section" and isinstance(section, int | float):
            section = f"{section:.15g}"  # a camera called 1
        if not isinstance(section, str) or not isinstance(key, str):
            expected = f"a value without {owner} or key; expected both"
            expected += ", such as tank and id" if owner == "section" else ""
            column = "key" if isinstance(section, str) else owner
            log.problem(table.file, expected, row, column)
            continue
        section = section.strip("[] ")
        known = settings.setdefault(section, {})
        sections.setdefault(section, row)
        if key in known:
            expected = f"given twice; the first stands in row {known[key].row}"
            log.problem(table.file, expected, row, f"{section}.{key}")
        else:
            known[key] = Value(value, row)
    return settings, sections
