"""Warnings of the strapping of a sphere: what its circles cannot tell, and what they contradict."""

from dataclasses import replace

import numpy as np

from tankcal.adjust import CRITICAL
from tankcal.errors import Problem
from tankcal.messages import message
from tankcal.pipeline import tape_checks
from tankcal.pipeline.nominal_size import allowed_departure_m
from tankcal.pipeline.strapping_checks import FAR_LIMITS, check_repeats, limit_of_repeats
from tankcal.pipeline.survey_limits import limits_of

FILE = "great_circles.csv"


def check_circles(job, sphere):
    """`Problem`s of a `StrappedSphere`."""
    of_straps = (*tape_checks.check_tapes(job, sphere), *check_repeats(sphere))
    return (
        *(_of_this_file(one) for one in of_straps),
        *_of_equator(sphere),
        *_of_meridians(sphere),
        *_of_nominal(job, sphere),
        *_contradicted(sphere),
    )


def _of_this_file(problem):
    """A problem of readings of a tape, which stand in another file here."""
    return replace(problem, file=FILE) if problem.file == tape_checks.FILE else problem


def _of_equator(sphere):
    """The equator alone, or meridians without it."""
    azimuth = sphere.azimuth_rad[sphere.adjusted]
    equator = np.isnan(azimuth)
    size = 1000 * sphere.prior.oblateness_m
    if equator.all():
        text = message(
            "equator_alone",
            "only the equator was strapped: a sphere on legs is flattened by its own weight, so"
            " that its volume is overstated; that it may be flat by {size_mm:.3g} mm (k = 1) is"
            " assumed",
            size_mm=size,
        )
        yield Problem(FILE, text, column="kind")
    elif not equator.any():
        text = message(
            "no_equator",
            "no equator was strapped: a meridian alone tells no axis, so that how flat the sphere"
            " is, {size_mm:.3g} mm (k = 1), is assumed",
            size_mm=size,
        )
        yield Problem(FILE, text, column="kind")


def _of_meridians(sphere):
    """Too few of them, or on one side of the sphere."""
    azimuth = sphere.azimuth_rad[sphere.adjusted]
    planes = np.unique(np.round(azimuth[~np.isnan(azimuth)] % np.pi, 6))
    limits = limits_of("great_circles")
    if len(planes) == 0:
        return
    if len(planes) < limits["least_meridians"]:
        text = message(
            "few_meridians",
            "{count} meridians; {least} or more were expected",
            count=len(planes),
            least=limits["least_meridians"],
        )
        yield Problem(FILE, text, column="kind")
    uneven = abs(np.mean(np.exp(2j * planes)))
    if uneven > limits["most_uneven"]:
        text = message(
            "meridians_uneven",
            "the meridians are not evenly spread: where the sphere is oval they tell its height"
            " badly; that it may be oval by {size_mm:.3g} mm (k = 1) is assumed",
            size_mm=1000 * sphere.prior.ovality_m,
        )
        yield Problem(FILE, text, column="azimuth_deg")


def _of_nominal(job, sphere):
    """The inside radius against the drawing's: plates that were taken off twice, or not at all."""
    nominal = job.tank.nominal_diameter_m
    if nominal is None:
        return
    plate = job.sphere.thickness_m
    miss = sphere.solid(plate).diameter_m / 2 - nominal / 2
    by_plates = plate > 0 and 0.5 < -miss / plate < 1.5 and -miss > nominal / 2 * 5e-4
    if by_plates:
        text = message(
            "circles_of_inside",
            "the sphere comes out {miss_mm:+.0f} mm of radius from the nominal one, about its"
            " plates: is the nominal diameter that of the outside, or are the circles those of"
            " the inside?",
            miss_mm=1000 * miss,
        )
        yield Problem(FILE, text, column="reading_m")
    elif abs(miss) > allowed_departure_m(job):
        text = message(
            "sphere_unlike_nominal",
            "the sphere comes out {miss_mm:+.0f} mm of radius from the nominal one",
            miss_mm=1000 * miss,
        )
        yield Problem(FILE, text, column="reading_m")


def _contradicted(sphere):
    """Readings that count, and readings that are only compared, far from what the others show."""
    missed = np.array([one.circumference_m for one in sphere.reduced]) - sphere.length_m
    for place, w in zip(sphere.adjusted, sphere.w, strict=True):
        if abs(w) > CRITICAL:
            strap = sphere.reduced[place].strap
            template = (
                "circle {name!r} is {miss_mm:+.1f} mm from what all others show (w = {w:.1f}): is"
                " it misread, off its great circle or over an obstruction?"
            )
            name, miss, size = strap.name, 1000 * missed[place], abs(w)
            if abs(missed[place]) > FAR_LIMITS * limit_of_repeats(
                sphere.reduced[place].circumference_m
            ):
                text = message("circle_contradicts_far", template, name=name, miss_mm=miss, w=size)
            else:
                text = message("circle_contradicts", template, name=name, miss_mm=miss, w=size)
            yield Problem(FILE, text, strap.row, "reading_m")
    for place in np.setdiff1d(np.arange(len(missed)), sphere.adjusted):
        apart = abs(missed[place]) / sphere.sd_of_check_m(place)
        if apart > CRITICAL:
            strap = sphere.reduced[place].strap
            text = message(
                "checked_circle_apart",
                "circle {name!r}, which is only compared, is {miss_mm:+.1f} mm from the ellipsoid"
                " of the others, {apart:.1f} standard deviations",
                name=strap.name,
                miss_mm=1000 * missed[place],
                apart=apart,
            )
            yield Problem(FILE, text, strap.row, "reading_m")
