"""Wall with readings that name no point, and the test of each reading against the wall.

Readings of a wall without a point: each is a radius of the wall, with effects it shares.

A strap is the mean radius of a whole turn. An offset is the radius at the azimuth of its line,
apart from a constant of the line. A shared effect is a column of derivatives: by a cause of known
standard uncertainty, or by an unknown without a prior.
"""

from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from tankcal.adjust import noncentrality
from tankcal.geometry.field.blunders import (
    MOST_ROUNDS,
    ReadingTests,
    restricted_precision,
    snoop_wall,
)
from tankcal.geometry.field.estimate import WallField
from tankcal.geometry.field.sites import Sites, free_design, spans_of
from tankcal.methods.base import completing_method
from tankcal.survey.reference_line import level_names
from tankcal.tank.budgets import Factor

FORMER, FORMER_SD_M = "former_radius", 0.01  # courses not measured again: kind, and sd
UNCONTROLLED = 1e-6  # least share of a reading's variance that other readings control


# ---- readings of a wall without a point: each is a radius of the wall, with effects it shares


@dataclass(frozen=True)
class WallReading:
    """A radius of the wall from one reading.

    Attributes
    ----------
    of : str
        "straps" or "offsets": name in a budget.
    course : int
        Index of the course.
    level_m : float
        Height above the table's zero, m.
    radius_m, sd_m : float
        Radius of the painted outside, and its standard deviation without shared effects, m.
    azimuth_rad : float
        Azimuth; nan for the mean of a whole turn.
    ring : int
        Ring of readings with a common centre; negative without a centre.
    effects : dict
        {(kind, name): (u, unit, change of the radius for one u, m)}.
    free : dict
        {name: derivative by an unknown without a prior}.
    by_inputs : dict
        {input of an uncertainty budget: derivative by the input}.
    """

    of: str
    course: int
    level_m: float
    radius_m: float
    sd_m: float
    azimuth_rad: float = np.nan
    ring: int = -1
    effects: dict = field(default_factory=dict)
    free: dict = field(default_factory=dict)
    by_inputs: dict = field(default_factory=dict)


def readings_of_straps(used, courses, term):
    """`WallReading` of each reduced circumference, as the circle of equal area.

        r = C / (2 pi sqrt(1 + excess))

    Parameters
    ----------
    used : sequence of ReducedStrap
        Reduced circumferences.
    courses : list of str
        Names of the courses.
    term : AreaTerm

    Returns
    -------
    list of WallReading
    """
    readings = []
    for reading in used:
        per_m = 1 / (2 * np.pi * np.sqrt(1 + term.mean))
        radius = per_m * reading.circumference_m
        effects = {
            (effect.kind, effect.name): (effect.u, effect.unit, effect.by_m * per_m)
            for effect in reading.effects
        }
        if term.sd:
            # Derivative of C / (2 pi sqrt(1 + e)) by the excess e, times its standard deviation.
            by_m = -radius / (2 * (1 + term.mean)) * term.sd
            effects["area_term", ""] = (1e6 * term.sd, "ppm", by_m)
        derivatives = {"shell_temperature": reading.by_shell_temperature_m * per_m}
        readings.append(
            WallReading(
                "straps",
                courses.index(reading.strap.course),
                reading.strap.level_m,
                radius,
                reading.sd_m * per_m,
                effects=effects,
                by_inputs={name: value for name, value in derivatives.items() if value},
            )
        )
    return readings


