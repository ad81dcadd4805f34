"""A survey that does not fit, tried again as if a whole file had been misread.

Each supposition changes the measurements as one common mistake would, and the survey is adjusted
again, without data snooping. The one that brings sigma0 down most is told; nothing is changed.
"""

from dataclasses import replace

import numpy as np

from tankcal.camera import corrected
from tankcal.errors import InputError, Problem, SolutionError
from tankcal.surveys.diagnoses import MIRROR, mirrored_fits
from tankcal.surveys.readings import ANGLES

BETTER = 0.2  # share of sigma0 that may be left by what explains a survey
SOUND = 5.0  # sigma0 of a survey that fits, where there is no sigma0 to compare with
CERTAIN = 2.0  # sigma0 after which nothing else is tried
ALIKE = 1.5  # times the smallest sigma0, within which suppositions explain as much
MIRRORS = ("control.csv", "image_points.csv")  # mistakes that cannot always be told apart
MOST = 12  # photos that are left out one after the other


def likely_mistake(measurements, sigma0, run):
    """Problem rows: the common mistakes that explain best why a survey does not fit, or none.

    sigma0  without data snooping, inf when the survey could not be adjusted
    run     run(measurements) -> (network.Adjusted, Gathered), without data snooping
    """
    limit = min(BETTER * sigma0, SOUND if np.isinf(sigma0) else np.inf)
    explained = []
    for problem, changed in _suppositions(measurements):
        if problem.file not in MIRRORS and any(found < CERTAIN for found, _ in explained):
            break
        try:
            found = run(changed)[0].sigma0
        except (SolutionError, InputError):
            continue
        if found < limit:
            explained.append((found, problem))
    best = min((found for found, _ in explained), default=np.inf)
    return [problem for found, problem in explained if found < ALIKE * best]


def _suppositions(measurements):
    """Pairs (Problem, measurements as they would be without that mistake)."""
    control, images = measurements.control, measurements.image_points
    if control is not None:
        swapped = replace(
            control, xyz_m=control.xyz_m[:, [1, 0, 2]], sd_m=control.sd_m[:, [1, 0, 2]]
        )
        text = "all coordinates fit once x and y are swapped"
        yield Problem("control.csv", text), replace(measurements, control=swapped)
    if images is not None:
        turned = replace(images, xy_mm=images.xy_mm * [-1.0, 1.0])
        yield Problem("image_points.csv", MIRROR), replace(measurements, image_points=turned)
    tables = measurements.readings
    angles = [one.table for one in tables if one.table in ANGLES]
    for factor, what in ((0.9, "gon read as degrees"), (1 / 0.9, "degrees read as gon")):
        if len(angles) > 1:
            yield (
                Problem("job.toml", f"all angles together fit once they are taken for {what}"),
                _times(measurements, angles, factor),
            )
        for table in angles:
            text = f"the angles fit once they are taken for {what}"
            yield Problem(f"{table}.csv", text), _times(measurements, [table], factor)
    for table in ("distances", "slope_distances"):
        if any(one.table == table for one in tables):
            for factor, what in ((0.3048, "feet"), (0.001, "millimetres")):
                text = f"the distances fit once they are taken for {what}"
                yield Problem(f"{table}.csv", text), _times(measurements, [table], factor)


def _times(measurements, tables, factor):
    readings = tuple(
        replace(one, value=one.value * factor) if one.table in tables else one
        for one in measurements.readings
    )
    return replace(measurements, readings=readings)


def photos_that_do_not_fit(measurements, message, run):
    """Problem rows for photos that found no place and that fit when they are mirrored.

    message  of the error, which names these photos        run  see `likely_mistake`
    """
    images = measurements.image_points
    lost = [one.name for one in measurements.photos if f"photo {one.name} " in message][:MOST]
    if images is None or not lost or len(lost) == len(measurements.photos):
        return []
    kept = np.array([name not in lost for name in images.photo])
    try:
        adjusted, _ = run(replace(measurements, image_points=_some(images, kept)))
    except (SolutionError, InputError):
        return []
    return [
        Problem("image_points.csv", f"photo {name}: {MIRROR}")
        for name in lost
        if _is_mirrored(measurements, name, adjusted)
    ]


def _is_mirrored(measurements, name, adjusted):
    """Whether a photo that was left out fits the adjusted points when it is mirrored."""
    images = measurements.image_points
    number = {name: i for i, name in enumerate(adjusted.survey.points)}
    rows = [
        i
        for i, (photo, point) in enumerate(zip(images.photo, images.point, strict=True))
        if photo == name and point in number
    ]
    of = next(one.camera for one in measurements.photos if one.name == name)
    camera = next(one.camera for one in measurements.cameras if one.camera.name == of)
    xyz = adjusted.xyz_m[[number[images.point[i]] for i in rows]]
    there = np.isfinite(xyz).all(axis=1)
    ideal = corrected(images.xy_mm[rows], camera.values, camera.form) / camera.values[0]
    return mirrored_fits(xyz[there], ideal[there])


def _some(images, kept):
    rows = np.flatnonzero(kept)
    return replace(
        images,
        photo=tuple(images.photo[i] for i in rows),
        point=tuple(images.point[i] for i in rows),
        xy_mm=images.xy_mm[rows],
        sd_mm=images.sd_mm[rows],
        check=np.asarray(images.check)[rows],
        rows=tuple(images.rows[i] for i in rows) if images.rows else (),
    )
