"""Approximate volume below a dip from nominal dimensions, only for the detection of wrong units."""

import numpy as np

from tankcal.job.checking import zero_z
from tankcal.job.entries import kind_of


def volume_by_sizes(values, raw):
    """Function of a dip (m) that returns m3; None if nominal dimensions are missing."""
    kind = kind_of(raw)
    diameter = values["tank"]["nominal_diameter_m"]
    if kind == "vertical":
        area = None if diameter is None else np.pi / 4 * diameter**2
        shell, zero = values["datum"]["bottom_z_m"], zero_z(values)
        low = 0.0 if None in (shell, zero) else shell - zero
        return None if area is None else lambda dip: area * max(dip - low, 0.0)
    zero = values["datum"]["dip_plate_z_m"] or 0.0
    if kind == "sphere":
        diameter = values["sphere"]["diameter_m"] or diameter
        return None if diameter is None else lambda dip: _cap(dip + zero, diameter / 2)
    if kind == "horizontal":
        given = values["horizontal"]
        height = given["height_m"] or given["diameter_m"] or diameter
        width, length = given["width_m"] or height, given["length_m"]
        if None in (height, width, length):
            return None
        depths = sum(given[f"end_{end}_depth_m"] or 0.0 for end in "ab")
        section = width * (
            length + 2 / 3 * depths
        )  # half an ellipsoid has 2/3 of the volume of its cylinder
        return lambda dip: section * height / 4 * _segment((dip + zero) / height)
    return None


def _cap(depth, radius):
    depth = min(max(depth, 0.0), 2 * radius)
    return np.pi * depth**2 * (radius - depth / 3)


def _segment(fraction):
    """Area of a circle of diameter 2 below a fraction of its height."""
    half = np.arccos(1 - 2 * min(max(fraction, 0.0), 1.0))
    return float(half - np.sin(half) * np.cos(half))
