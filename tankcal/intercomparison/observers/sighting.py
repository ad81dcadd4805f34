"""What a total station reads: angles, and distances to targets or to the bare wall."""

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Tool:
    """An instrument: what it adds to distances, and how its readings scatter.

    bias_m  how much more it ranges on the wall at 60 degrees of incidence than square to it
    """

    scale: float = 0.0
    offset_m: float = 0.0
    bias_m: float = 0.0
    sd_m: float = 0.0
    sd_rad: float = 0.0


def angles_of(away, zero=0.0):
    """Direction clockwise from a zero, and zenith angle, of vectors (n, 3)."""
    direction = np.arctan2(away[:, 0], away[:, 1]) - zero
    return direction % (2 * np.pi), np.arctan2(np.hypot(away[:, 0], away[:, 1]), away[:, 2])


def rays_of(direction, zenith):
    """(n, 3) unit vectors of directions from +y and zenith angles."""
    level = np.sin(zenith)
    return np.column_stack([level * np.sin(direction), level * np.cos(direction), np.cos(zenith)])


def read_targets(chance, station, targets, tool, zero=0.0):
    """(n, 3) direction, zenith angle, distance read to targets (n, 3)."""
    away = np.asarray(targets, float) - station
    direction, zenith = angles_of(away, zero)
    length = np.linalg.norm(away, axis=1) * (1 + tool.scale) + tool.offset_m
    read = np.column_stack([direction, zenith, length])
    return read + chance.normal(1.0, read.shape) * [tool.sd_rad, tool.sd_rad, tool.sd_m]


def incidence(tank, places, rays):
    """(n,) cosines of the angles between rays and the wall's normal at cool places (n, 3)."""
    away = places[:, :2] - tank.axis_m(places[:, 2])
    normal = np.column_stack([away, -(away @ tank.lean)])
    return np.abs(np.sum(normal * rays, axis=1)) / np.linalg.norm(normal, axis=1)


def read_wall(chance, site, station, aims, tool, zero=0.0):
    """(n, 3) direction, zenith angle, distance read to the warm wall from within.

    station  in the frame of the survey      aims  (n, 3) where the sight goes, in that frame
    """
    tank, f = site.tank, site.grown
    away = np.asarray(aims, float) - station
    rays = away / np.linalg.norm(away, axis=1, keepdims=True)
    origin = (np.asarray(station, float) - site.frame_m) / f
    cool = tank.ranges_m(origin, rays)
    across = incidence(tank, origin + cool[:, None] * rays, rays)
    direction, zenith = angles_of(away, zero)
    length = f * cool * (1 + tool.scale) + tool.offset_m + tool.bias_m * (1 / across - 1)
    read = np.column_stack([direction, zenith, length])
    return read + chance.normal(1.0, read.shape) * [tool.sd_rad, tool.sd_rad, tool.sd_m]
