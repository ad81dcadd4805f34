"""Repeated readings of image points: their scatter, and the rejection of scattered readings."""

from dataclasses import replace

import numpy as np

from tankcal.camera.comparator import group_readings
from tankcal.errors import Problem
from tankcal.messages import message
from tankcal.survey.measurements import RejectedReadings
from tankcal.survey.results import RepeatedReadings

TOLD = 10  # warnings listed singly; further rejected points are only counted


def reject_scattered(measurements):
    """Reject repeated readings of image points that scatter beyond the limit.

    If the sample standard deviation in x or y exceeds settings.reading_limit_mm, all readings of
    the point in that photo are rejected. The scatter does not show which reading is wrong (Silva).

    Parameters
    ----------
    measurements : Measurements

    Returns
    -------
    measurements : Measurements
        Without the rejected readings.
    repeated : RepeatedReadings or None
        None: no point was read repeatedly.
    warnings : list of Problem
    """
    images, limit = measurements.image_points, measurements.settings.reading_limit_mm
    if images is None:
        return measurements, None, []
    names = list(zip(images.photo, images.point, images.check.tolist(), strict=True))
    groups = group_readings(names, images.xy_mm)
    several, bad = np.flatnonzero(groups.count > 1), groups.exceeds(limit)
    if not len(several):
        return measurements, None, []
    # The first reading represents its group in messages.
    rejected = tuple(
        RejectedReadings(
            *names[groups.first[i]][:2], int(groups.count[i]), groups.sd[i],
            images.rows[groups.first[i]] if images.rows else None,
        )
        for i in np.flatnonzero(bad)
    )  # fmt: skip
    repeated = RepeatedReadings(
        photo=tuple(names[groups.first[i]][0] for i in several),
        point=tuple(names[groups.first[i]][1] for i in several),
        count=groups.count[several],
        mean_mm=groups.mean[several],
        sd_mm=groups.sd[several],
        limit_mm=limit,
        rejected=rejected,
    )
    if rejected:
        measurements = replace(
            measurements, image_points=select_readings(images, ~bad[groups.group])
        )
    return measurements, repeated, _rejection_warnings(rejected, limit, images.file)


def select_readings(images, keep):
    """ImageReadings of the rows where a mask (n,) is True."""
    rows = np.flatnonzero(keep)

    def select(values):
        return tuple(values[i] for i in rows)

    shared = images.shared_sd_mm
    return replace(
        images,
        photo=select(images.photo),
        point=select(images.point),
        xy_mm=images.xy_mm[rows],
        sd_mm=images.sd_mm[rows],
        check=images.check[rows],
        rows=select(images.rows) if images.rows else (),
        shared_sd_mm=None if shared is None else shared[rows],
    )


def _rejection_warnings(rejected, limit, file):
    """Problem rows of rejected readings: the first ones, and the number of the others."""
    problems = [
        Problem(
            file,
            message(
                "readings_rejected",
                "the {count} readings of point {point} in photo {photo} are rejected: their"
                " standard deviation of {sd_um:.1f} um exceeds reading_limit_um = {limit_um:g}",
                count=rejected_point.count,
                point=rejected_point.name,
                photo=rejected_point.photo,
                sd_um=1e3 * np.nanmax(rejected_point.sd_mm),
                limit_um=1e3 * limit,
            ),
            rejected_point.row,
        )
        for rejected_point in rejected
    ]
    if len(problems) <= TOLD:
        return problems
    more = len(problems) - TOLD + 1
    text = message(
        "more_rejected",
        "the readings of {more} more points exceed reading_limit_um and are rejected",
        more=more,
    )
    return [*problems[: TOLD - 1], Problem(file, text)]
