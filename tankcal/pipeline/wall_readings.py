"""Readings of a wall that name no point: each a radius of it, somewhere, with what it shares.

Straps are the mean of a whole turn. Offsets are radii at the azimuth of their line, but for a
constant of that line. What readings share is a column: an effect of a known standard uncertainty,
or an unknown that nothing binds beforehand.
"""

from dataclasses import dataclass, field, replace

import numpy as np

from tankcal.geometry.field.blunders import MOST_ROUNDS, restricted_precision, snoop_wall
from tankcal.geometry.field.sites import Sites, free_design, spans_of
from tankcal.survey.reference_line import level_names
from tankcal.tank.factors import Factor

FORMER, FORMER_SD_M = "former_radius", 0.01  # of courses that were not measured again
UNCONTROLLED = 1e-6  # of a reading's variance: what the others leave of it where there are none


@dataclass(frozen=True)
class WallReading:
    """A radius of the wall as one reading has it.

    Attributes
    ----------
    of : str
        "straps" or "offsets": its name in a budget.
    course : int
    level_m : float
        Above the table's zero.
    radius_m, sd_m : float
        Of the painted shell outside; the sd is of what it shares with none.
    azimuth_rad : float
        nan: of a whole turn.
    ring : int
        Readings that have a centre of their own; below 0: none.
    effects : dict
        {(kind, name): (u, unit, what one u of it does, m)}.
    free : dict
        {name: derivative by an unknown that nothing binds beforehand}.
    by_inputs : dict
        {input of an uncertainty budget: derivative by it}.
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
    """`WallReading` of each reduced circumference: of the circle of equal area.

        r = C / (2 pi sqrt(1 + excess))

    used     Reduced circumferences
    courses  names of the courses
    term     `AreaTerm`
    """
    found = []
    for reading in used:
        per_m = 1 / (2 * np.pi * np.sqrt(1 + term.mean))
        radius = per_m * reading.circumference_m
        effects = {
            (effect.kind, effect.name): (effect.u, effect.unit, effect.by_m * per_m)
            for effect in reading.effects
        }
        if term.sd:
            by_m = -radius / (2 * (1 + term.mean)) * term.sd
            effects["area_term", ""] = (1e6 * term.sd, "ppm", by_m)
        by = {"shell_temperature": reading.by_shell_temperature_m * per_m}
        found.append(
            WallReading(
                "straps",
                courses.index(reading.strap.course),
                reading.strap.level_m,
                radius,
                reading.sd_m * per_m,
                effects=effects,
                by_inputs={name: value for name, value in by.items() if value},
            )
        )
    return found


def readings_of_offsets(given, used, courses, insets_m):
    """`WallReading` of each offset from a reference line.

    given     `ReferenceLines`
    used      offsets that count
    courses   names of the courses
    insets_m  (courses,) of plate and paint: an inside line sees the radius without them

    The reference level has no centre of its own: the constants of the lines take it up.
    """
    found, levels = [], level_names(used)
    reference = {int(level) for level, one in zip(levels, used, strict=True) if one.reference}
    for level, one in zip(levels, used, strict=True):
        line, plummet = given.of(one)
        course, radial = courses.index(one.course), given.radial_m(one)
        effects, free = {}, {("line", one.line): 1.0}
        by_angle = given.by_collimation_m(one)
        if plummet.u_scale:
            by_m = radial * plummet.u_scale
            effects["instrument_scale", plummet.name] = (1e6 * plummet.u_scale, "ppm", by_m)
        if plummet.u_collimation_rad is None:
            free["collimation", plummet.name] = by_angle
        elif plummet.u_collimation_rad:
            u = plummet.u_collimation_rad
            effects["collimation", plummet.name] = (np.degrees(u) * 3600, "arcsec", by_angle * u)
        found.append(
            WallReading(
                "offsets",
                course,
                one.level_m,
                radial + line.inside * insets_m[course],
                one.sd_m,
                line.azimuth_rad,
                -1 if int(level) in reference else int(level),
                effects,
                free,
                {"plate_thickness": 1.0, "paint": 1.0} if line.inside else {},
            )
        )
    return found


def readings_of_untold(job, told, joints_m, zero_m):
    """`WallReading`s of courses that a survey beside former radii does not tell: these, in wide
    doubt, so that there is a wall.

    Each has a free radius of its own, so that they say nothing of the courses that were measured.

    told  indices of the courses that are told
    """
    if job.radii is None:
        return []
    known = np.where(job.radii.is_known, job.radii.radius_m, job.tank.nominal_diameter_m / 2)
    return [
        WallReading(
            FORMER, i, (joints_m[i] + joints_m[i + 1]) / 2 - zero_m, float(known[i]), FORMER_SD_M
        )
        for i in range(len(job.courses))
        if i not in told
    ]


def off_centre(readings, field):
    """The readings as from the centre of their level: R lacks (e x n)^2 / (2 rho) of a circle."""
    centres, found = field.centres_m, []
    for reading in readings:
        if reading.ring < 0:
            found.append(reading)
            continue
        x, y = centres[reading.ring]
        across = x * np.cos(reading.azimuth_rad) - y * np.sin(reading.azimuth_rad)
        found.append(
            replace(reading, radius_m=reading.radius_m + across**2 / (2 * field.nominal_m))
        )
    return found


def sites_of(readings, joints_m, zero_m):
    """`Sites` of readings; zero_m is the height of the table's zero above the bottom."""
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
    """Names of courses, or of rings."""
    return [course.name for course in courses]