def readings_of_offsets(lines, used, courses, insets_m):
    """`WallReading` of each offset from a reference line.

    The reference level has no centre of its own, because the constants of the lines absorb it.

    Parameters
    ----------
    lines : ReferenceLines
    used : list of Offset
        Adjusted offsets.
    courses : list of str
        Names of the courses.
    insets_m : sequence of float, length courses
        Plate and paint, m. An inside line shows the radius without them.

    Returns
    -------
    list of WallReading
    """
    readings, levels = [], level_names(used)
    reference = {int(level) for level, offset in zip(levels, used, strict=True) if offset.reference}
    for level, offset in zip(levels, used, strict=True):
        line, plummet = lines.of(offset)
        course, radial = courses.index(offset.course), lines.radial_m(offset)
        effects, free = {}, {("line", offset.line): 1.0}
        by_angle = lines.by_collimation_m(offset)
        if plummet.u_scale:
            by_m = radial * plummet.u_scale
            effects["instrument_scale", plummet.name] = (1e6 * plummet.u_scale, "ppm", by_m)
        if plummet.u_collimation_rad is None:
            free["collimation", plummet.name] = by_angle
        elif plummet.u_collimation_rad:
            u = plummet.u_collimation_rad
            effects["collimation", plummet.name] = (np.degrees(u) * 3600, "arcsec", by_angle * u)
        readings.append(
            WallReading(
                "offsets",
                course,
                offset.level_m,
                radial + line.inside * insets_m[course],
                offset.sd_m,
                line.azimuth_rad,
                -1 if int(level) in reference else int(level),
                effects,
                free,
                {"plate_thickness": 1.0, "paint": 1.0} if line.inside else {},
            )
        )
    return readings


def readings_of_untold(job, measured, joints_m, zero_m):
    """`WallReading`s of former radii for courses that a new survey does not measure.

    Their large standard deviation merely completes the wall. Each has a free radius, so that it
    does not affect the measured courses.

    Parameters
    ----------
    job : Job
    measured : set of int
        Indices of the measured courses.
    joints_m : ndarray, shape (courses + 1,)
        Heights of the joints, m.
    zero_m : float
        Height of the table's zero above the bottom, m.

    Returns
    -------
    list of WallReading
    """
    method = completing_method(job)
    if method is None:
        return []
    former_m = method.former_radii_m(job)
    return [
        WallReading(
            FORMER, i, (joints_m[i] + joints_m[i + 1]) / 2 - zero_m, float(former_m[i]), FORMER_SD_M
        )
        for i in range(len(job.courses))
        if i not in measured
    ]


def reduce_to_centre(readings, field):
    """Readings reduced to the centre of their level.

    A reading lacks (e x n)^2 / (2 rho) of the radius of a circle with eccentricity e.
    """
    centres, reduced = field.centres_m, []
    for reading in readings:
        if reading.ring < 0:
            reduced.append(reading)
            continue
        x, y = centres[reading.ring]
        across = x * np.cos(reading.azimuth_rad) - y * np.sin(reading.azimuth_rad)
        reduced.append(
            replace(reading, radius_m=reading.radius_m + across**2 / (2 * field.nominal_m))
        )
    return reduced


def sites_of(readings, joints_m, zero_m):
    """`Sites` of readings; `zero_m` is the height of the table's zero above the bottom, m."""
    course = np.array([reading.course for reading in readings], dtype=int)
    level = np.array([reading.level_m for reading in readings]) + zero_m
    low, high = joints_m[course], joints_m[course + 1]
    free = columns_of([reading.free for reading in readings])
    return Sites(
        course=course,
        ring=np.array([reading.ring for reading in readings], dtype=int),
        zeta=2 * (level - low) / (high - low) - 1,
        azimuth_rad=np.array([reading.azimuth_rad for reading in readings]),
        leans=np.zeros(len(readings), dtype=bool),
        shared=np.column_stack(list(free.values())) if free else None,
        spans=spans_of(joints_m),
    )


def names_of(courses):
    """Names of courses or of rings."""
    return [course.name for course in courses]


def noise_of(readings):
    """Covariance (n, n) of the radii from separate and shared causes, m2."""
    shared = shared_effects(readings).values()
    common = np.column_stack([np.zeros(len(readings)), *(column for *_, column in shared)])
    return np.diag([reading.sd_m**2 for reading in readings]) + common @ common.T


def noise_by_inputs(inputs, columns, count):
    """Covariance (n, n) of radii due to declared inputs, m2.

    It limits the weight of readings to what the uncertainty of plates and temperature permits.

    Parameters
    ----------
    inputs : sequence
        Inputs with name and u, in SI units.
    columns : dict
        {input: derivative (n,) of the radii}.
    count : int
        n.

    Returns
    -------
    ndarray, shape (n, n)
    """
    u_of_inputs = {declared_input.name: declared_input.u for declared_input in inputs}
    covariance = np.zeros((count, count))
    for name, column in columns.items():
        covariance += u_of_inputs.get(name, 0.0) ** 2 * np.outer(column, column)
    return covariance


