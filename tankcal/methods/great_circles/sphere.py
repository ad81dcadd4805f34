"""A sphere strapped along great circles: its solid, and warnings about it.

Sphere measured by strapping: an upright ellipsoid with the form that a tape does not show.

A circumference is 2 pi times the mean radius of its great circle. The degree-2 form is the
ellipsoid fitted to all circles (`geometry.great_ellipses`). The remaining form of a sphere (plates,
seams, legs) is a random field of assumed size. It changes the mean of each circle slightly, and the
volumes below a dip more. This field is not estimated; it contributes to the uncertainty only.
"""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from tankcal.adjust import CRITICAL
from tankcal.errors import Problem
from tankcal.geometry.field.places import OnGreatCircles, cap_volumes
from tankcal.geometry.great_ellipses import (
    FittedEllipsoid,
    FormPrior,
    fit_ellipsoid,
    great_circle_lengths,
)
from tankcal.messages import message
from tankcal.methods.great_circles.columns import KINDS
from tankcal.methods.strapping import warnings
from tankcal.methods.strapping.warnings import FAR_LIMITS, check_repeats, limit_of_repeats
from tankcal.pipeline.checks import limits_of_method
from tankcal.pipeline.checks.size import allowed_departure_m, single_radius
from tankcal.pipeline.read_wall import (
    WallReading,
    factors_of_readings,
    inputs_read_with,
    noise_of,
    readings_of_straps,
)
from tankcal.pipeline.wall_straps import AreaTerm
from tankcal.survey.strapping import ReducedStrap, reduce_straps, tapes_used
from tankcal.tank.budgets import Factor
from tankcal.tank.solids import Ellipsoid, SurveyedForm, node_levels
from tankcal.uncertainty import factor_of
from tankcal.units import FULL_TURN

OVALITY_SHARE = 1e-3  # prior degree-2 form over the radius, if neither measured nor declared
NO_AREA_TERM = AreaTerm(0.0, 0.0)  # included in the field: a reading is a mean of radii
ROUNDING = 1e-7  # size of a column, relative to the capacity, that counts as zero