def noise_of(readings):
    """(n, n) covariance of the radii: what each reading has of its own, and what they share."""
    shared = shared_effects(readings).values()
    common = np.column_stack([np.zeros(len(readings)), *(column for *_, column in shared)])
    return np.diag([reading.sd_m**2 for reading in readings]) + common @ common.T


def noise_by_inputs(inputs, columns, count):
    """(n, n) covariance of n radii by declared inputs that they depend on, so that readings weigh
    no more than plates and temperature let them.

    inputs   with name and u, SI
    columns  {input: (n,) derivative of the radii}
    """
    known = {declared_input.name: declared_input.u for declared_input in inputs}
    found = np.zeros((count, count))
    for name, column in columns.items():
        found += known.get(name, 0.0) ** 2 * np.outer(column, column)
    return found


def shared_effects(readings):
    """{(kind, name): (u, unit, (n,) what one u of it does to the radii)} of common causes."""
    columns = columns_of([{key: one[2] for key, one in each.effects.items()} for each in readings])
    told = {key: one[:2] for each in readings for key, one in each.effects.items()}
    return {key: (*told[key], column) for key, column in columns.items()}


def settle_readings(field, field_of, given, may_go):
    """The field of a wall and what became of its readings: each tested by all others, and the field
    found again, until none changes sides.

    Parameters
    ----------
    field : WallField
        Of all readings.
    field_of : callable
        field_of(accepted) -> WallField of some.
    given : tuple
        Sites, (n,) radii and (n, n) noise of all.
    may_go : ndarray, shape (n,)
        Which of them may be rejected.

    Returns
    -------
    field : WallField
        Of those that are accepted.
    tested : Tested
        An infinite sd_m of those that no other reading controls.
    """
    sites, radius, noise = given
    accepted = np.ones(len(radius), dtype=bool)
    for _ in range(MOST_ROUNDS):
        whole = replace(field, sites=sites, radius_m=radius, noise_m2=noise).covariance_m2
        precision = restricted_precision(whole, free_design(sites)[0])
        pull, most = precision @ (radius - radius.mean()), np.sqrt(np.diag(whole) / UNCONTROLLED)
        tested = snoop_wall(precision, pull, accepted, may_go, most)
        if np.all(tested.accepted == accepted):
            break
        accepted = tested.accepted
        field = field_of(accepted)
    controlled = tested.sd_m**-2.0 * np.diag(whole) > UNCONTROLLED
    return field, replace(tested, sd_m=np.where(controlled, tested.sd_m, np.inf))


def factors_of_readings(readings, weights):
    """`Factor`s of what readings leave uncertain about features: of their own, and what they share.

    weights  (f, n) derivative of the features by their radii
    """
    found = []
    for kind in dict.fromkeys(reading.of for reading in readings):
        own = weights * np.array([reading.sd_m * (reading.of == kind) for reading in readings])
        found.append(Factor(kind, own))
    for (kind, name), (u, unit, column) in shared_effects(readings).items():
        by = (weights @ column)[:, None]
        found.append(Factor(kind, by, u=u, unit=unit, type="B", note=name))
    return tuple(one for one in found if np.any(one.columns))


def factors_of_plates(names, field, weights, plate_sd_m):
    """`Factor`s of plates that a gauge read, (f, n) weights being of readings that see them.

    names       of the courses
    plate_sd_m  {course index: standard uncertainty}
    """
    found = []
    for course, sd in plate_sd_m.items():
        by = weights @ (sd * (field.sites.course == course))
        found.append(Factor("plate_readings", by[:, None], note=names[course]))
    return tuple(one for one in found if np.any(one.columns))


def inputs_read_with(readings, weights):
    """{input of a budget: (f,) derivative of features}, of inputs that readings depend on."""
    rows = columns_of([reading.by_inputs for reading in readings])
    return {name: weights @ column for name, column in rows.items()}


def columns_of(rows):
    """{name: (n,) its values} of n dicts; 0 where one has none."""
    found = {}
    for place, row in enumerate(rows):
        for name, value in row.items():
            found.setdefault(name, np.zeros(len(rows)))[place] = value
    return found