def shared_effects(readings):
    """{(kind, name): (u, unit, change (n,) of the radii for one u, m)} of common causes."""
    columns = columns_of(
        [{key: effect[2] for key, effect in reading.effects.items()} for reading in readings]
    )
    u_and_unit = {
        key: effect[:2] for reading in readings for key, effect in reading.effects.items()
    }
    return {key: (*u_and_unit[key], column) for key, column in columns.items()}


def settle_readings(field, field_of, parts, may_go):
    """Field of a wall and tests of its readings, iterated until no reading changes acceptance.

    Each reading is tested by the other readings.

    Parameters
    ----------
    field : WallField
        Field of all readings.
    field_of : callable
        field_of(accepted) gives the WallField of the accepted readings.
    parts : tuple
        Sites, radii (n,), m, and noise (n, n), m2, of all readings.
    may_go : ndarray, shape (n,)
        Readings that may be rejected.

    Returns
    -------
    field : WallField
        Field of the accepted readings.
    tested : ReadingTests
        With an infinite sd_m for uncontrolled readings.
    """
    sites, radius, noise = parts
    accepted = np.ones(len(radius), dtype=bool)
    for _ in range(MOST_ROUNDS):
        covariance = replace(field, sites=sites, radius_m=radius, noise_m2=noise).covariance_m2
        # The weight matrix with free parameters eliminated is needed for leave-one-out tests.
        precision = restricted_precision(covariance, free_design(sites)[0])
        pull, most = (
            precision @ (radius - radius.mean()),
            np.sqrt(np.diag(covariance) / UNCONTROLLED),
        )
        tested = snoop_wall(precision, pull, accepted, may_go, most)
        if np.all(tested.accepted == accepted):
            break
        accepted = tested.accepted
        field = field_of(accepted)
    # A reading without redundancy has no test, so its standard deviation is set to infinity.
    controlled = tested.sd_m**-2.0 * np.diag(covariance) > UNCONTROLLED
    return field, replace(tested, sd_m=np.where(controlled, tested.sd_m, np.inf))


def factors_of_readings(readings, weights):
    """`Factor`s of the uncertainty of features due to separate and shared causes of readings.

    The weights (f, n) are the derivatives of the features by the radii.
    """
    factors = []
    for kind in dict.fromkeys(reading.of for reading in readings):
        separate = weights * np.array([reading.sd_m * (reading.of == kind) for reading in readings])
        factors.append(Factor(kind, separate))
    for (kind, name), (u, unit, column) in shared_effects(readings).items():
        column_of_features = (weights @ column)[:, None]
        factors.append(Factor(kind, column_of_features, u=u, unit=unit, note=name))
    return tuple(factor for factor in factors if np.any(factor.columns))


def factors_of_plates(names, field, weights, plate_sd_m):
    """`Factor`s of gauged plates, for weights (f, n) of readings that contain the plate.

    Parameters
    ----------
    names : list of str
        Names of the courses.
    field : WallField
    weights : ndarray, shape (f, n)
        Derivatives of the features by the radii, zero for readings without the plate.
    plate_sd_m : dict
        {course index: standard uncertainty, m}.

    Returns
    -------
    tuple of Factor
    """
    factors = []
    for course, sd in plate_sd_m.items():
        column = weights @ (sd * (field.sites.course == course))
        factors.append(Factor("plate_readings", column[:, None], note=names[course]))
    return tuple(factor for factor in factors if np.any(factor.columns))


def inputs_read_with(readings, weights):
    """{input of a budget: derivative (f,) of features}, for inputs that affect readings."""
    rows = columns_of([reading.by_inputs for reading in readings])
    return {name: weights @ column for name, column in rows.items()}


def columns_of(rows):
    """{name: values (n,)} of n dicts, with 0 for missing names."""
    columns = {}
    for place, row in enumerate(rows):
        for name, value in row.items():
            columns.setdefault(name, np.zeros(len(rows)))[place] = value
    return columns


# ---- wall with readings that name no point, and the test of each reading against the wall


