"""Repeated readings of image points: how they scatter, and which of them are rejected."""

from dataclasses import replace

import numpy as np

from tankcal.camera.comparator import repeats
from tankcal.errors import Problem
from tankcal.messages import message
from tankcal.survey.measurements import RejectedReadings
from tankcal.survey.results import RepeatedReadings

TOLD = 10  # points whose readings are rejected that are told one by one


def reject_scattered(measurements):
    """(Measurements without the rejected readings, RepeatedReadings or None, Problem rows).

    Readings of a point in a photo whose sample standard deviation in x or in y exceeds
    settings.reading_limit_mm are rejected, all of them: nobody knows which one is good (Silva).
    """
    images, limit = measurements.image_points, measurements.settings.reading_limit_mm
    if images is None:
        return measurements, None, []
    names = list(zip(images.photo, images.point, images.check.tolist(), strict=True))
    same = repeats(names, images.xy_mm)
    several, bad = np.flatnonzero(same.count > 1), same.beyond(limit)
    if not len(several):
        return measurements, None, []
    rejected = tuple(
        RejectedReadings(
            *names[same.first[i]][:2], int(same.count[i]), same.sd[i],
            images.rows[same.first[i]] if images.rows else None,
        )
        for i in np.flatnonzero(bad)
    )  # fmt: skip
    found = RepeatedReadings(
        photo=tuple(names[same.first[i]][0] for i in several),
        point=tuple(names[same.first[i]][1] for i in several),
        count=same.count[several],
        mean_mm=same.mean[several],
        sd_mm=same.sd[several],
        limit_mm=limit,
        rejected=rejected,
    )
    if rejected:
        measurements = replace(measurements, image_points=select_readings(images, ~bad[same.group]))
    return measurements, found, _told(rejected, limit, images.file)


def select_readings(images, keep):
    """job.ImageReadings of some rows (n,) True."""
    rows = np.flatnonzero(keep)

    def of(values):
        return tuple(values[i] for i in rows)

    shared = images.shared_sd_mm
    return replace(
        images,
        photo=of(images.photo),
        point=of(images.point),
        xy_mm=images.xy_mm[rows],
        sd_mm=images.sd_mm[rows],
        check=images.check[rows],
        rows=of(images.rows) if images.rows else (),
        shared_sd_mm=None if shared is None else shared[rows],
    )


def _told(rejected, limit, file):
    """Problem rows of rejected readings; of many, the first ones and how many more."""
    found = [
        Problem(
            file,
            message(
                "readings_rejected",
                "the {count} readings of point {point} in photo {photo} are rejected: their"
                " standard deviation of {sd_um:.1f} um exceeds reading_limit_um = {limit_um:g}",
                count=one.count,
                point=one.name,
                photo=one.photo,
                sd_um=1e3 * np.nanmax(one.sd_mm),
                limit_um=1e3 * limit,
            ),
            one.row,
        )
        for one in rejected
    ]
    if len(found) <= TOLD:
        return found
    more = len(found) - TOLD + 1
    text = message(
        "more_rejected",
        "the readings of {more} more points exceed reading_limit_um and are rejected",
        more=more,
    )
    return [*found[: TOLD - 1], Problem(file, text)]
