"""The benchmark's problems as surveys of tankcal."""

import bz2
from pathlib import Path

import numpy as np

from tankcal.camera.model import Form
from tankcal.geometry.rotations import apply_small_rotation, rotation_of_view
from tankcal.survey.network import Camera, Photos, Survey
from tankcal.survey.observations import ControlCoordinates, Distances, ImageCoordinates

TANK_PARAMETERS = [0, 1, 2, 3, 4, 5, 7, 8, 11, 12]


def tank(p):
    """The Survey of a network of sim_tank.py (a mapping of its arrays)."""
    values = np.zeros(13)
    values[TANK_PARAMETERS] = p["io"]
    scope = tuple("block" if i in TANK_PARAMETERS else "off" for i in range(13))
    photos, points = len(p["eo"]), len(p["X"])
    n = len(p["ctl"])
    return Survey(
        points=tuple(f"P{i}" for i in range(points)),
        xyz_m=p["X"],
        image_points=ImageCoordinates(
            p["xy"], np.full(p["xy"].shape, p["sigma"]), p["pt"], p["ph"]
        ),
        photos=Photos(
            tuple(f"S{i}" for i in range(photos)),
            np.zeros(photos, dtype=int),
            p["eo"][:, :3],
            rotation_of_view(*p["eo"][:, 3:].T),
        ),
        cameras=(Camera(values, Form(), scope=scope),),
        observations=(
            ControlCoordinates(
                p["ctl_xyz"].ravel(),
                np.repeat(p["ctl_s"], 3),
                np.repeat(p["ctl"], 3),
                np.tile([0, 1, 2], n),
            ),
            Distances(
                p["dist"],
                p["dist_s"],
                p["dist_i"],
                p["dist_j"],
                instrument=np.full(len(p["dist"]), -1),
            ),
        ),
    )


def bal(path):
    """The Survey of a "Bundle Adjustment in the Large" problem: f, k1, k2 of each photo free."""
    with bz2.open(Path(path), "rt") as file:
        cameras, points, rays = (int(word) for word in file.readline().split())
        table = np.array([file.readline().split() for _ in range(rays)], dtype=float)
        rest = np.array(file.read().split(), dtype=float)
    photo = rest[: 9 * cameras].reshape(-1, 9)
    xyz = rest[9 * cameras :].reshape(points, 3)
    rotation = apply_small_rotation(np.tile(np.eye(3), (cameras, 1, 1)), photo[:, :3])
    values = np.zeros((cameras, 13))
    values[:, 0] = photo[:, 6]
    values[:, 3] = photo[:, 7] / photo[:, 6] ** 2
    values[:, 4] = photo[:, 8] / photo[:, 6] ** 4
    scope = tuple("photo" if i in (0, 3, 4) else "off" for i in range(13))
    return Survey(
        points=tuple(map(str, range(points))),
        xyz_m=xyz,
        image_points=ImageCoordinates(
            table[:, 2:], np.ones((rays, 2)), table[:, 1].astype(int), table[:, 0].astype(int)
        ),
        photos=Photos(
            tuple(map(str, range(cameras))),
            np.arange(cameras),
            -np.einsum("nji,nj->ni", rotation, photo[:, 3:6]),
            rotation,
        ),
        cameras=tuple(Camera(v, Form(), scope=scope) for v in values),
    )
