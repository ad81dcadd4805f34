"""Meshes from files and to files, through trimesh."""

import io
import warnings
from pathlib import Path

import numpy as np

from tankcal.messages import message
from tankcal.tank.meshes.checks import closed_mesh, problem
from tankcal.tank.meshes.cleaning import cleaned

FILE_KINDS = ("stl", "obj", "ply", "off")


def read_mesh(path, unit_m=1.0):
    """The closed mesh of a file, as `parse_mesh` gives it; InputError when it cannot be read."""
    path = Path(path)
    try:
        data = path.read_bytes()
    except OSError as error:
        raise problem(path.name, f"cannot be read: {error.strerror}") from error
    return parse_mesh(path.name, data, unit_m)


def parse_mesh(name, data, unit_m=1.0):
    """The closed mesh in the bytes of an STL, OBJ, PLY or OFF file, checked as `closed_mesh` does.

    name    of the file, its ending says what it is; z is up
    unit_m  length of one unit of the file, m (0.001 for millimetres)
    Raises InputError for data that cannot be read, or what is no closed mesh.
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
                io.BytesIO(cleaned(kind, data)), file_type=kind, process=False, skip_materials=True
            )
        vertices, faces = np.array(found.vertices), np.array(found.faces)
    except Exception as error:  # whatever a parser stumbles over
        raise problem(
            name,
            message(
                "mesh_unreadable",
                "is no {kind_of_file} file that can be read; expected closed triangles",
                kind_of_file=kind.upper(),
            ),
        ) from error
    return closed_mesh(vertices, faces, unit_m=unit_m, name=name)


def write_mesh(mesh, path, origin_m=(0.0, 0.0, 0.0)):
    """Write a mesh as an STL, OBJ, PLY or OFF file in metres, for viewers.

    origin_m  of the file's coordinates, (3,): STL and PLY hold seven digits, half a metre in
              coordinates of UTM size
    """
    import trimesh

    vertices = mesh.vertices_m - np.asarray(origin_m, dtype=float)
    trimesh.Trimesh(vertices, mesh.faces, process=False).export(Path(path))
