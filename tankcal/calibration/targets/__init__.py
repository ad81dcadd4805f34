"""Measurement of targets in photographs: coded squares (ArUco, AprilTag) and white circles."""

from tankcal.calibration.targets.circles import eccentricity_px, read_circles
from tankcal.calibration.targets.coded import read_coded
from tankcal.calibration.targets.pictures import target_image
from tankcal.calibration.targets.reading import (
    ImagePoint,
    PhotoReading,
    TargetReport,
    TargetSettings,
    read_photographs,
    write_image_points,
)
from tankcal.calibration.targets.results import REASONS, Circle, Marker, PhotoTargets, RefusedTarget

__all__ = [
    "REASONS",
    "Circle",
    "ImagePoint",
    "Marker",
    "PhotoReading",
    "PhotoTargets",
    "RefusedTarget",
    "TargetReport",
    "TargetSettings",
    "eccentricity_px",
    "read_circles",
    "read_coded",
    "read_photographs",
    "target_image",
    "write_image_points",
]
