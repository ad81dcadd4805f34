"""Jobs, plans, workbooks and tables spoilt at random, the same ones on every machine.

spoilt_folder(base, rng)    {file: bytes} with one to three things wrong
spoilt_parts(parts, rng)    the same in the plain data of `job_builder`, for workbooks
add_odd_file(files, rng)    the same files and one with an odd name
NEUTRAL                     {name: change(file, bytes)} that changes no number; None: does not apply
"""

import copy
import csv
import datetime
import io
import json
import re
import zipfile
import zlib

HOSTILE_CELLS = (
    "", " ", "nan", "-inf", "inf", "1e308", "-1e308", "1e-320", "1e400", "9" * 400, "0", "-0", "-1",
    "1e9", "1,5", "1.2.3", "\uff11\uff12", "\u0663", "=cmd()", "@SUM(A1)", '"', "''", '"a', 'a"b',
    "\u202e", "\u0000", "\u00a0", "\ufeff", "\U0001f600", "a" * 5000, "true", "None", "0x1F",
    "1_000", "12345678901234567890", "2024-02-30", ",", ";", "\t", "\n", "\r", "../../x", "[1]",
    "..", "é", "e\u0301", "-", "+", "1-1", "1e", "%", "{x}", "\\", "#", "P1", "CON",
)  # fmt: skip
HOSTILE_TOML = (
    "nan", "inf", "-inf", "1e308", "1e400", "9" * 400, '""', "[]", "{}", "[[1]]", "true", "0", "-1",
    "2024-01-01", "1979-05-27T07:32:00", '"\u202e"', '"a\\u0000b"', "[1, 2, 3, 4, 5]", "[nan]",
    '["a", 1]', "{a = 1}", "'", "1_000", "0x1F", '"é"', "1e-320", "[[[[[[1]]]]]]", '"{x}"',
    "[" * 50 + "]" * 50, "0.0", "1", "1e9", "-1e9", '"' + "a" * 5000 + '"', "", "[", "}",
    "07:32:00",
)  # fmt: skip
HOSTILE_OBJECTS = (
    None, True, False, 0, -1, 1e308, -1e308, 1e-320, "nan", "1,5", "x", " ", "=1+1", "a" * 3000,
    datetime.datetime(2024, 5, 31), datetime.date(1904, 1, 1), "\u202e", "\U0001f600", 10**15, 0.5,
)  # fmt: skip
WHOLE = (
    b"", b"\n", b",,,,\n,,,,\n", b",", b'"', b"\x00\x00", b"\xff\xfe\x00", b"\xef\xbb\xbf",
    b"PK\x03\x04", b"a\n" * 50, b"\r\r\r", b'""""\n', b"{}", b"[]", b"[[[[", b"=\n", b"# only\n",
    "x,y\n\U0001f600,\u202e\n".encode(), b"a," * 3000 + b"\n", b"\xc3\x28\n1,2\n",
)  # fmt: skip


HOSTILE_JSON = (
    None, True, False, 0, -1, -0.0, 1e308, -1e308, 1e-320, float("nan"), float("inf"), 10**400,
    "nan", "", " ", "x", "=1+1", "a" * 3000, "\u202e", "\U0001f600", "\u0000", "\ud800", [], {},
    [[]], [None], {"a": 1}, [1, 2, 3], "2024-02-30", 1.5, "../../x", 10**15, -5, "\x1b[2J",
)  # fmt: skip
ODD_NAMES = (
    "points (1).csv", ".~lock.points.csv#", "~$job.xlsx", "POINTS.CSV", "points.csv.bak", "é.csv",
    "e\u0301.csv", "\u202ecsv.exe", "a\nb.csv", "\x1b[2Jx.csv", " .csv", "x.toml", "Thumbs.db",
    "-.csv", "\udcff.csv", "record.json", "desktop.ini", "__MACOSX/points.csv", "job.TOML",
    "courses.tsv",
)  # fmt: skip


