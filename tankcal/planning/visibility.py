"""What is seen from where: inside the frame, not too obliquely, nothing in the way."""

from dataclasses import dataclass

import numpy as np

from tankcal.camera.model import distort_image_points
from tankcal.planning.model import Pillar
from tankcal.planning.obstacles import find_hidden

FEWEST_READINGS = 3
AHEAD_M = 0.1  # nearest depth of a point before a camera
ROOM = 1.3  # half formats; what lies further out without distortion is not in the frame
GRAZE_M = 1e-3  # by which the tank is taken thinner, so that its own targets are not within it


@dataclass(frozen=True)
class Visibility:
    """What can be measured.

    points    names                 on_photo  (photos, points) True: seen
    image_mm  (photos, points, 2)   on_setup  (set-ups, points) True: seen
    place     (photos,) number of the place that each is taken from
    """

    points: tuple
    place: np.ndarray
    on_photo: np.ndarray
    image_mm: np.ndarray
    on_setup: np.ndarray

    @property
    def rays(self):
        """(points,) places that each point is seen from: exposures from one are one ray."""
        return self.from_places.sum(axis=0) + self.on_setup.sum(axis=0)

    @property
    def from_places(self):
        """(places, points) True: a photograph from there sees the point."""
        found = np.zeros((len(set(self.place.tolist())), len(self.points)), dtype=bool)
        np.logical_or.at(found, self.place, self.on_photo)
        return found


def visible(plan):
    """The Visibility of all points of a Plan from its photographs and set-ups."""
    points = plan.points
    xyz = np.array(list(points.values()), dtype=float).reshape(-1, 3)
    normals = np.full((len(xyz), 3), np.nan)
    normals[: len(plan.targets.names)] = plan.targets.outwards
    names = np.array(list(points), dtype=object)
    for name, out in plan.facing.items():
        normals[names == name] = out
    is_setup = np.isin(names, [one.name for one in plan.setups])
    cameras = {one.camera.name: one for one in plan.job.measurements.cameras}
    on_photo = np.zeros((len(plan.photos), len(xyz)), dtype=bool)
    image = np.full((len(plan.photos), len(xyz), 2), np.nan)
    number, seen_from = {}, []
    for k, photo in enumerate(plan.photos):
        if number.setdefault(tuple(photo.xyz_m), len(number)) == len(seen_from):
            seen_from.append(find_in_sight(plan, photo.xyz_m, xyz, normals))
        image[k], inside = find_in_frame(cameras[photo.camera], photo, xyz)
        on_photo[k] = inside & seen_from[number[tuple(photo.xyz_m)]] & ~is_setup
    place = np.array([number[tuple(one.xyz_m)] for one in plan.photos], dtype=int)
    on_setup = np.zeros((len(plan.setups), len(xyz)), dtype=bool)
    for k, setup in enumerate(plan.setups):
        sighted = ~is_setup | np.isin(names, setup.sights)
        on_setup[k] = sighted & find_in_sight(plan, setup.xyz_m, xyz, normals)
    return Visibility(tuple(points), place, on_photo, image, on_setup)


def measurable(plan, seen):
    """(points,) which points have three readings or more, known coordinates among them.

    What photographs from a single place see has no depth, however many they are; with a tape
    between two such points the count alone would be enough, and neither place determined.
    """
    names = {name: i for i, name in enumerate(seen.points)}
    count = 2 * seen.from_places.sum(axis=0)
    for k, one in enumerate(plan.setups):
        kinds = (one.direction_sd_rad, one.zenith_sd_rad, one.distance_sd_m)
        count = count + seen.on_setup[k] * sum(sd is not None for sd in kinds)
        count[names[one.name]] += FEWEST_READINGS
    for one in plan.known:
        if one.name in names:
            count[names[one.name]] += np.isfinite(one.sd_m).sum()
    return count >= FEWEST_READINGS


def find_in_frame(setup, photo, xyz_m):
    """Image coordinates (n, 2), mm, of points (n, 3), and which lie in the frame of a photograph.

    setup  job.CameraSetup
    """
    u, v, w = photo.rotation @ (xyz_m - photo.xyz_m).T
    camera, half = setup.camera, setup.format_mm / 2
    ahead = w < -AHEAD_M
    ideal = -camera.values[0] * np.column_stack([u, v]) / np.where(ahead, w, -1.0)[:, None]
    near = ahead & (np.abs(ideal) < ROOM * half).all(axis=1)
    image = np.full((len(xyz_m), 2), np.nan)
    image[near] = distort_image_points(ideal[near], camera.values, camera.form)
    return image, near & (np.abs(np.nan_to_num(image, nan=np.inf)) < half).all(axis=1)


def find_in_sight(plan, place_m, xyz_m, normals):
    """(n,) which points (n, 3) nothing hides from a place (3,), and that are not seen too aslant.

    normals  (n, 3) of the wall at each point, or of a mark that faces one way; nan: neither
    """
    back = place_m - xyz_m
    distance = np.linalg.norm(back, axis=1)
    with np.errstate(invalid="ignore", divide="ignore"):
        cosine = np.einsum("ni,ni->n", normals, back) / distance
    on_wall = np.isfinite(normals[:, 0])
    seen = (distance > 0) & np.where(on_wall, cosine > np.cos(plan.limits.incidence_rad), True)
    if plan.shell.outside:
        shell = plan.shell
        tank = Pillar(shell.axis_m, shell.radius_m - GRAZE_M, shell.low_m, shell.high_m, "tank")
        seen &= on_wall | ~find_hidden(tank, place_m, xyz_m)
    else:
        away = np.hypot(*(xyz_m[:, :2] - plan.shell.axis_m).T)
        seen &= away < plan.shell.radius_m + GRAZE_M
    for obstacle in plan.obstacles:
        seen &= ~find_hidden(obstacle, place_m, xyz_m)
    return seen
