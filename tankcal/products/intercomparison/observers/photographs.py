"""Simulated photographs of targets on the outside of the shell, by an uncalibrated camera."""

import numpy as np

from tankcal.products.intercomparison.site import finish, observe_site
from tankcal.units import FULL_TURN

FRAME_M = (100.0, 200.0, 50.0)  # foot of the axis in the coordinate system of the survey
FORMAT_MM, C_MM = (36.0, 24.0), 20.0  # size of the image, nominal principal distance
# Standard deviations of the interior orientation about its nominal values.
CAMERA_SD = {"c": 0.05, "x0": 0.03, "y0": 0.03, "K1": 3e-5, "K2": 3e-8, "P1": 2e-6, "P2": 2e-6}
# Standard deviations of image and control coordinates, standard uncertainty of the scale.
IMAGE_SD_MM, CONTROL_SD_M, U_SCALE = 6e-4, 1e-3, 10e-6
TARGET_M, U_TARGET_M = 1e-3, 1e-4  # distance from the wall to the centre of a target, and its u
# Generatrices, levels as shares of a course, and approximate number of control points.
GENERATRICES, PARTS, CONTROL = 24, (0.2, 0.8), 12
STATIONS, HEIGHTS_M = 18, (1.5, 4.0)  # number of photographs, alternating heights of the camera
GRAZING = 0.3  # cosine of the incidence below which a target is not measured
FEWEST_RAYS = 3  # least number of photographs of a target
SPOILT, FAR_MM = 0.003, (0.01, 0.05)  # share and size of gross errors in the image


def observe_photographs(tank, chance, asked):
    """Simulate photographs of rings of targets, with control points by a total station."""
    rng = chance.rng
    site = observe_site(tank, chance, asked, outside=True, frame_m=FRAME_M)
    names, azimuth, z = _targets(rng, tank)
    thick = TARGET_M + chance.normal(U_TARGET_M)
    places = site.places(azimuth, z, np.full(len(z), float(thick)))
    interior = {"c": C_MM, "x0": 0.0, "y0": 0.0, "K1": 0.0, "K2": 0.0, "P1": 0.0, "P2": 0.0}
    interior = {key: value + CAMERA_SD[key] * rng.normal() for key, value in interior.items()}
    declared_sd_um = chance.declared(1000 * IMAGE_SD_MM)
    rows, rays = [["photo", "point", "x_mm", "y_mm"]], np.zeros(len(names), dtype=int)
    photos = [["photo", "camera"]]
    for number, (centre, rotation) in enumerate(_stations(rng, site)):
        image, is_seen = photograph(places, site, centre, rotation, interior)
        image = image + chance.normal(IMAGE_SD_MM, image.shape)
        spoilt = chance.blunders(len(image), SPOILT)
        image[spoilt, 0] += rng.uniform(*FAR_MM, len(spoilt))
        photos.append([f"S{number + 1}", "C1"])
        rays += is_seen
        for k in np.flatnonzero(is_seen):
            xy = [round(float(item), 5 if chance.size else 8) for item in image[k]]
            rows.append([f"S{number + 1}", names[k], *xy])
    poor = {names[k] for k in np.flatnonzero(rays < FEWEST_RAYS)}
    tables = site.parts.tables
    tables["image_points"] = [rows[0], *(item for item in rows[1:] if item[1] not in poor)]
    tables["photos"] = photos
    tables["targets"] = [["point", "section", "generatrix", "z_m", "offset_mm"]]
    tables["targets"] += [
        [name, *name[1:].split("-"), round(float(position[2]), 2), 1000 * TARGET_M]
        for name, position in zip(names, places, strict=True)
        if name not in poor
    ]
    tables["control"] = _control(site, names, places, poor)
    site.parts.registers["cameras"] = {
        "C1": {
            "format_mm": list(FORMAT_MM),
            "c_mm": C_MM,
            "convention": "distortion_of_ideal",
            "affinity": "b1_b2",
        }
    }
    site.parts.settings |= {"adjustment.datum": "control", "adjustment.image_sd_um": declared_sd_um}
    site.add_input("scale", 1e6 * U_SCALE, "ppm", "certificate of the total station")
    site.add_input("offset", 1000 * U_TARGET_M, "mm", "thickness of the targets")
    return finish(site)


