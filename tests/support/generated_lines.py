"""Reference lines round walls that are no model of the package, with the errors of a crew.

    job, truth = plumbed_job(rng, wall, lines=12, folder=folder, faces=2)

A wall of `generated_walls` leans, its courses stand a little off the straight axis, and the trolley
meets it on the ray from the axis of the reference level: no formula of the package is used. The
plummet's collimation is drawn from its certificate.
"""

from dataclasses import replace

import numpy as np
from generated_strapping import strapped_job
from generated_walls import FULL_TURN

from tankcal.survey.reference_line import Line, Offset, Plummet, ReferenceLines
from tankcal.units import ARCSEC

COLLIMATION = 6 * ARCSEC
PARTS = {1: (0.5,), 2: (0.25, 0.75)}


def on_ray(wall, course, zeta, azimuth_rad, wider_m, centre_m):
    """Distance of the wall, whose level is off by centre_m, along rays from the reference axis."""
    ray = np.column_stack([np.sin(azimuth_rad), np.cos(azimuth_rad)])
    found = np.full(len(azimuth_rad), wall.radius_m)
    at = np.full(len(azimuth_rad), course), np.full(len(azimuth_rad), float(zeta))
    for _ in range(6):
        place = found[:, None] * ray - centre_m
        outline = wall.radius_at(*at, np.arctan2(*place.T) % FULL_TURN) + wider_m
        found = found + outline - np.linalg.norm(place, axis=1)
    return found


def plumbed_job(
    rng, wall, *, lines, folder, faces=2, levels=2, sd_m=0.0005, lean=0.002, off_m=2e-3
):
    """A Job whose first course was strapped and whose others were read from so many lines."""
    job = strapped_job(rng, wall, straps=2, folder=folder, courses=1)
    azimuth = FULL_TURN * np.arange(lines) / lines
    slope, plate = lean * rng.normal(size=2), job.courses[0].thickness_m
    constants = rng.uniform(0.15, 0.25, lines)
    kappa = COLLIMATION * rng.normal()
    offsets, zero = [], None
    for course in range(wall.courses):
        for part in PARTS[levels]:
            level = (course + part) * wall.course_m
            zero = level if zero is None else zero
            is_first = level == zero
            centre = (level - zero) * slope + (not is_first) * off_m * rng.normal(size=2)
            distance = on_ray(wall, course, 2 * part - 1, azimuth, plate, centre)
            for face in range(1, faces + 1):
                lean_of_line = (level - zero) * kappa * (1 if face == 1 else -1)
                read = wall.radius_m + constants - distance + lean_of_line
                read = read + sd_m * rng.normal(size=lines)
                offsets += [
                    Offset(f"L{i}", str(course + 1), level, one, sd_m, face, is_first)
                    for i, one in enumerate(read)
                ]
    u = COLLIMATION if faces == 1 else None
    given = ReferenceLines(
        {f"L{i}": Line(f"L{i}", float(angle), "ZL") for i, angle in enumerate(azimuth)},
        tuple(offsets),
        {"ZL": Plummet("ZL", u_collimation_rad=u)},
    )
    return replace(job, lines=given), {"slope": slope, "kappa": kappa}
