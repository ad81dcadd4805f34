"""What scans from inside show beside the wall: the bottom, and what stands in the tank."""

from tankcal.clouds.inside.bottom import (
    BottomPoints,
    CloudBottom,
    bottom_points,
    find_cloud_bottom,
)
from tankcal.clouds.inside.things import Thing, find_things

__all__ = [
    "BottomPoints",
    "CloudBottom",
    "Thing",
    "bottom_points",
    "find_cloud_bottom",
    "find_things",
]
