"""Closed meshes of triangles as tanks: part of a table, checks, files, and lofts of a shell."""

from tankcal.tank.meshes.checks import closed_mesh, holds
from tankcal.tank.meshes.files import (
    FILE_KINDS,
    Band,
    loft,
    parse_mesh,
    read_mesh,
    shell_bands,
    write_mesh,
)
from tankcal.tank.meshes.part import Mesh, MeshPart, mesh_part

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
