"""Sights to the limbs of a known wall."""

from dataclasses import replace

import numpy as np

from tankcal.planning.wall.nominal_readings import place_stations
from tankcal.units import FULL_TURN


def observe_tangents(job, wall, errors):
    """Return sights past the outside of each course at the aimed height."""
    tangents, datum = job.tangents, job.datum
    zero = datum.bottom_z_m + datum.plate_level_m
    stations, sights = place_stations(job), []
    for name, course, level, is_right in zip(
        *(tangents.setup, tangents.course, tangents.level_m.tolist(), tangents.is_right),
        strict=True,
    ):
        x, y, z = stations[name]
        azimuth, length = wall.limb((x, y), course, level, is_right=bool(is_right))
        sights.append((azimuth % FULL_TURN, np.arctan2(length, zero + level - z)))
    direction, zenith = np.array(sights).T
    return replace(
        tangents,
        direction_rad=direction + errors.draw(tangents.sd_rad),
        zenith_rad=zenith + errors.draw(tangents.sd_rad),
    )