def spoilt_folder(base, rng, names=()):
    """{name: bytes} of the files of `base` ({name: text or bytes}), spoilt.

    names  of the files that are spoilt; none: any
    """
    files = {k: v.encode() if isinstance(v, str) else v for k, v in base.items()}
    for _ in range(rng.integers(1, 4)):
        name = str(rng.choice(sorted(names or files)))
        files[name] = _spoilt_file(name, files[name], rng)
    return files


def _spoilt_file(name, data, rng):
    if rng.random() < 0.08:
        return WHOLE[rng.integers(len(WHOLE))]
    if rng.random() < 0.04 or not data:
        return _other_bytes(data, rng)
    if name.endswith(".xlsx"):
        return _spoilt_book(data, rng)
    try:
        text = data.decode()
    except UnicodeDecodeError:
        return _other_bytes(data, rng)
    if name.endswith(".json") and rng.random() < 0.9:
        return _spoilt_json(text, rng)
    if name.endswith((".toml", ".json")):
        return _spoilt_toml(text, rng).encode(errors="surrogatepass")
    return spoilt_csv(text, rng).encode(errors="surrogatepass")


def _other_bytes(data, rng):
    """Another encoding, a cut file, or a byte that changed."""
    kind = rng.integers(4)
    if kind == 0:
        return data.decode(errors="replace").encode("utf-16")
    if kind == 1:
        return data[: rng.integers(len(data) + 1)]
    if kind == 2:
        return b"\xef\xbb\xbf" + data
    place = rng.integers(max(len(data), 1))
    return data[:place] + bytes([rng.integers(256)]) + data[place + 1 :]


def spoilt_csv(text, rng):  # noqa: C901
    """A text of cells between commas, with cells, headings, rows or marks that changed."""
    rows = [line.split(",") for line in text.splitlines()] or [[""]]
    row = int(rng.integers(len(rows))) if rng.random() < 0.7 else 0
    column = int(rng.integers(max(len(rows[row]), 1)))
    hostile = HOSTILE_CELLS[rng.integers(len(HOSTILE_CELLS))]
    end = "\n"
    match int(rng.integers(18)):
        case 0:
            rows[row].append(hostile)
        case 1:
            rows[row].pop(column) if rows[row] else None
        case 2 | 3 | 4 if rows[row]:
            rows[row][column] = hostile
        case 5:  # a whole column
            for cells in rows[1:]:
                cells[column : column + 1] = [hostile]
        case 6:
            rows[0][column : column + 1] = [rows[0][0] if rng.random() < 0.5 else hostile]
        case 7:
            rows[0] = [cell + hostile[:3] for cell in rows[0]]
        case 8:
            rows = rows[:1]
        case 9:
            rows = rows[1:]
        case 10:
            rows.insert(row, [""] * int(rng.integers(5)))
        case 11:
            rows.insert(row, list(rows[row]))
        case 12:
            rows[row] = [f'"{cell}"' for cell in rows[row]]
        case 13:
            end = str(rng.choice(["\r\n", "\r", "\n\n", "\u2028"]))
        case 14:
            return text.replace(",", str(rng.choice([";", "\t", " ", ",,"])))
        case 15:
            return text.replace(".", ",")
        case 16:  # a column goes
            rows = [cells[:column] + cells[column + 1 :] for cells in rows]
        case 17:
            rows = [rows[0], *(rows[i] for i in rng.permutation(range(1, len(rows))))]
            rows = rows[: int(rng.integers(1, len(rows) + 1))]
    return end.join(",".join(cells) for cells in rows) + end


def _spoilt_toml(text, rng):
    lines = text.splitlines() or [""]
    place = int(rng.integers(len(lines)))
    key, equals, _ = lines[place].partition("=")
    hostile = HOSTILE_TOML[rng.integers(len(HOSTILE_TOML))]
    match int(rng.integers(8)):
        case 0 | 1 | 2 | 3 if equals:
            lines[place] = f"{key}= {hostile}"
        case 4:
            lines.pop(place)
        case 5:
            lines.insert(place, lines[place])
        case 6:
            lines[place] = lines[place].replace("=", "x =").replace("]", "x]")
        case _:
            cut = int(rng.integers(len(lines[place]) + 1))
            lines[place] = lines[place][:cut] + hostile
    return "\n".join(lines) + "\n"