@dataclass(frozen=True)
class StrappedSphere:
    """Sphere determined by great circles, on the painted outside at the temperature of the survey.

    Attributes
    ----------
    reduced : tuple of ReducedStrap
        All readings, in the order of the file.
    adjusted : ndarray of int, shape (k,)
        Indices of the adjusted readings; the other readings are checks.
    azimuth_rad : ndarray, shape (n,)
        Azimuth of each reading; nan for the equator.
    readings : tuple of WallReading
        Adjusted readings, as mean radii.
    places : OnGreatCircles
        Positions of the adjusted readings.
    variances_m2 : ndarray, shape (departures,)
        Assumed variances of the form beyond degree 2, m2.
    prior : FormPrior
    fit : FittedEllipsoid
    tapes : tuple of (Tape, float)
        Tapes used, and the standard uncertainties of their scale from a master.
    """

    reduced: tuple[ReducedStrap, ...]
    adjusted: np.ndarray
    azimuth_rad: np.ndarray
    readings: tuple[WallReading, ...]
    places: OnGreatCircles
    variances_m2: np.ndarray
    prior: FormPrior
    fit: FittedEllipsoid
    tapes: tuple
    surveyed_as = "great_circles"

    def solid(self, plate_m=0.0, scale=1.0):
        """`Ellipsoid` inside the plates, with lengths multiplied by `scale`."""
        return Ellipsoid(*(scale * (axis - plate_m) for axis in self.fit.axes_m))

    @cached_property
    def length_m(self):
        """Circumferences (n,) of the ellipsoid at the readings, m."""
        return great_circle_lengths(self.fit.unknowns, self.azimuth_rad)[0]

    @cached_property
    def w(self):
        """Normalised discrepancies (k,) of the adjusted lengths from the other readings.

        The value is nan if no other circle controls the reading.
        """
        diagonal = np.diag(self.fit.precision)
        covariance_diagonal = np.diag(np.linalg.inv(self._lengths_m2))
        # Leave-one-out test: w = P v / sqrt(P_ii), undefined where P_ii vanishes.
        pull = -self.fit.precision @ self.fit.residuals_m
        is_determined = diagonal > 1e-6 * covariance_diagonal
        return np.where(
            is_determined, pull / np.sqrt(np.where(is_determined, diagonal, 1.0)), np.nan
        )

    def sd_of_check_m(self, place):
        """Standard deviation of the difference between a check reading and the ellipsoid, m."""
        azimuth = self.azimuth_rad[place : place + 1]
        _, derivative = great_circle_lengths(self.fit.unknowns, azimuth)
        place_of_check = OnGreatCircles(self.places.radius_m, _normals(azimuth))
        form = FULL_TURN**2 * _departure_covariances(place_of_check, self.variances_m2).sum(axis=0)
        reading = self.reduced[place]
        shared = sum(effect.by_m**2 for effect in reading.effects)
        of_fit = derivative @ self.fit.weights
        prior = derivative @ self.fit.by_prior
        # The form at the check, the fitted ellipsoid and its prior are independent contributions.
        variance = form + of_fit @ self._lengths_m2 @ of_fit.T + prior @ prior.T
        return float(np.sqrt(variance[0, 0] + reading.sd_m**2 + shared))

    @property
    def _lengths_m2(self):
        return FULL_TURN**2 * (noise_of(self.readings) + self._departure_covariances.sum(axis=0))

    @cached_property
    def _departure_covariances(self):
        return _departure_covariances(self.places, self.variances_m2)

    def arguments_of_part(self, plate_m, scale):
        """Arguments of `SolidPart` for the ellipsoid inside the plates; volumes are scaled."""
        form, read_with = self._part_of_volumes(plate_m)
        factors = tuple(
            replace(factor, columns=scale**3 * factor.columns) for factor in form.factors
        )
        return {
            "surveyed": ("diameter",),
            "form": replace(form, factors=factors),
            "read_with": {name: scale**3 * column for name, column in read_with.items()},
        }

    def _part_of_volumes(self, plate_m):
        """`SurveyedForm` of the ellipsoid inside the plates, and derivatives of its volumes.

        The derivatives are {input: (nodes,)} by the inputs on which the readings depend.
        """
        solid = self.solid(plate_m)
        levels = node_levels(solid.top_m)
        by_lengths = self._by_unknowns(solid, levels) @ self.fit.weights
        weights = FULL_TURN * by_lengths  # by mean radii
        factors = (
            *factors_of_readings(self.readings, weights),
            *self._factors_of_form(solid, levels, weights),
            *self._factors_of_prior(solid, levels),
        )
        none = np.zeros(len(levels))
        form = SurveyedForm.of_volumes(
            solid.volume_m3(levels), solid.area_m2(levels), solid.top_m, none, 0.0, factors
        )
        return form, inputs_read_with(self.readings, weights)

    def _by_unknowns(self, solid, levels):
        """Derivatives (nodes, 4) of the volumes by m, A, B, c."""
        mean, cos, sin = self.fit.unknowns[:3]
        mean = mean - (self.fit.axes_m[0] - solid.a_m)  # inside
        by_product = solid.volume_m3(levels) / (solid.a_m * solid.b_m)
        of_c = solid.by_axes(levels)[:, 2]
        return np.column_stack(
            [*(by_product * 2 * coefficient for coefficient in (mean, -cos, -sin)), of_c]
        )

    def _factors_of_form(self, solid, levels, weights):
        """`Factor` of each kind of deviation beyond degree 2."""
        volumes = cap_volumes(levels, solid.area_m2(levels), solid.top_m / 2)
        for kind in dict.fromkeys(departure.kind for departure in self.places.departures):
            covariance = 0.0
            for size, part, departure in zip(
                self.variances_m2, self._departure_covariances, self.places.departures, strict=True
            ):
                if departure.kind == kind:
                    cross_covariance = size * self.places.across(departure, volumes) @ weights.T
                    variance = size * self.places.within(departure, volumes)
                    covariance = (
                        covariance
                        + variance
                        - cross_covariance
                        - cross_covariance.T
                        + weights @ part @ weights.T
                    )
            if np.any(covariance):
                yield Factor(kind, factor_of(covariance), note="assumed")

    def _factors_of_prior(self, solid, levels):
        """`Factor` of the part of degree 2 that the straps do not determine."""
        columns = self._by_unknowns(solid, levels) @ self.fit.by_prior
        is_negligible = np.abs(columns).max(axis=0) < ROUNDING * solid.capacity_m3
        if not np.all(is_negligible):
            yield Factor("oblateness", columns[:, ~is_negligible], note="assumed")


