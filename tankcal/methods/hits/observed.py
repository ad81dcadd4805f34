"""Hits of a known wall: sights along planned rays, with the inverse of their corrections."""

from dataclasses import replace

import numpy as np

from tankcal.survey.sighting import bias_by_incidence, rays

CLOSE_M, ROUNDS = 1e-12, 20  # convergence limit and largest number of iterations
MILLIMETRES = 3  # decimals to which heights of hits are rounded to form levels


def _stations_of_hits(hits):
    """Instrument positions (n, 3) of the hits."""
    places = {
        name: hits.stations.get(setup.station, np.zeros(3)) + [0.0, 0.0, setup.height_m]
        for name, setup in hits.setups.items()
    }
    return np.array([places[name] for name in hits.setup])


def levels_of_hits(job):
    """Return (course, level above the table's zero, m) of each hit as aimed."""
    hits, datum = job.hits, job.datum
    rise = hits.distance_m * np.cos(hits.zenith_rad)
    z = _stations_of_hits(hits)[:, 2] + rise - datum.bottom_z_m - datum.plate_level_m
    return list(zip(hits.course, np.round(z, MILLIMETRES).tolist(), strict=True))


def observe_hits(job, wall, errors):
    """Return hits along their own sights, up to the inside or outside of the wall."""
    hits, levels = job.hits, levels_of_hits(job)
    station, ray = _stations_of_hits(hits)[:, :2], rays(hits.direction_rad, hits.zenith_rad)[0]
    inside, ray = np.hypot(*station.T) < wall.nominal_m, ray[:, :2]
    distance, cosine = np.empty(len(hits)), np.empty(len(hits))
    kinds = list(zip(levels, inside.tolist(), strict=True))
    for level, within in dict.fromkeys(kinds):
        of_kind = np.array([kind == (level, within) for kind in kinds])
        distance[of_kind], cosine[of_kind] = _intersect(
            wall, station[of_kind], ray[of_kind], level, inside=within
        )
    # Distances with their common errors, then the inverse of the corrections by the certificate.
    known = [hits.instruments[name] for name in hits.instrument]
    bias = [errors.draw_cause("incidence", tool.name) * tool.u_incidence_m for tool in known]
    distance *= 1 + np.array([errors.scale(tool) for tool in known])
    distance += np.array([errors.offset_m(tool) for tool in known])
    distance += np.array(bias) * bias_by_incidence(cosine)
    distance /= 1 + np.array([tool.correction for tool in known])
    distance -= np.array([tool.correction_m for tool in known])
    return replace(
        hits,
        distance_m=distance + errors.draw(hits.sd_m),
        direction_rad=hits.direction_rad + errors.draw(hits.sd_rad),
        zenith_rad=hits.zenith_rad + errors.draw(hits.sd_rad),
    )


def _intersect(wall, station_m, ray, level, *, inside):
    """Distance along horizontal rays (n, 2) to a level of the wall, and cosine of incidence."""
    # First the circle of nominal radius: |station + far ray|^2 = R^2, a quadratic in far.
    square, along = np.sum(ray**2, axis=1), np.sum(station_m * ray, axis=1)
    beyond = along**2 - square * (np.sum(station_m**2, axis=1) - wall.nominal_m**2)
    root = np.sqrt(np.maximum(beyond, 0.0))
    far = (-along + (root if inside else -root)) / square
    # Then Newton: the distance from the axis changes by the slope (cosine of incidence) per metre.
    for _ in range(ROUNDS):
        x, y = (station_m + far[:, None] * ray).T
        away = np.hypot(x, y)
        slope = (x * ray[:, 0] + y * ray[:, 1]) / away
        short = wall.radius_m(*level, np.arctan2(x, y), inside=inside) - away
        far = far + short / slope
        if np.abs(short).max() < CLOSE_M:
            break
    return far, np.abs(slope)
