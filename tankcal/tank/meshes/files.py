"""Meshes from files and to files, through trimesh."""

import io
import re
import warnings
from pathlib import Path

import numpy as np

from tankcal.errors import reason_of
from tankcal.messages import message
from tankcal.tank.meshes.checks import closed_mesh, problem


def clean_mesh_text(kind, data):
    """The bytes of an OFF, OBJ or PLY file as the strictest reader takes it: corners and faces.

    Blank rows, comments, names in quotation marks, line ends of any system and tabs stand in files
    that other programs write and read.
    """
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


FILE_KINDS = ("stl", "obj", "ply", "off")


def read_mesh(path, unit_m=1.0):
    """The closed mesh of a file, as `parse_mesh` gives it; InputError when it cannot be read."""
    path = Path(path)
    try:
        data = path.read_bytes()
    except OSError as error:
        text = message("mesh_file_unreadable", "cannot be read: {reason}", reason=reason_of(error))
        raise problem(path.name, text) from error
    return parse_mesh(path.name, data, unit_m)


def parse_mesh(name, data, unit_m=1.0):
    """The closed mesh in the bytes of an STL, OBJ, PLY or OFF file, checked as `closed_mesh` does.

    Parameters
    ----------
    name
        Of the file, its ending says what it is; z is up.
    unit_m : optional
        Length of one unit of the file, m (0.001 for millimetres).

    Raises
    ------
    InputError
        For data that cannot be read, or what is no closed mesh.
    """
    import trimesh

    kind = Path(name).suffix.lower().lstrip(".")
    if kind not in FILE_KINDS:
        raise problem(
            name,
            message("mesh_ending", "expected one of {names}", names=["." + k for k in FILE_KINDS]),
        )
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # what is wrong, our own problems say
            found = trimesh.load_mesh(
                io.BytesIO(clean_mesh_text(kind, data)),
                file_type=kind,
                process=False,
                skip_materials=True,
            )
        vertices, faces = np.array(found.vertices), np.array(found.faces)
    except Exception as error:  # whatever a parser stumbles over
        raise problem(
            name,
            message(
                "mesh_unreadable",
                "is not a readable {kind_of_file} file; expected closed triangles",
                kind_of_file=kind.upper(),
            ),
        ) from error
    return closed_mesh(vertices, faces, unit_m=unit_m, name=name)


def write_mesh(mesh, path, origin_m=(0.0, 0.0, 0.0)):
    """Write a mesh as an STL, OBJ, PLY or OFF file in metres, for viewers.

    Parameters
    ----------
    origin_m : optional
        Of the file's coordinates, (3,): STL and PLY hold seven digits, half a metre in
        coordinates of UTM size.
    """
    import trimesh

    vertices = mesh.vertices_m - np.asarray(origin_m, dtype=float)
    trimesh.Trimesh(vertices, mesh.faces, process=False).export(Path(path))
