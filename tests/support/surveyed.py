"""Measurements as a job has them, made of the simulated surveys of networks.py."""

from dataclasses import replace

import numpy as np
from messages_told import lines
from networks import by_total_station, photographed

from tankcal.errors import SolutionError
from tankcal.survey import adjust_survey
from tankcal.survey.measurements import (
    AdjustmentSettings,
    CameraSetup,
    ImageReadings,
    Instrument,
    KnownPoints,
    Measurements,
    NominalTank,
    Photo,
    Readings,
    Setup,
    Targets,
)


def known(names, xyz_m, sd_m, check=None, file="control.csv", system=None):
    """KnownPoints of names (n,), coordinates (n, 3) and sds, broadcast."""
    n = len(names)
    return KnownPoints(
        point=tuple(names),
        xyz_m=np.array(xyz_m, dtype=float).reshape(n, 3),
        sd_m=np.array(np.broadcast_to(sd_m, (n, 3)), dtype=float),
        system=system or (None,) * n,
        check=np.zeros(n, dtype=bool) if check is None else np.asarray(check),
        rows=tuple(range(2, n + 2)),
        file=file,
    )


def table(name, value, sd, start, end, **more):
    """Readings of a table; rows count from 2."""
    n = len(value)
    more.setdefault("check", np.zeros(n, dtype=bool))
    return Readings(
        name,
        np.array(value, dtype=float),
        np.array(np.broadcast_to(sd, (n,)), dtype=float),
        tuple(start),
        tuple(end),
        rows=tuple(range(2, n + 2)),
        **more,
    )


def by_photographs(seed=0, settings=None, **options):
    """Measurements by photographs, 8 distances of tape 1 and 8 control points; and the Truth."""
    survey, truth = photographed(seed, **options)
    images, photos, names = survey.image_points, survey.photos.names, survey.points
    control, tapes = survey.observations
    n, number = len(images.photo), control.point[::3]
    unknown = np.full(6, np.nan)
    return (
        Measurements(
            settings=settings or AdjustmentSettings(),
            cameras=(CameraSetup(survey.cameras[0], np.array([180.0, 180.0])),),
            photos=tuple(Photo(p, "camera", unknown, unknown, i + 2) for i, p in enumerate(photos)),
            image_points=ImageReadings(
                tuple(photos[i] for i in images.photo),
                tuple(names[i] for i in images.point),
                images.value,
                images.sd,
                np.zeros(n, dtype=bool),
                tuple(range(2, n + 2)),
            ),
            control=known(
                [names[i] for i in number], control.value.reshape(-1, 3), control.sd.reshape(-1, 3)
            ),
            targets=Targets(
                names,
                tuple(str(i // 12 + 1) for i in range(48)),
                tuple(str(i % 12 + 1) for i in range(48)),
                np.repeat(np.linspace(0.3, 9, 4), 12),
                np.zeros(48),
            ),
            nominal=NominalTank(6.5, 9.5, 0.0),
            instruments=(Instrument("tape 1", "tape", u_scale=2e-5),),
            readings=(
                table(
                    "distances",
                    tapes.value,
                    tapes.sd,
                    [names[i] for i in tapes.start],
                    [names[i] for i in tapes.end],
                    instrument=("tape 1",) * len(tapes.value),
                ),
            ),
        ),
        truth,
    )


def by_instruments(seed=0, noise=1.0, settings=None):
    """Measurements by total station from four set-ups, three of its stations control; the Truth.

    Heights of instruments are 1.5 m and more, of targets 0.1 m.
    """
    survey, truth = by_total_station(seed, noise)
    directions, zeniths, slopes = survey.observations
    names, xyz = survey.points, truth.xyz_m
    stations = sorted(set(directions.start.tolist()))
    setups = tuple(
        Setup(f"set-up {k}", names[i], "total station", 1.5 + 0.1 * k, k + 2)
        for k, i in enumerate(stations)
    )
    place = {i: one for i, one in zip(stations, setups, strict=True)}
    of = tuple(place[i].name for i in directions.start.tolist())
    rise = np.array([place[i].height_m for i in directions.start.tolist()]) - 0.1
    end = tuple(names[i] for i in directions.end)
    start = (None,) * len(end)
    x, y, z = (xyz[directions.end] - xyz[directions.start]).T
    zenith_noise = zeniths.value - np.arctan2(np.hypot(x, y), z)
    slope_noise = slopes.value - np.sqrt(x * x + y * y + z * z)
    z = z - rise
    zenith = np.arctan2(np.hypot(x, y), z) + zenith_noise
    slope = np.sqrt(x * x + y * y + z * z) + slope_noise
    height = np.full(len(end), 0.1)
    common = {"setup": of, "target_height_m": height}
    return (
        Measurements(
            settings=settings or AdjustmentSettings(),
            control=known([names[i] for i in stations[:3]], xyz[stations[:3]], 0.001),
            instruments=(Instrument("total station", "total_station"),),
            setups=setups,
            readings=(
                table("directions", directions.value, directions.sd, start, end, setup=of),
                table("zenith_angles", zenith, zeniths.sd, start, end, **common),
                table("slope_distances", slope, slopes.sd, start, end, **common),
            ),
        ),
        truth,
    )


def changed(measurements, name, **fields):
    """The measurements with fields of one table of readings changed."""
    readings = tuple(
        replace(one, **fields) if one.table == name else one for one in measurements.readings
    )
    return replace(measurements, readings=readings)


def places(adjustment, truth):
    """(n, 3) adjusted minus true coordinates."""
    return adjustment.xyz_m - truth.xyz_m[[int(name[1:]) for name in adjustment.names]]


def told(measurements):
    """All that the adjustment has to say: its warnings, or its error."""
    try:
        return "\n".join(lines(adjust_survey(measurements).warnings))
    except SolutionError as error:
        return str(error)
