"""Warnings of the strapping of a sphere: undetermined quantities, and outliers."""

from dataclasses import replace

import numpy as np

from tankcal.adjust import CRITICAL
from tankcal.errors import Problem
from tankcal.messages import message
from tankcal.methods.strapping import tape_warnings
from tankcal.methods.strapping.warnings import FAR_LIMITS, check_repeats, limit_of_repeats
from tankcal.pipeline.checks.size import allowed_departure_m
from tankcal.pipeline.checks.survey import limits_of_method

FILE = "great_circles.csv"


def check_circles(job, sphere):
    """Return the warnings of a `StrappedSphere`."""
    strapping = job.surveys["great_circles"].strapping
    of_straps = (*tape_warnings.check_tapes(job, sphere, strapping), *check_repeats(sphere))
    return (
        *(
            (replace(problem, file=FILE) if problem.file == tape_warnings.FILE else problem)
            for problem in of_straps
        ),
        *_check_equator(sphere),
        *_check_meridians(sphere),
        *_check_nominal_radius(job, sphere),
        *_check_outliers(sphere),
    )


def _check_equator(sphere):
    """Warn of an equator without meridians, or of meridians without an equator."""
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


def _check_meridians(sphere):
    """Warn of too few meridians, or of meridians on one side of the sphere."""
    azimuth = sphere.azimuth_rad[sphere.adjusted]
    # A meridian is a plane through the axis: azimuths that differ by pi are the same plane.
    planes = np.unique(np.round(azimuth[~np.isnan(azimuth)] % np.pi, 6))
    limits = limits_of_method("tankcal.methods.great_circles")
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
    # Doubled azimuths treat a plane as an axis; the mean resultant length is 0 for even planes.
    uneven = abs(np.mean(np.exp(2j * planes)))
    if uneven > limits["most_uneven"]:
        text = message(
            "meridians_uneven",
            "the meridians are not evenly spread: where the sphere is oval they tell its height"
            " badly; that it may be oval by {size_mm:.3g} mm (k = 1) is assumed",
            size_mm=1000 * sphere.prior.ovality_m,
        )
        yield Problem(FILE, text, column="azimuth_deg")


def _check_nominal_radius(job, sphere):
    """Warn of an inside radius that differs from the nominal one, e.g. by plates deducted twice."""
    nominal = job.tank.nominal_diameter_m
    if nominal is None:
        return
    plate = job.sphere.thickness_m
    deviation_m = sphere.solid(plate).diameter_m / 2 - nominal / 2
    by_plates = plate > 0 and 0.5 < -deviation_m / plate < 1.5 and -deviation_m > nominal / 2 * 5e-4
    if by_plates:
        text = message(
            "circles_of_inside",
            "the sphere comes out {miss_mm:+.0f} mm of radius from the nominal one, about its"
            " plates: is the nominal diameter that of the outside, or are the circles those of"
            " the inside?",
            miss_mm=1000 * deviation_m,
        )
        yield Problem(FILE, text, column="reading_m")
    elif abs(deviation_m) > allowed_departure_m(job):
        text = message(
            "sphere_unlike_nominal",
            "the sphere comes out {miss_mm:+.0f} mm of radius from the nominal one",
            miss_mm=1000 * deviation_m,
        )
        yield Problem(FILE, text, column="reading_m")


def _check_outliers(sphere):
    """Warn of readings that differ from the ellipsoid of all others, used or only compared."""
    deviations_m = (
        np.array([reduction.circumference_m for reduction in sphere.reduced]) - sphere.length_m
    )
    for number, w in zip(sphere.adjusted, sphere.w, strict=True):
        if abs(w) > CRITICAL:
            strap = sphere.reduced[number].strap
            template = (
                "circle {name!r} is {miss_mm:+.1f} mm from what all others show (w = {w:.1f}): is"
                " it misread, off its great circle or over an obstruction?"
            )
            name, deviation_mm, size = strap.name, 1000 * deviations_m[number], abs(w)
            if abs(deviations_m[number]) > FAR_LIMITS * limit_of_repeats(
                sphere.reduced[number].circumference_m
            ):
                text = message(
                    "circle_contradicts_far", template, name=name, miss_mm=deviation_mm, w=size
                )
            else:
                text = message(
                    "circle_contradicts", template, name=name, miss_mm=deviation_mm, w=size
                )
            yield Problem(FILE, text, strap.row, "reading_m")
    for number in np.setdiff1d(np.arange(len(deviations_m)), sphere.adjusted):
        ratio = abs(deviations_m[number]) / sphere.sd_of_check_m(number)
        if ratio > CRITICAL:
            strap = sphere.reduced[number].strap
            text = message(
                "checked_circle_apart",
                "circle {name!r}, which is only compared, is {miss_mm:+.1f} mm from the ellipsoid"
                " of the others, {apart:.1f} standard deviations",
                name=strap.name,
                miss_mm=1000 * deviations_m[number],
                apart=ratio,
            )
            yield Problem(FILE, text, strap.row, "reading_m")