def _targets(rng, tank):
    """Names T{section}-{generatrix}, azimuths and heights of targets, two rings per course."""
    names, azimuth, z = [], [], []
    section = 0
    for low, height in zip(tank.joints_m[:-1], tank.courses_m, strict=True):
        for part in PARTS:
            section += 1
            for k in range(GENERATRICES):
                names.append(f"T{section}-{k + 1}")
                azimuth.append(FULL_TURN * (k + 0.1 * rng.uniform(-1, 1)) / GENERATRICES)
                z.append(low + height * (part + 0.02 * rng.uniform(-1, 1)))
    return names, np.array(azimuth), np.array(z)


def _stations(rng, site):
    """Yield projection centres and rotations into the image; one of three has a roll of 90 deg."""
    tank = site.tank
    stand_off = max(6.0, 0.9 * tank.height_m)
    for k in range(STATIONS):
        azimuth = FULL_TURN * (k + 0.1 * rng.normal()) / STATIONS
        distance = tank.radius_m + stand_off * rng.uniform(0.9, 1.1)
        height = HEIGHTS_M[k % 2] + 0.1 * rng.normal()
        centre = site.frame_m + [distance * np.sin(azimuth), distance * np.cos(azimuth), height]
        aim = site.frame_m + [*(0.2 * rng.normal(size=2)), 0.5 * tank.height_m]
        roll = 0.03 * rng.normal() + (0.0 if k % 3 else 1.0) * np.pi / 2
        yield centre, camera_rotation(centre, aim, roll)


def camera_rotation(centre, aim, roll):
    """Rotation (3, 3) of a camera aimed at a point, with rows x right, y up and z backwards.

    Parameters
    ----------
    centre, aim : ndarray, shape (3,)
        Projection centre, and the point on the optical axis.
    roll : float
        Rotation about the optical axis, rad.
    """
    back = centre - aim
    back = back / np.linalg.norm(back)
    right = np.cross([0.0, 0.0, 1.0], back)
    right /= np.linalg.norm(right)
    up = np.cross(back, right)
    roll_matrix = np.array([[np.cos(roll), np.sin(roll)], [-np.sin(roll), np.cos(roll)]])
    return np.vstack([roll_matrix @ np.vstack([right, up]), back])


def photograph(places, site, centre, rotation, interior):
    """Image coordinates of targets, and their visibility.

    Parameters
    ----------
    places : ndarray, shape (n, 3)
        Targets in the coordinate system of the survey.
    site : Site
        Tank during the survey.
    centre, rotation : ndarray, shapes (3,) and (3, 3)
        Exterior orientation, as in `camera_rotation`.
    interior : dict
        Interior orientation c, x0, y0, K1, K2, P1 and P2, mm.

    Returns
    -------
    ndarray, shape (n, 2)
        Image coordinates, mm.
    ndarray of bool, shape (n,)
        Whether a target is in the image and not hidden by grazing incidence.
    """
    u, v, w = rotation @ (places - centre).T
    ahead = w < -0.5
    w = np.where(ahead, w, -1.0)
    x, y = -interior["c"] * u / w, -interior["c"] * v / w
    r2 = x * x + y * y
    radial = interior["K1"] * r2 + interior["K2"] * r2 * r2
    p1, p2 = interior["P1"], interior["P2"]
    image = np.column_stack([
        interior["x0"] + x * (1 + radial) + p1 * (r2 + 2 * x * x) + 2 * p2 * x * y,
        interior["y0"] + y * (1 + radial) + p2 * (r2 + 2 * y * y) + 2 * p1 * x * y,
    ])  # fmt: skip
    inside = (np.abs(image) < np.array(FORMAT_MM) / 2).all(axis=1)
    radial_vector = (
        places[:, :2] - site.frame_m[:2] - site.tank.axis_m(places[:, 2] - site.frame_m[2])
    )
    back = centre - places
    outwards = np.sum(radial_vector * back[:, :2], axis=1)
    cosine = outwards / np.hypot(*radial_vector.T) / np.linalg.norm(back, axis=1)
    return image, ahead & inside & (cosine > GRAZING)


def _control(site, names, places, poor):
    """Rows of control points: targets over the whole shell, measured by a total station."""
    chance = site.chance
    scale = chance.normal(U_SCALE)
    good = [k for k, name in enumerate(names) if name not in poor]
    chosen = good[:: max(len(good) // CONTROL, 1)]
    observed = site.frame_m + (1 + scale) * (places[chosen] - site.frame_m)
    observed = observed + chance.normal(CONTROL_SD_M, observed.shape)
    sd = [1000 * CONTROL_SD_M] * 3
    rows = [["point", "x_m", "y_m", "z_m", "sx_mm", "sy_mm", "sz_mm"]]
    return rows + [
        [names[k], *np.round(point, 5).tolist(), *sd]
        for k, point in zip(chosen, observed, strict=True)
    ]
