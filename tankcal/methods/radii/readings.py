"""Radii of a former table, record or declaration: checks, and their possible change in SI."""

from dataclasses import dataclass

import numpy as np

from tankcal.job.checking import has_rows, is_not_given, missing_beside, refuse_repeated, tell
from tankcal.job.checks.bearing import explain_temperature
from tankcal.job.checks.extent import is_supplemented, is_surveyed
from tankcal.job.checks.tapes import refuse_others
from tankcal.job.covariance import Archive, check_covariance, read_covariance
from tankcal.job.plausibility import DIAMETER_MISS, DIAMETER_MISS_M, IMPOSSIBLE_MISS
from tankcal.job.structure import structure
from tankcal.messages import message
from tankcal.methods.radii.columns import KEYS, NEEDED, NEEDED_OF_CHANGE

COVARIANCE = Archive("radii_cov.npz", "courses", "radii.csv", 1)

DIAMETER = (1.8, 2.2)  # ratio to the nominal radius that indicates a diameter


def check_radii(values, tables, raw, log):
    """Check courses, radii, their covariance, and required settings; as for `Method.check`."""
    _check_radii_covariance(tables, raw, log)
    if not has_rows(tables["radii"]):
        _tell_without_rows(raw, log)
        return
    table, courses = tables["radii"], tables["courses"]
    refuse_repeated(table, "course", log)
    known = () if courses is None else tuple(courses.of("course"))
    refuse_others(table, "course", known, log)
    if not is_surveyed(tables) and not _has_unreadable_survey(raw):
        _refuse_gaps(table, courses, log)
    if is_supplemented(tables):
        expected = message(
            "radii_beside_liquid",
            "given beside {file}; expected only one of them",
            file=tables["liquid"].file,
        )
        log.problem(table.file, expected)
    if values is not None:
        _check_sizes(table, values["tank"]["nominal_diameter_m"], log)
        _check_settings(values, tables, raw, log)


def _tell_without_rows(raw, log):
    if raw.tables.get("radii", ()) is None:
        return  # unreadable, reported already
    for section in KEYS:
        for key in _given_keys(raw, section)[:1]:
            expected = message(
                "settings_without_radii",
                "given without {file}; expected both or none",
                file=raw.file_of("radii"),
            )
            tell(log.problem, raw, section, key, expected)


def _given_keys(raw, section):
    entries = (raw.settings or {}).get(section, {})
    return [key for key in entries if not is_not_given(raw, section, key)]


def _has_unreadable_survey(raw):
    return any(table is None for name, table in raw.tables.items() if name != "radii")


def _refuse_gaps(table, courses, log):
    """Require the radius of every course if no survey measures the wall."""
    blank = message(
        "radius_missing", "blank; expected the radius of the course: no survey measures it"
    )
    for row, radius in zip(table.rows, table.of("radius_m"), strict=True):
        if radius is None and not log.has(table.file, row, "radius_m"):
            log.problem(table.file, blank, row, "radius_m")
    if courses is None or courses.skipped or table.skipped:
        return
    for name in courses.of("course"):
        if name is not None and name not in table.of("course"):
            expected = message(
                "course_without_radius",
                "no row for course {course!r}; expected its radius: no survey measures it",
                course=name,
            )
            log.problem(table.file, expected, None, "course")


def _check_sizes(table, diameter_m, log):
    """Compare the radii with half the nominal diameter."""
    if diameter_m is None:
        return
    nominal = diameter_m / 2
    for row, radius in zip(table.rows, table.of("radius_m"), strict=True):
        if radius is None or abs(radius - nominal) <= DIAMETER_MISS * nominal + DIAMETER_MISS_M / 2:
            continue
        ratio, sizes = radius / nominal, {"radius_m": radius, "nominal_m": nominal}
        if DIAMETER[0] < ratio < DIAMETER[1]:
            expected = message(
                "radius_is_diameter",
                "found {radius_m:g} m; expected about {nominal_m:g} m, half of"
                " tank.nominal_diameter_m: is it a diameter?",
                **sizes,
            )
            log.problem(table.file, expected, row, "radius_m")
        elif not 1 / (1 + IMPOSSIBLE_MISS) <= ratio <= 1 + IMPOSSIBLE_MISS:
            expected = message(
                "radius_impossible",
                "found {radius_m:g} m; expected about {nominal_m:g} m, half of"
                " tank.nominal_diameter_m: is one of them in another unit?",
                **sizes,
            )
            log.problem(table.file, expected, row, "radius_m")
        else:
            expected = message(
                "radius_unlike_drawing",
                "{radius_m:g} m, half of tank.nominal_diameter_m is {nominal_m:g} m: they differ by"
                " {percent:+.2f} %",
                percent=100 * (ratio - 1),
                **sizes,
            )
            log.warning(table.file, expected, row, "radius_m")


