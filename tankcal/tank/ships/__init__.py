"""Tanks of ships and barges: a mesh with trim and list, sounded along a pipe."""

from tankcal.tank.ships.corrections import (
    CellCorrections,
    corrections_of,
    soundings_of_volumes,
)
from tankcal.tank.ships.piped import Pipe, PipedMesh, in_ship_frame, piped_mesh

__all__ = [
    "CellCorrections",
    "Pipe",
    "PipedMesh",
    "corrections_of",
    "in_ship_frame",
    "piped_mesh",
    "soundings_of_volumes",
]
