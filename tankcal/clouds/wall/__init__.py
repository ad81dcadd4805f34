"""Wall of a tank from points of scans: decision by cells, obstructions, and readings."""

from tankcal.clouds.wall.cells import CloudReadings, readings_of
from tankcal.clouds.wall.deciding import CloudWall
from tankcal.clouds.wall.passes import Passes, find_cloud_wall, sample_points, sum_cells

__all__ = [
    "CloudReadings",
    "CloudWall",
    "Passes",
    "find_cloud_wall",
    "readings_of",
    "sample_points",
    "sum_cells",
]
