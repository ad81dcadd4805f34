"""Simulated readings of a total station: angles, and distances to targets or to the wall."""

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Tool:
    """Errors of an instrument.

    Attributes
    ----------
    scale, offset_m : float
        Scale error and offset of distances.
    bias_m : float
        Additional distance to the wall at 60 degrees of incidence, compared with 0 degrees.
    sd_m, sd_rad : float
        Standard deviations of distances and angles.
    """

    scale: float = 0.0
    offset_m: float = 0.0
    bias_m: float = 0.0
    sd_m: float = 0.0
    sd_rad: float = 0.0


def angles_of(away, zero=0.0):
    """Directions (n,), clockwise from `zero`, and zenith angles (n,) of vectors (n, 3), rad."""
    direction = np.arctan2(away[:, 0], away[:, 1]) - zero
    return direction % (2 * np.pi), np.arctan2(np.hypot(away[:, 0], away[:, 1]), away[:, 2])


def rays_of(direction, zenith):
    """Unit vectors (n, 3) of directions, clockwise from +y, and zenith angles, rad."""
    level = np.sin(zenith)
    return np.column_stack([level * np.sin(direction), level * np.cos(direction), np.cos(zenith)])


def read_targets(chance, station, targets, tool, zero=0.0):
    """Simulate direction, zenith angle and distance (n, 3) to targets.

    Parameters
    ----------
    chance : Chance
        Random errors.
    station : ndarray, shape (3,)
        Place of the instrument.
    targets : array_like, shape (n, 3)
        Places of the targets.
    tool : Tool
        Errors of the instrument.
    zero : float
        Azimuth of the zero of the horizontal circle, rad.
    """
    vectors = np.asarray(targets, float) - station
    direction, zenith = angles_of(vectors, zero)
    length = np.linalg.norm(vectors, axis=1) * (1 + tool.scale) + tool.offset_m
    readings = np.column_stack([direction, zenith, length])
    return readings + chance.normal(1.0, readings.shape) * [tool.sd_rad, tool.sd_rad, tool.sd_m]


def incidence(tank, places, rays):
    """Cosines (n,) of the incidence of rays (n, 3) on the wall at places (n, 3).

    The places are those of the tank at the reference temperature.
    """
    radial_vector = places[:, :2] - tank.axis_m(places[:, 2])
    normal = np.column_stack([radial_vector, -(radial_vector @ tank.lean)])
    return np.abs(np.sum(normal * rays, axis=1)) / np.linalg.norm(normal, axis=1)


def read_wall(chance, site, station, aims, tool, zero=0.0):
    """Simulate direction, zenith angle and distance (n, 3) to the expanded wall from inside.

    Parameters
    ----------
    chance : Chance
        Random errors.
    site : Site
        Tank during the survey.
    station : array_like, shape (3,)
        Place of the instrument in the coordinate system of the survey.
    aims : array_like, shape (n, 3)
        Points on the lines of sight, in the same system.
    tool : Tool
        Errors of the instrument.
    zero : float
        Azimuth of the zero of the horizontal circle, rad.
    """
    tank, f = site.tank, site.expansion_factor
    vectors = np.asarray(aims, float) - station
    rays = vectors / np.linalg.norm(vectors, axis=1, keepdims=True)
    origin = (np.asarray(station, float) - site.frame_m) / f
    cool = tank.ranges_m(origin, rays)
    cosine = incidence(tank, origin + cool[:, None] * rays, rays)
    direction, zenith = angles_of(vectors, zero)
    length = f * cool * (1 + tool.scale) + tool.offset_m + tool.bias_m * (1 / cosine - 1)
    readings = np.column_stack([direction, zenith, length])
    return readings + chance.normal(1.0, readings.shape) * [tool.sd_rad, tool.sd_rad, tool.sd_m]