def find_strapped_sphere(job, progress):
    """`StrappedSphere` of a job with great circles."""
    circles = job.surveys["great_circles"]
    progress(
        message(
            "strapping_sphere",
            "fitting an ellipsoid to {count} readings of great circles",
            count=len(circles.strapping.straps),
        )
    )
    radius = float(np.median([strap.reading_m for strap in circles.strapping.straps])) / FULL_TURN
    reduced = reduce_straps(circles.strapping, job.survey.shell_temperature_c, 2 * radius)
    azimuth = circles.azimuths([reduced_strap.strap for reduced_strap in reduced])
    adjusted = np.array(
        [i for i, reduced_strap in enumerate(reduced) if not reduced_strap.strap.check]
    )
    readings = tuple(readings_of_straps([reduced[i] for i in adjusted], KINDS, NO_AREA_TERM))
    places = OnGreatCircles(radius, _normals(azimuth[adjusted]))
    variances = _assumed_variances(places.departures, job.sphere.form_m)
    size = job.sphere.ovality_m or OVALITY_SHARE * radius
    prior = FormPrior(size, size)
    lengths = FULL_TURN * np.array([reading.radius_m for reading in readings])
    covariance = FULL_TURN**2 * (
        noise_of(readings) + _departure_covariances(places, variances).sum(axis=0)
    )
    fit = fit_ellipsoid(azimuth[adjusted], lengths, covariance, prior)
    return StrappedSphere(
        reduced=reduced,
        adjusted=adjusted,
        azimuth_rad=azimuth,
        readings=readings,
        places=places,
        variances_m2=variances,
        prior=prior,
        fit=fit,
        tapes=tapes_used(circles.strapping),
    )


def inside_radii(job, sphere):
    """`InsideRadii` of a `StrappedSphere`: half its mean diameter inside the plates."""
    plate = job.sphere.thickness_m
    return single_radius(sphere.solid(plate).diameter_m / 2, plate)


def _normals(azimuth):
    """Unit normals (n, 3) of the planes: vertical for the equator, horizontal for meridians."""
    equator = np.isnan(azimuth)
    angle = np.where(equator, 0.0, azimuth)
    level = np.column_stack([np.cos(angle), -np.sin(angle), np.zeros(len(angle))])
    return np.where(equator[:, None], [0.0, 0.0, 1.0], level)


def _assumed_variances(departures, form_m):
    """Assumed variances (departures,), from medians or scaled to a declared size, m2."""
    sizes = np.array([departure.median_m for departure in departures]) ** 2
    if form_m is not None:
        return sizes * form_m**2 / sizes.sum()
    return sizes


def _departure_covariances(places, variances):
    """(departures, k, k) their covariances of the mean radii."""
    pairs = zip(variances, places.departures, strict=True)
    return np.array([size * places.covariance(departure) for size, departure in pairs])


FILE = "great_circles.csv"


def check_circles(job, sphere):
    """Return the warnings of a `StrappedSphere`."""
    strapping = job.surveys["great_circles"].strapping
    of_straps = (*warnings.check_tapes(job, sphere, strapping), *check_repeats(sphere))
    return (
        *(
            (replace(problem, file=FILE) if problem.file == warnings.TAPE_CHECKS_FILE else problem)
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