def _spoilt_json(text, rng):
    """A JSON text with a value, key, list or order that changed."""
    try:
        saved = json.loads(text)
    except ValueError:
        return _other_bytes(text.encode(errors="surrogatepass"), rng)
    holder, key = _any_place(saved, rng)
    if holder is None:
        return text.encode()
    value = holder[key]
    match int(rng.integers(8)):
        case 0:
            del holder[key]
        case 1 if isinstance(holder, dict):
            holder[f"{key}x"] = holder.pop(key)
        case 2 if isinstance(holder, list):
            holder.insert(key, copy.deepcopy(value))
        case 3 if isinstance(holder, list):
            other = int(rng.integers(len(holder)))
            holder[key], holder[other] = holder[other], value
        case 4 if isinstance(value, int | float) and abs(value) < 1e300:
            holder[key] = value * float(rng.choice([-1, 1e3, 1e-3, 1.1, 0]))
        case 5 if isinstance(value, list):
            holder[key] = value[::-1] if rng.random() < 0.5 else value[: len(value) // 2]
        case _:
            holder[key] = HOSTILE_JSON[rng.integers(len(HOSTILE_JSON))]
    return json.dumps(saved, ensure_ascii=bool(rng.integers(2))).encode(errors="surrogatepass")


def _any_place(saved, rng):
    """(list or object, index or key) of any value in JSON content; (None, None): it has no part."""
    holder, key, value = None, None, saved
    while isinstance(value, list | dict) and value and (holder is None or rng.random() < 0.85):
        holder = value
        keys = range(len(value)) if isinstance(value, list) else sorted(value)
        key = keys[int(rng.integers(len(keys)))]
        value = holder[key]
    return holder, key


def _spoilt_book(data, rng):
    """A workbook with a cell, a sheet or a byte that changed."""
    if rng.random() < 0.15 or not zipfile.is_zipfile(io.BytesIO(data)):
        return _other_bytes(data, rng)
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as book:
            parts = {name: book.read(name) for name in book.namelist()}
    except (zipfile.BadZipFile, zlib.error, NotImplementedError, EOFError, RuntimeError):
        return _other_bytes(data, rng)
    if not parts:
        return _other_bytes(data, rng)
    sheets = [name for name in parts if "worksheets/" in name or "sharedStrings" in name]
    name = str(rng.choice(sheets if sheets and rng.random() < 0.9 else sorted(parts)))
    text = parts[name].decode(errors="replace")
    cells = list(re.finditer(r"<(v|t)>([^<]*)</", text))
    kind = int(rng.integers(6))
    if kind == 0:
        del parts[name]
    elif kind == 1:
        parts[name] = parts[name][: int(rng.integers(len(parts[name]) + 1))]
    elif cells:
        cell = cells[int(rng.integers(len(cells)))]
        hostile = HOSTILE_CELLS[rng.integers(len(HOSTILE_CELLS))]
        hostile = re.sub("[<&\0]", "", hostile)
        changed = text[: cell.start(2)] + hostile + text[cell.end(2) :]
        parts[name] = changed.encode(errors="surrogatepass")
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w") as book:
        for part, content in parts.items():
            book.writestr(part, content)
    return stream.getvalue()


def add_odd_file(files, rng):
    """The files and one more, whose name an editor, an archive or an attacker left there."""
    odd = ODD_NAMES[int(rng.integers(len(ODD_NAMES)))]
    return {odd: files[sorted(files)[int(rng.integers(len(files)))]]} | files


# ---- changes that change no number


def _lines_of(data):
    return data.decode().replace("\r\n", "\n").split("\n")


def _of_text(change):
    """A change of the text of any file."""
    return lambda name, data: change(data.decode())


def _of_lines(change, *endings):
    """A change of each line that is not blank, in files whose names have these endings."""

    def changed(name, data):
        if not name.endswith(endings):
            return None
        return "\n".join(change(one) if one.strip() else one for one in _lines_of(data)).encode()

    return changed


def _with_separator(separator, decimal):
    """The cells of a CSV file between other marks."""

    def changed(name, data):
        if not name.endswith(".csv"):
            return None
        stream = io.StringIO()
        writer = csv.writer(stream, delimiter=separator, lineterminator="\n")
        for line in _lines_of(data):
            if not line.strip() or line.startswith("#"):
                stream.write(line + "\n")
                continue
            writer.writerow(
                re.sub(r"^(-?\d+)\.(\d+(e-?\d+)?)$", rf"\1{decimal}\2", cell)
                for cell in next(csv.reader([line], delimiter=_separator_of(data)))
            )
        return stream.getvalue().encode()

    return changed


def _separator_of(data):
    first = next(line for line in _lines_of(data) if line.strip() and not line.startswith("#"))
    return max(",;\t", key=first.count)


def _quote_cells(name, data):
    if not name.endswith(".csv"):
        return None
    mark = _separator_of(data)
    lines = [
        mark.join(f'"{cell}"' for cell in line.split(mark))
        if line.strip() and not line.startswith("#") and '"' not in line
        else line
        for line in _lines_of(data)
    ]
    return "\n".join(lines).encode()


def _add_comments(name, data):
    """Comments below a table, which move no row that a name or a message refers to."""
    if not name.endswith((".csv", ".toml")):
        return None
    above = b"" if name.endswith(".csv") else b"# a comment; with, marks = 1\n"
    return above + data.rstrip(b"\r\n") + b"\n# the end; with, marks = 1\n"


NEUTRAL = {
    "BOM": _of_text(lambda text: b"\xef\xbb\xbf" + text.encode()),
    "UTF-16": _of_text(lambda text: text.encode("utf-16")),
    "UTF-16 BE": _of_text(lambda text: b"\xfe\xff" + text.encode("utf-16-be")),
    "LF": _of_text(lambda text: text.replace("\r\n", "\n").encode()),
    "CRLF": _of_text(lambda text: re.sub("\r?\n", "\r\n", text).encode()),
    "CR": _of_text(lambda text: re.sub("\r?\n", "\r", text).encode()),
    "BOM and CRLF": _of_text(lambda text: b"\xef\xbb\xbf" + re.sub("\r?\n", "\r\n", text).encode()),
    "blank lines at the end": _of_text(lambda text: (text + "\n\n \n").encode()),
    "no line end at the end": _of_text(lambda text: text.rstrip("\r\n").encode()),
    "spaces at the end of lines": _of_lines(lambda line: line + "  ", ".csv", ".toml", ".json"),
    "semicolons": _with_separator(";", "."),
    "semicolons and decimal commas": _with_separator(";", ","),
    "tabs": _with_separator("\t", "."),
    "tabs and decimal commas": _with_separator("\t", ","),
    "quoted cells": _quote_cells,
    "comments": _add_comments,
}


def spoilt_parts(parts, rng):
    """`job_builder.Parts` with one to three cells, rows, columns or keys that changed."""
    parts = copy.deepcopy(parts)
    for _ in range(rng.integers(1, 4)):
        hostile = HOSTILE_OBJECTS[rng.integers(len(HOSTILE_OBJECTS))]
        if rng.random() < 0.3:
            key = str(rng.choice(sorted(parts.settings)))
            parts.settings[key] = hostile
            continue
        if not any(parts.tables.values()):
            continue
        rows = parts.tables[str(rng.choice([name for name, one in parts.tables.items() if one]))]
        row = rows[rng.integers(len(rows))] if rng.random() < 0.7 else rows[0]
        column = int(rng.integers(max(len(row), 1)))
        match int(rng.integers(6)):
            case 0:
                row.append(hostile)
            case 1:
                del row[column:]
            case 2:
                del rows[1:]
            case 3:
                rows.insert(1, [])
            case _:
                row[column : column + 1] = [hostile]
    return parts
