"""Scans from inside the tank: points of the bottom, and objects that may be deadwood."""

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
