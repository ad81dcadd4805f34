"""Targets in photographs: coded squares (ArUco, AprilTag) and white circles, to sub-pixels."""

from tankcal.targets.circles import eccentricity_px, read_circles
from tankcal.targets.coded import read_coded
from tankcal.targets.dictionaries import target_image
from tankcal.targets.found import REASONS, Circle, Found, Marker, Refused
from tankcal.targets.reading import Reading, Wanted, read_photographs
from tankcal.targets.writing import ImagePoint, PhotoReading, write_image_points

__all__ = [
    "REASONS",
    "Circle",
    "Found",
    "ImagePoint",
    "Marker",
    "PhotoReading",
    "Reading",
    "Refused",
    "Wanted",
    "eccentricity_px",
    "read_circles",
    "read_coded",
    "read_photographs",
    "target_image",
    "write_image_points",
]
