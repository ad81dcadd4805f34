"""Reading and writing of mesh files, through trimesh."""

import io
import re
import warnings
from pathlib import Path

import numpy as np

from tankcal.errors import reason_of
from tankcal.messages import message
from tankcal.tank.meshes.checks import closed_mesh, problem


def clean_mesh_text(kind, data):
    """Return the bytes of an OFF, OBJ or PLY file reduced to corners and faces.

    Files of other programs contain blank rows, comments, quoted names, line ends of any system and
    tabs, which strict readers refuse.
    """
    if kind == "ply":
        return _clean_ply(data)
    if kind not in ("off", "obj") or b"\0" in data:
        return data
    lines = _split_lines(data)
    return _join_lines(_clean_off(lines) if kind == "off" else _clean_obj(lines))


def _split_lines(data):
    """Return the stripped lines of a file."""
    text = data.decode("utf-8-sig", errors="replace")
    return [line.strip() for line in re.split(r"\r\n|\r|\n", text.replace("\t", " "))]


def _join_lines(lines):
    """Return lines as the bytes of a file."""
    return ("\n".join(lines) + "\n").encode()


def _clean_off(lines):
    """Return rows without comments and blanks, with the first word of the file in capitals."""
    rows = [row for row in (line.partition("#")[0].strip() for line in lines) if row]
    # The strict reader accepts the keyword OFF only in capitals.
    if rows and not rows[0][:1].isdigit():
        word, space, rest = rows[0].partition(" ")
        rows[0] = word.upper() + space + rest
    return rows


def _clean_obj(lines):
    """Return rows of corners and faces only; a backslash at the end continues a row."""
    text = "\n".join(line.partition("#")[0].rstrip() for line in lines).replace("\\\n", " ")
    rows = []
    for line in text.split("\n"):
        word, *numbers = line.split() or [""]
        if word == "v":
            rows.append(" ".join([word, *numbers[:3]]))
        elif word == "f":
            rows.append(" ".join([word, *(index.partition("/")[0] for index in numbers)]))
    return rows


def _clean_ply(data):
    """Remove blank rows and comments from the header, and from the rows of an ASCII file."""
    start = data.lstrip(b"\xef\xbb\xbf \t\r\n")
    header_end = re.search(rb"end_header[ \t]*(\r\n|\r|\n)", start)
    if not start.startswith(b"ply") or header_end is None:
        return data
    header = _filter_ply_rows(_split_lines(start[: header_end.end()]))
    body = start[header_end.end() :]
    # The body of a binary file must remain unchanged.
    if any(row.startswith("format ascii") for row in header):
        body = _join_lines(_filter_ply_rows(_split_lines(body)))
    return _join_lines(header) + body


def _filter_ply_rows(lines):
    """Return the rows without blanks, comments and obj_info."""
    words = ("comment", "obj_info")
    return [line for line in lines if line and line.split()[0] not in words]


FILE_KINDS = ("stl", "obj", "ply", "off")


def read_mesh(path, unit_m=1.0):
    """Return the closed mesh of a file, as `parse_mesh`; InputError if the file cannot be read."""
    path = Path(path)
    try:
        data = path.read_bytes()
    except OSError as error:
        text = message("mesh_file_unreadable", "cannot be read: {reason}", reason=reason_of(error))
        raise problem(path.name, text) from error
    return parse_mesh(path.name, data, unit_m)


def parse_mesh(name, data, unit_m=1.0):
    """Return the closed mesh in the bytes of an STL, OBJ, PLY or OFF file, after `closed_mesh`.

    Parameters
    ----------
    name : str
        Name of the file, whose ending determines the format; z is up.
    data : bytes
    unit_m : float, optional
        Length of a unit of the file, m (0.001 for millimetres).

    Returns
    -------
    Mesh

    Raises
    ------
    InputError
        For data that cannot be read, or that are no closed mesh.
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
            warnings.simplefilter("ignore")  # the checks of `closed_mesh` report all defects
            parsed = trimesh.load_mesh(
                io.BytesIO(clean_mesh_text(kind, data)),
                file_type=kind,
                process=False,
                skip_materials=True,
            )
        vertices, faces = np.array(parsed.vertices), np.array(parsed.faces)
    except Exception as error:  # parsers raise various exceptions for invalid data
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
    mesh : Mesh
    path : str or Path
    origin_m : array_like, shape (3,), optional
        Origin of the coordinates in the file. STL and PLY store seven digits, half a metre for
        coordinates as large as UTM.
    """
    import trimesh

    # A nearby origin preserves the precision of single-precision formats.
    vertices = mesh.vertices_m - np.asarray(origin_m, dtype=float)
    trimesh.Trimesh(vertices, mesh.faces, process=False).export(Path(path))
