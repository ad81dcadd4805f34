"""Measurement of targets in photographs: coded squares (ArUco, AprilTag) and white circles."""

from tankcal.calibration.targets.circles import eccentricity_px, read_circles
from tankcal.calibration.targets.coded import read_coded
from tankcal.calibration.targets.dictionaries import target_image
from tankcal.calibration.targets.found import REASONS, Circle, Found, Marker, Refused
from tankcal.calibration.targets.reading import Reading, Wanted, read_photographs
from tankcal.calibration.targets.writing import ImagePoint, PhotoReading, write_image_points

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