@dataclass(frozen=True)
class ReadWall:
    """Wall with readings of tapes and reference lines, alone or in addition to points.

    Attributes
    ----------
    joints_m : ndarray, shape (courses + 1,)
        Heights of the joints above the bottom, m.
    zero_m : float
        Height of the table's zero above the bottom, m.
    readings : tuple of WallReading
        Adjusted readings: straps, then offsets. Check readings are not included.
    places : ndarray of int, shape (n,)
        Index of each reading among the readings of its file.
    tested : ReadingTests
        Test of each reading; sd_m is infinite for an uncontrolled reading.
    field : WallField
        Field estimated from the points, if any, and from the accepted readings.
    """

    joints_m: np.ndarray
    zero_m: float
    readings: tuple
    places: np.ndarray
    tested: ReadingTests
    field: WallField
    # Plate thickness, not in the field.
    inner_m: np.ndarray | float = field(default=0.0, kw_only=True)
    has_applied_inputs = False
    surveyed_as = "read"  # in addition to points; subclasses state their own kind

    def radius_at(self, course, level_m):
        """Mean radius of a course at a height above the table's zero, m."""
        low, high = self.joints_m[course], self.joints_m[course + 1]
        zeta = 2 * (level_m + self.zero_m - low) / (high - low) - 1
        inner = np.broadcast_to(self.inner_m, len(self.joints_m) - 1)[course]
        return float(self.field.outlines_at([zeta])[course, 0].mean() + inner)

    def tests_of(self, kind):
        """Tests of the readings of a kind.

        Returns
        -------
        w : ndarray
            Discrepancy from the other readings over its standard deviation; nan if uncontrolled.
        mdb_m : ndarray
            Minimal detectable bias of the radius, m; infinite if uncontrolled.
        accepted : ndarray of bool
        """
        is_of_kind, tested = self.are(kind), self.tested
        w = np.where(np.isfinite(tested.sd_m), tested.w, np.nan)
        return w[is_of_kind], noncentrality() * tested.sd_m[is_of_kind], tested.accepted[is_of_kind]

    @property
    def accepted(self):
        """Readings from which the field is estimated."""
        return [
            reading
            for reading, is_accepted in zip(self.readings, self.tested.accepted, strict=True)
            if is_accepted
        ]

    @cached_property
    def collimations(self):
        """{plummet: (kappa, standard uncertainty), rad}, adjusted together with the wall.

        A collimation without a prior is an unknown of the field. With a prior standard uncertainty
        u and a column c of derivatives,

            kappa = u^2 c' P y,   variance u^2 - u^4 c' P c.
        """
        collimations, accepted = {}, self.accepted
        # The last of `Sites.shared`.
        unknowns = columns_of([reading.free for reading in self.readings])
        for index, (kind, name) in enumerate(unknowns, start=-len(unknowns)):
            if kind == "collimation":
                values, covariance = self.field.shared
                collimations[name] = float(values[index]), float(np.sqrt(covariance[index, index]))
        precision, points = None, len(self.field.radius_m) - len(accepted)
        for (kind, name), (_, _, column) in shared_effects(accepted).items():
            if kind != "collimation":
                continue
            if precision is None:
                design = free_design(self.field.sites)[0]
                precision = restricted_precision(self.field.covariance_m2, design)
            u = next(
                reading.effects[kind, name][0]
                for reading in accepted
                if (kind, name) in reading.effects
            )
            # Arc seconds to radians; zeros for the readings of points, which precede these
            # readings.
            u, column = np.radians(u / 3600), np.pad(column, (points, 0))
            share = column @ precision @ column
            collimations[name] = (
                float(u * (column @ precision @ self.field.radius_m)),
                float(u * np.sqrt(max(1 - share, 0.0))),
            )
        return collimations

    def are(self, kind):
        """Mask (n,) of the readings of a kind."""
        return np.array([reading.of == kind for reading in self.readings], dtype=bool)


def detectable_m(wall, kind):
    """Minimal detectable bias of the readings of a kind, m; () for a wall without such tests."""
    read = wall if isinstance(wall, ReadWall) else getattr(wall, "read", None)
    return () if read is None else read.tests_of(kind)[1]
