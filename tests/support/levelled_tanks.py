"""Levellings with known truth: worked examples, and files of settlement.csv."""

import numpy as np

from tankcal.products.inspection.levelling import Epoch
from tankcal.products.inspection.rules import SettlementLimits, Strength

A_MM = (
    *(113.8, 109.5, 100.9, 97.1, 96.2, 87.1, 81.1, 82.4),
    *(86.8, 89.5, 92.0, 103.6, 111.9, 117.1, 118.1, 116.3),
)
TANK_A = Strength(diameter_m=21.3, height_m=11.9, yield_pa=160e6, e_pa=206e9)
LIMITS = SettlementLimits(
    curvature_factor=11,
    least_r2=0.90,
    de_beer=450,
    diameter_per_point_m=3.048,
    largest_arc_m=9.7536,
)


def even_azimuths(count):
    """(count,) rad, from 0."""
    return 2 * np.pi * np.arange(count) / count


def epoch_of(z_mm, azimuth_rad=None, s_mm=1.0, name="1", since=None):
    """Epoch of elevations in mm, evenly spaced unless said otherwise."""
    z = np.asarray(z_mm, dtype=float) / 1000
    azimuth = even_azimuths(len(z)) if azimuth_rad is None else np.asarray(azimuth_rad)
    points = tuple(str(i + 1) for i in range(len(z)))
    return Epoch(name, since, points, azimuth, z, np.broadcast_to(s_mm / 1000, len(z)))


def waves(azimuth_rad, amplitudes_mm):
    """Sum of A cos(k t - phase) of {k: (A, phase)}."""
    return sum(a * np.cos(k * azimuth_rad - phase) for k, (a, phase) in amplitudes_mm.items())


def settlement_rows(epochs, columns="point,azimuth_deg,elevation_m,s_mm,epoch"):
    """Text of settlement.csv of {epoch: {point: (azimuth in degrees, elevation in m)}}."""
    lines = [columns]
    for epoch, points in epochs.items():
        lines += [f"{name},{t},{z},1,{epoch}" for name, (t, z) in points.items()]
    return "\n".join(lines) + "\n"
