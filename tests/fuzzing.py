"""Jobs, plans, workbooks and tables spoilt at random, the same ones on every machine.

spoilt_folder(base, rng)    {file: bytes} with one to three things wrong
spoilt_parts(parts, rng)    the same in the plain data of `job_builder`, for workbooks
"""

import copy
import datetime

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


def spoilt_folder(base, rng):
    """{name: bytes} of the files of `base` ({name: text or bytes}), spoilt."""
    files = {k: v.encode() if isinstance(v, str) else v for k, v in base.items()}
    for _ in range(rng.integers(1, 4)):
        name = str(rng.choice(sorted(files)))
        files[name] = _spoilt_file(name, files[name], rng)
    return files


def _spoilt_file(name, data, rng):
    if rng.random() < 0.08:
        return WHOLE[rng.integers(len(WHOLE))]
    if rng.random() < 0.04:
        return _other_bytes(data, rng)
    try:
        text = data.decode()
    except UnicodeDecodeError:
        return _other_bytes(data, rng)
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
