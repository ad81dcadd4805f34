"""Jobs whose points come from simulated measurements: photographs, tapes and levels of a tank."""

from dataclasses import replace

import numpy as np
from job_builder import write_job
from networks import TAPE_SD_M
from surveyed import known

import tankcal
from tankcal.geometry.rotations import angles_of
from tankcal.survey.measurements import (
    AdjustmentSettings,
    CameraSetup,
    ImageReadings,
    Measurements,
    NominalTank,
    Photo,
    Readings,
)

FORMAT_MM = np.array([180.0, 180.0])
HEIGHT_M, COURSES, COLUMNS = 9.3, 4, 12


def tank_job(folder, **changes):
    """A job of four courses with one ring of 12 points each, as `networks.tank_points` has them."""
    options = {"radius": 6.5, "courses": COURSES, "height": HEIGHT_M, "points_per_ring": COLUMNS}
    write_job(folder / "job", **(options | changes))
    return replace(tankcal.load(folder / "job"), points=None)


def image_readings(survey):
    """The image coordinates of a network.Survey, by name."""
    seen = survey.image_points
    return ImageReadings(
        photo=tuple(survey.photos.names[i] for i in seen.photo),
        point=tuple(survey.points[i] for i in seen.point),
        xy_mm=seen.value,
        sd_mm=seen.sd,
        check=np.zeros(len(seen.point), dtype=bool),
    )


def photos_of(survey, held=None):
    """Photos with their start values; of `held` (a number) place and heading (phi) are fixed."""
    angles = angles_of(survey.photos.rotation)
    photos = []
    for i, name in enumerate(survey.photos.names):
        sd = np.full(6, np.nan)
        if i == held:
            sd[[0, 1, 2, 4]] = 0.0
        values = np.concatenate([survey.photos.xyz_m[i], angles[i]])
        photos.append(Photo(name, survey.cameras[0].name, values, sd))
    return tuple(photos)


def between(table, value, sd, start, end, names, **more):
    """Readings between points that are given by number."""
    value = np.asarray(value, dtype=float)
    return Readings(
        table,
        value,
        np.full(len(value), sd),
        tuple(names[i] for i in start),
        tuple(names[i] for i in end),
        np.zeros(len(value), dtype=bool),
        **more,
    )


def by_tape(survey, instrument=None, factor=1.0):
    """The tape distances of a network.Survey, read with an instrument whose scale is off."""
    tape = next(one for one in survey.observations if type(one).__name__ == "Distances")
    return between(
        "distances", factor * tape.value, TAPE_SD_M, tape.start, tape.end, survey.points,
        instrument=(instrument,) * len(tape.value),
    )  # fmt: skip


def control_of(survey, names, xyz_m, sd_m):
    """Control points out of coordinates (points, 3) of the whole survey."""
    return known(names, np.asarray(xyz_m)[[survey.points.index(name) for name in names]], sd_m)


def measurements(survey, *readings, held=None, settings=None, **more):
    """Measurements by photographs and further readings."""
    return Measurements(
        settings=settings or AdjustmentSettings(snooping=False),
        cameras=(CameraSetup(survey.cameras[0], FORMAT_MM),),
        photos=photos_of(survey, held),
        image_points=image_readings(survey),
        readings=readings,
        nominal=NominalTank(6.5, HEIGHT_M, 0.0),
        **more,
    )
