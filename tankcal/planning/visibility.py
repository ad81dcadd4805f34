"""What is seen from where: inside the frame, not too obliquely, nothing in the way.

A line of sight from S to X is cut by a box when the slabs of its three axes overlap along it, by an
upright cylinder when a part of it within the radius lies between bottom and top.
"""

from dataclasses import dataclass

import numpy as np

from tankcal.camera.model import distort_image_points
from tankcal.planning.model import Box, Pillar

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


def find_hidden(obstacle, place_m, xyz_m):
    """(n,) True where the line from a place (3,) to a point (n, 3) meets a Box or a Pillar."""
    along = xyz_m - place_m
    if isinstance(obstacle, Box):
        first, last = _in_slabs(place_m, along, obstacle.low_m, obstacle.high_m)
    else:
        low, high = np.full(3, -np.inf), np.full(3, np.inf)
        low[2], high[2] = obstacle.low_m, obstacle.high_m
        first, last = _in_slabs(place_m, along, low, high)
        near, far = _in_round(place_m[:2] - obstacle.axis_m, along[:, :2], obstacle.radius_m)
        first, last = np.maximum(first, near), np.minimum(last, far)
    return np.maximum(first, 0.0) < np.minimum(last, 1.0)


def _in_slabs(place, along, low, high):
    """Parts of the line (n,), (n,) between which it is within the slabs of three axes."""
    still = along == 0
    step = np.where(still, 1.0, along)
    one, two = (low - place) / step, (high - place) / step
    inside = (place > low) & (place < high)
    first = np.where(still, np.where(inside, -np.inf, np.inf), np.minimum(one, two))
    last = np.where(still, np.where(inside, np.inf, -np.inf), np.maximum(one, two))
    return first.max(axis=1), last.min(axis=1)


def _in_round(place, along, radius):
    """The same within a circle: |place + t along| < radius."""
    a, b = np.einsum("ni,ni->n", along, along), along @ place
    c = place @ place - radius**2
    with np.errstate(invalid="ignore", divide="ignore"):
        root = np.sqrt(b * b - a * c)
        near, far = (-b - root) / a, (-b + root) / a
    near = np.where(a > 0, near, -np.inf if c < 0 else np.inf)
    far = np.where(a > 0, far, np.inf if c < 0 else -np.inf)
    misses = np.isnan(near)
    return np.where(misses, np.inf, near), np.where(misses, -np.inf, far)
