"""The text of mesh files as the strictest reader takes it: corners and faces, nothing beside.

Blank rows, comments, names in quotation marks, line ends of any system and tabs stand in files that
other programs write and read.
"""

import re


def cleaned(kind, data):
    """The bytes of an OFF, OBJ or PLY file without what says nothing of its surface."""
    if kind == "ply":
        return _ply(data)
    if kind not in ("off", "obj") or b"\0" in data:
        return data
    lines = _lines(data)
    return _joined(_off(lines) if kind == "off" else _obj(lines))


def _lines(data):
    text = data.decode("utf-8-sig", errors="replace")
    return [line.strip() for line in re.split(r"\r\n|\r|\n", text.replace("\t", " "))]


def _joined(lines):
    return ("\n".join(lines) + "\n").encode()


def _off(lines):
    """Rows without comments and blanks; the first word of the file in capitals."""
    rows = [row for row in (line.partition("#")[0].strip() for line in lines) if row]
    if rows and not rows[0][:1].isdigit():
        word, space, rest = rows[0].partition(" ")
        rows[0] = word.upper() + space + rest
    return rows


def _obj(lines):
    """Corners and faces alone; a row that ends in a backslash goes on in the next."""
    text = "\n".join(line.partition("#")[0].rstrip() for line in lines).replace("\\\n", " ")
    rows = []
    for line in text.split("\n"):
        word, *numbers = line.split() or [""]
        if word == "v":
            rows.append(" ".join([word, *numbers[:3]]))
        elif word == "f":
            rows.append(" ".join([word, *(one.partition("/")[0] for one in numbers)]))
    return rows


def _ply(data):
    """Blank rows and comments go from the header, from the rows of a file of text, too."""
    start = data.lstrip(b"\xef\xbb\xbf \t\r\n")
    found = re.search(rb"end_header[ \t]*(\r\n|\r|\n)", start)
    if not start.startswith(b"ply") or found is None:
        return data
    header = _rows_of_ply(_lines(start[: found.end()]))
    body = start[found.end() :]
    if any(row.startswith("format ascii") for row in header):
        body = _joined(_rows_of_ply(_lines(body)))
    return _joined(header) + body


def _rows_of_ply(lines):
    words = ("comment", "obj_info")
    return [line for line in lines if line and line.split()[0] not in words]