def _check_settings(values, tables, raw, log):
    def refuse(section, key, expected):
        tell(log.problem, raw, section, key, expected)

    for key in NEEDED:
        if is_not_given(raw, "radii", key):
            refuse("radii", key, missing_beside(tables["radii"].file))
    change = values["change"]
    if not is_surveyed(tables):
        expected = message(
            "change_without_survey",
            "given without a survey; expected one of some courses beside the former radii",
        )
        for key in () if _has_unreadable_survey(raw) else _given_keys(raw, "change"):
            refuse("change", key, expected)
        return
    expected = message(
        "change_missing",
        "missing; expected how far the radii may have changed since they were measured: what the"
        " courses get that nobody measured again hangs on it",
    )
    for key in NEEDED_OF_CHANGE:
        if is_not_given(raw, "change", key):
            refuse("change", key, expected)
    shared, common = change["shared_mm"], values["radii"]["u_common_mm"]
    if None not in (shared, common) and shared > common:
        expected = message(
            "shared_too_large",
            "found {shared:g}; expected at most radii.u_common_mm = {common:g}: it is a part of it",
            shared=shared,
            common=common,
        )
        refuse("change", "shared_mm", expected)


def _check_radii_covariance(tables, raw, log):
    """Check the covariance matrix of the radii, if there is one; as for `Method.check`."""
    radii, data = tables["radii"], raw.archives.get(COVARIANCE.file)
    if data is None:
        return
    if radii is None:
        if "radii" not in raw.tables or raw.tables["radii"] is not None:  # else reported already
            expected = message(
                "covariance_without_radii",
                "given without its radii; expected radii.csv beside it",
            )
            log.problem(COVARIANCE.file, expected)
        return
    if radii.columns["u_mm"] is not None:
        expected = message(
            "covariance_beside_u",
            "given together with u_mm of the radii; expected only one of them",
        )
        log.problem(COVARIANCE.file, expected)
    check_covariance(data, radii.of("course"), log, COVARIANCE)


def useless_inputs(values, tables):
    """Reasons for inputs without effect on radii alone; {} beside a survey."""
    if is_surveyed(tables):
        return {}
    why = message(
        "radii_are_inside",
        "expected only with a survey: the radii are those of the empty shell, inside, with their"
        " own uncertainty",
    )
    inputs = ("scale", "offset", "paint", "shell_temperature", "survey_level")
    reasons = explain_temperature(values, values["radii"]["reference_temperature_c"])
    return reasons | dict.fromkeys((*inputs, "survey_density"), why)


@dataclass(frozen=True)
class Change:
    """Standard uncertainties of the change of radii since their measurement.

    Attributes
    ----------
    common_m : float
        Common change of all radii, m.
    own_m : float
        Independent change of each radius, m.
    shared_m : float
        Common component of the errors of the former radii and of the new survey, m.
    """

    common_m: float = 0.0
    own_m: float = 0.0
    shared_m: float = 0.0


@dataclass(frozen=True)
class Radii:
    """Radii of the courses of a vertical tank, from the bottom up.

    Each radius belongs to the circle with the mean area of the course, inside, with the tank empty.

    Attributes
    ----------
    radius_m : ndarray, shape (courses,)
        nan: not known; the course was measured again.
    covariance_m2 : ndarray, shape (courses, courses)
        Covariance matrix without the common component, m2; 0 for radii not known.
    u_common_m : float
        Standard uncertainty of the common component.
    temperature_c : float
        Temperature of the shell at which the radii hold.
    source : {"table", "record", "declared"}
        Origin of the radii.
    note : str
        Printed.
    file : str
    row : tuple of int or None
        Row of each course in that file.
    change : Change or None
        Possible change since the measurement; None without a new survey.
    """

    radius_m: np.ndarray
    covariance_m2: np.ndarray
    u_common_m: float
    temperature_c: float
    source: str
    note: str = ""
    file: str = "radii.csv"
    row: tuple = ()
    change: Change | None = None

    @property
    def is_known(self):
        """True for each course with a known radius, shape (courses,)."""
        return np.isfinite(self.radius_m)


def make_radii(values, tables, raw):
    """`Radii` of a job without problems; parameters as for `Method.read`."""
    table, given = tables["radii"], values["radii"]
    place = {name: i for i, name in enumerate(table.of("course"))}
    order = [place.get(name) for name in tables["courses"].of("course")]
    is_given = [i is not None for i in order]
    radius, covariance = np.full(len(order), np.nan), np.zeros((len(order), len(order)))
    # Place the rows of radii.csv in the order of the courses; missing courses stay nan.
    rows = [i for i in order if i is not None]
    radius[is_given] = table.numbers("radius_m")[rows]
    data = raw.archives.get(COVARIANCE.file)
    if data is not None:
        covariance_m2 = read_covariance(data)
    else:
        covariance_m2 = np.diag(np.nan_to_num(table.numbers("u_mm") / 1000) ** 2)
    covariance[np.ix_(is_given, is_given)] = covariance_m2[np.ix_(rows, rows)]
    covariance[np.isnan(radius)], covariance[:, np.isnan(radius)] = 0.0, 0.0
    # Radii without a temperature refer to the temperature of the table.
    temperature = given["reference_temperature_c"]
    if temperature is None:
        temperature = values["table"]["reference_temperature_c"]
    return structure(
        Radii,
        given,
        radius_m=radius,
        covariance_m2=covariance,
        temperature_c=temperature,
        file=table.file,
        row=tuple(None if i is None else table.rows[i] for i in order),
        change=structure(Change, values["change"]) if is_surveyed(tables) else None,
    )
