"""Simulated surveys of a small tank: photographs, tapes, control, total station; truth known."""

from dataclasses import dataclass

import numpy as np

from tankcal.camera.model import Form, distort_image_points
from tankcal.geometry.rotations import apply_small_rotation, rotation_of_view
from tankcal.survey.network import Camera, Photos, Survey
from tankcal.survey.observations import (
    ControlCoordinates,
    Directions,
    Distances,
    ImageCoordinates,
    VerticalAngles,
)

INTERIOR = np.array([100.02, 0.03, -0.04, 2e-8, -1e-12, 0, 0, 3e-7, -2e-7, 0, 0, 1e-4, -8e-5])
SCOPE = tuple("block" if i in (0, 1, 2, 3, 4, 7, 8, 11, 12) else "off" for i in range(13))
IMAGE_SD_MM, TAPE_SD_M, CONTROL_SD_M = 0.005, 0.001, 0.002


@dataclass(frozen=True)
class Truth:
    """What a simulated survey was made from: xyz_m, photo_xyz_m, rotation, interior."""

    xyz_m: np.ndarray
    photo_xyz_m: np.ndarray
    rotation: np.ndarray
    interior: np.ndarray


def tank_points(columns=12, rows=4, radius_m=6.5, height_m=9.0):
    """Points (n, 3) on the wall, a little out of round."""
    azimuth, z = np.meshgrid(
        np.arange(columns) * 2 * np.pi / columns, np.linspace(0.3, height_m, rows)
    )
    azimuth, z = azimuth.ravel(), z.ravel()
    r = radius_m + 0.03 * np.cos(2 * azimuth + z / 4)
    return np.column_stack([r * np.sin(azimuth), r * np.cos(azimuth), z])


def photographed(seed=0, photos=8, form=None, interior=INTERIOR, noise=1.0, scope=SCOPE):
    """A Survey by photographs, 8 tape distances and 8 control points, and its Truth."""
    rng, form = np.random.default_rng(seed), form or Form()
    xyz = tank_points()
    azimuth = np.arange(photos) * 2 * np.pi / photos + 0.02 * rng.normal(size=photos)
    away = 15 + 2 * rng.random(photos)
    stations = np.column_stack(
        [away * np.sin(azimuth), away * np.cos(azimuth), 1.5 + 3 * (azimuth > 3)]
    )
    tilt = np.arctan2(4.7 - stations[:, 2], away)
    rotation = rotation_of_view(
        azimuth + np.pi, tilt, 0.02 * rng.normal(size=photos) + np.pi / 2 * (azimuth > 4)
    )
    photo, point = (a.ravel() for a in np.mgrid[:photos, : len(xyz)])
    u, v, w = np.einsum("nij,nj->in", rotation[photo], xyz[point] - stations[photo])
    xy = distort_image_points(interior[0] * np.column_stack([-u / w, -v / w]), interior, form)
    facing = np.sum((stations[photo] - xyz[point]) * xyz[point] * [1, 1, 0], axis=1)
    seen = (np.abs(xy[:, 0]) < 90) & (np.abs(xy[:, 1]) < 90) & (facing > 0)
    photo, point, xy = photo[seen], point[seen], xy[seen]
    xy = xy + noise * rng.normal(0, IMAGE_SD_MM, xy.shape)
    start, end = np.arange(8), np.arange(8) + 36
    length = np.linalg.norm(xyz[start] - xyz[end], axis=1) + noise * rng.normal(0, TAPE_SD_M, 8)
    control = np.repeat(np.arange(1, 48, 6), 3)
    axis = np.tile([0, 1, 2], 8)
    value = xyz[control, axis] + noise * rng.normal(0, CONTROL_SD_M, 24)
    start_interior = np.where(
        np.array(scope) == "off", 0.0, np.where(np.arange(13) < 1, 100.0, 0.0)
    )
    survey = Survey(
        points=tuple(f"P{i}" for i in range(len(xyz))),
        xyz_m=xyz + rng.normal(0, 0.05, xyz.shape),
        image_points=ImageCoordinates(xy, np.full(xy.shape, IMAGE_SD_MM), point, photo),
        photos=Photos(
            tuple(f"S{i}" for i in range(photos)),
            np.zeros(photos, dtype=int),
            stations + rng.normal(0, 0.1, stations.shape),
            apply_small_rotation(rotation, rng.normal(0, 0.01, (photos, 3))),
        ),
        cameras=(Camera(start_interior, form, scope=scope),),
        observations=(
            ControlCoordinates(value, np.full(24, CONTROL_SD_M), control, axis),
            Distances(length, np.full(8, TAPE_SD_M), start, end, instrument=np.full(8, -1)),
        ),
    )
    return survey, Truth(xyz, stations, rotation, interior)


def by_total_station(seed=0, noise=1.0):
    """A Survey by total station, four set-ups about the tank, no control, and its Truth."""
    rng = np.random.default_rng(seed)
    wall = tank_points(8, 3)
    azimuth = np.pi / 4 + np.arange(4) * np.pi / 2
    stations = np.column_stack([18 * np.sin(azimuth), 18 * np.cos(azimuth), [0, 0.2, -0.1, 0.3]])
    xyz = np.vstack([wall, stations])
    start, end = [], []
    for i in range(4):
        me = len(wall) + i
        seen = np.flatnonzero(np.sum((stations[i] - wall) * wall * [1, 1, 0], axis=1) > 0)
        others = len(wall) + np.array([(i + 1) % 4, (i + 3) % 4])
        end += [*seen, *others]
        start += [me] * (len(seen) + 2)
    start, end = np.array(start), np.array(end)
    x, y, z = (xyz[end] - xyz[start]).T
    n, zeros = len(x), rng.uniform(0, 6, 4)
    arcsec = np.pi / 648000
    sd_angle, sd_distance = np.full(n, 3 * arcsec), np.full(n, 0.001)
    number = start - len(wall)
    direction = np.arctan2(x, y) - zeros[number] + noise * rng.normal(0, 3 * arcsec, n)
    zenith = np.arctan2(np.hypot(x, y), z) + noise * rng.normal(0, 3 * arcsec, n)
    distance = np.sqrt(x * x + y * y + z * z) + noise * rng.normal(0, 0.001, n)
    survey = Survey(
        points=tuple(f"P{i}" for i in range(len(xyz))),
        xyz_m=xyz + rng.normal(0, 0.02, xyz.shape),
        observations=(
            Directions(direction, sd_angle, start, end, set=number),
            VerticalAngles(zenith, sd_angle, start, end, zenith=True),
            Distances(distance, sd_distance, start, end, instrument=np.full(n, -1)),
        ),
        sets=zeros + 0.001,
    )
    return survey, Truth(xyz, np.zeros((0, 3)), np.zeros((0, 3, 3)), INTERIOR)
