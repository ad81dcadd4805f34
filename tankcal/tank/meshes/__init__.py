"""Closed meshes of triangles as tanks: part of a table, checks, files, and lofts of a shell.

Meshes from files, through trimesh, and meshes lofted from the outlines of a shell.

A lofted mesh is an independent check of the volume of a shell, and its picture.
"""

import io
import re
import warnings
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np
import scipy

from tankcal.errors import reason_of
from tankcal.geometry.field.estimate import LEVELS
from tankcal.messages import message
from tankcal.quadrature import height_basis
from tankcal.tank.meshes.part import Mesh, MeshPart, closed_mesh, holds, mesh_part, problem
from tankcal.tank.volumes import gauss_levels
from tankcal.units import FULL_TURN

__all__ = [
    "FILE_KINDS",
    "Band",
    "Mesh",
    "MeshPart",
    "closed_mesh",
    "holds",
    "loft",
    "mesh_part",
    "parse_mesh",
    "read_mesh",
    "shell_bands",
    "write_mesh",
]


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


@dataclass(frozen=True)
class Band:
    """Rings of the wall from a joint to the next: k heights, q evenly spaced azimuths from north.

    Attributes
    ----------
    heights_m : ndarray, shape (k,)
        Ascending heights, the first and the last at the joints.
    radii_m : ndarray, shape (k, q)
        Inside radii about the centre of their ring.
    centre_m : ndarray, shape (k, 2)
        x and y of the centres.
    """

    heights_m: np.ndarray
    radii_m: np.ndarray
    centre_m: np.ndarray


def shell_bands(volume, *, slices=8, azimuths=720):
    """Return the bands of a shell, one for each course, from the outlines of its volume.

    Parameters
    ----------
    volume : tankcal.tank.volumes.ShellVolume
    slices : int, optional
        Slices of a course.
    azimuths : int, optional
        Azimuths of a ring.

    Returns
    -------
    tuple of Band
    """
    azimuth = np.arange(azimuths) * FULL_TURN / azimuths
    parts = np.linspace(0.0, 1.0, slices + 1)
    basis = height_basis(gauss_levels(), parts, LEVELS - 1)
    bands = []
    for course in volume.courses:
        outlines = basis @ course.outlines_m
        grid = np.linspace(0.0, FULL_TURN, outlines.shape[1] + 1)
        closed = np.column_stack([outlines, outlines[:, 0]])
        # Periodic spline: the outlines have other azimuths than the rings of the mesh.
        radii = scipy.interpolate.CubicSpline(grid, closed, axis=1, bc_type="periodic")(azimuth)
        heights = course.bottom_m + parts * course.height_m
        heights[-1] = course.top_m
        bands.append(Band(heights, radii, np.zeros((len(parts), 2))))
    return tuple(bands)


def loft(bands):
    """Return a closed mesh over bands from the bottom up, with a level bottom and lid.

    Two triangles for each azimuth connect neighbouring rings. A step at a joint is also such a
    strip, a level one. The volume of the mesh is too small by the square of the spacing.

    Parameters
    ----------
    bands : sequence of Band
        Bands with equal numbers of azimuths; each starts at the height where the band below ends.

    Returns
    -------
    Mesh

    Raises
    ------
    ValueError
        For bands that do not fit.
    InputError
        As for `closed_mesh`.
    """
    joints = [(below.heights_m[-1], above.heights_m[0]) for below, above in pairwise(bands)]
    if any(low != high for low, high in joints):
        raise ValueError(f"joints at {joints}; expected each band to begin where the last one ends")
    count = bands[0].radii_m.shape[1]
    azimuth = np.arange(count) * FULL_TURN / count
    turn = np.column_stack([np.sin(azimuth), np.cos(azimuth)])
    rings = []
    for band in bands:
        xy = band.centre_m[:, None] + band.radii_m[:, :, None] * turn
        z = np.broadcast_to(band.heights_m[:, None, None], (*xy.shape[:2], 1))
        rings.append(np.concatenate([xy, z], axis=2).reshape(-1, 3))
    wall = np.concatenate(rings)
    ends = np.array(
        [
            [*bands[0].centre_m[0], bands[0].heights_m[0]],
            [*bands[-1].centre_m[-1], bands[-1].heights_m[-1]],
        ]
    )
    return closed_mesh(np.concatenate([wall, ends]), _make_faces(len(wall), count), name="loft")


def _make_faces(vertices, count):
    """Return faces (m, 3) of `vertices` in rings of `count`, then the centres of bottom and lid."""
    index = np.arange(count)
    next_index = np.roll(index, -1)
    # Index offsets of the rings: each strip connects a ring with the next.
    strips = np.arange(0, vertices - count, count)[:, None, None]
    side = np.concatenate(
        [
            np.column_stack([index, index + count, next_index]),
            np.column_stack([next_index, index + count, next_index + count]),
        ]
    )
    top = vertices - count
    bottom = np.column_stack([index, next_index, np.full(count, vertices)])
    lid = np.column_stack([next_index + top, index + top, np.full(count, vertices + 1)])
    return np.concatenate([(strips + side).reshape(-1, 3), bottom, lid])
