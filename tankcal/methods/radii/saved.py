"""Saved part of former radii and of their update by a new survey, and the table of the courses."""

import numpy as np

from tankcal.record.schema import Saved, key
from tankcal.record.table import bottom_choice, roof_choice, top_choice
from tankcal.report.tables import Column, Table
from tankcal.report.tables.facts import radii_source_text


class CourseByRadius(Saved):
    """A course: its former radius, its radius by a new survey, and its radius in the table."""

    course: str = key("name")
    former_radius_m: float | None = key("as declared; null: not known")
    u_former_m: float | None = key("its standard uncertainty, including the common part")
    u_before_m: float | None = key("with the declared change; null: no new survey")
    found_m: float | None = key("by the new survey alone; null: not measured again")
    u_found_m: float | None = key("standard uncertainty of found_m")
    misclosure_m: float | None = key("found_m less former_radius_m")
    w: float | None = key("misclosure over its standard deviation")
    radius_m: float = key("in the table: inside, shell empty, at temperature_c")
    u_m: float = key("standard uncertainty of radius_m")


class ChangeOfRadii(Saved):
    """Declared change of the radii since the former table, type B."""

    common_m: float = key("standard uncertainty of the change of all radii together")
    own_m: float = key("standard uncertainty of the change of each radius")
    shared_m: float = key("common error of the former radii and the new survey")
    limit_w: float = key("largest permissible |w|")


class RadiiRecord(Saved):
    """The radii from which the table is computed."""

    source: str = key("table, record or declared")
    note: str = key("as given")
    temperature_c: float = key("shell temperature of the radii")
    u_common_m: float = key("standard uncertainty common to the former radii")
    change: ChangeOfRadii | None = key("null: no new survey")
    courses: list[CourseByRadius] = key("from the bottom up")


def save_radii(result):
    """`RadiiRecord` of a result."""
    wall, radii, change = result.radii, result.job.radii, None
    if wall.updated is not None:
        from tankcal.methods.radii.wall import LARGEST_W

        declared = radii.change
        change = ChangeOfRadii(declared.common_m, declared.own_m, declared.shared_m, LARGEST_W)
    return RadiiRecord(
        radii.source, radii.note, radii.temperature_c, radii.u_common_m, change, _courses(result)
    )


def _courses(result):
    """Return `CourseByRadius` of each course."""
    wall, radii = result.radii, result.job.radii
    u_former_m = np.sqrt(np.diag(radii.covariance_m2) + radii.u_common_m**2)
    u_m = np.sqrt(np.diag(wall.covariance_with(result.job.inputs)))
    return [
        CourseByRadius(
            course.name,
            radii.radius_m[i] if radii.is_known[i] else None,
            u_former_m[i] if radii.is_known[i] else None,
            **_survey_values(wall.updated, i, radii.is_known[i]),
            radius_m=wall.radius_m[i],
            u_m=u_m[i],
        )
        for i, course in enumerate(result.job.courses)
    ]


def _survey_values(updated, course, is_known):
    """Return the keys of `CourseByRadius` that follow from a new survey; None without survey."""
    values = dict.fromkeys(("u_before_m", "found_m", "u_found_m", "misclosure_m", "w"))
    if updated is None:
        return values
    if is_known:
        values["u_before_m"] = updated.u_before_m[course]
    for k in np.flatnonzero(updated.update.measured == course):
        values |= {"found_m": updated.found_m[k], "u_found_m": updated.u_found_m[k]}
        if is_known:
            values["misclosure_m"] = updated.update.misclosure_m[k]
            values["w"] = updated.update.w[k]
    return values


def choices_of(result):
    """Choices on former radii of the courses, and on their origin: {code: value}."""
    job = result.job
    is_updated = result.radii.updated is not None
    temperature = "radii_applied" if job.switches.temperature else "off"
    if job.radii.temperature_c == job.table.reference_temperature_c:
        is_reduced = is_updated and job.survey.shell_temperature_c is not None
        temperature = "radii_updated" if is_reduced else "radii_as_they_are"
    return {
        "bottom": bottom_choice(job),
        **top_choice(job),
        "radii": job.radii.source,
        "radii_beside": "survey" if is_updated else "none",
        "between_sections": "radii",
        "tilt": "not_known",
        "course_heights": "along_axis",
        "roof": roof_choice(job),
        "thickness": "radii_updated" if is_updated else "radii",
        "temperature": temperature,
    }


def _radii_column(key, heading, unit="", **more):
    return Column(key, unit, heading=f"radii_{heading}", sheet=True, **more)


RADII = Table(
    "radii",
    (
        _radii_column("course", "course", width=9),
        _radii_column("former_radius_m", "former", "m", u="u_former_m", least=4),
        _radii_column("u_former_m", "u_former", "mm", digits=2),
        _radii_column("u_before_m", "u_before", "mm", digits=2, optional=True),
        _radii_column("found_m", "found", "m", u="u_found_m", least=4, optional=True),
        _radii_column("u_found_m", "u_found", "mm", digits=2, optional=True),
        _radii_column("misclosure_m", "misclosure", "mm", decimals=2, optional=True),
        _radii_column("w", "w", decimals=2, optional=True, width=8),
        _radii_column("radius_m", "radius", "m", u="u_m", least=4),
        _radii_column("u_m", "u", "mm", digits=2),
    ),
    rows=lambda record: _radii_rows(record["radii"]),
)


def _radii_rows(radii):
    """Return the rows, without the keys of a new survey if no survey exists."""
    if radii["change"] is not None:
        return radii["courses"]
    kept = ("course", "former_radius_m", "u_former_m", "radius_m", "u_m")
    return [{key: course[key] for key in kept} for course in radii["courses"]]


# ---- former radii in the report: source, assumed change, and results


def facts(paper):
    """Block of source, temperature, common uncertainty and assumed change of the radii."""
    radii = paper.record["radii"]
    change = radii["change"] or {}
    return paper.facts(
        [
            ("radii_source", radii_source_text(paper)),
            ("radii_temperature", paper.number(radii["temperature_c"], "degC", digits=3)),
            ("radii_u_common", _type_b_text(paper, radii["u_common_m"])),
            ("change_common", _type_b_text(paper, change.get("common_m"))),
            ("change_own", _type_b_text(paper, change.get("own_m"))),
            ("change_shared", _type_b_text(paper, change.get("shared_m") or None)),
        ]
    )


def courses(paper):
    """Table of the courses, with the results of a new survey if there is any."""
    change = paper.record["radii"]["change"]
    if change is None:
        return paper.show(RADII)
    limit = paper.number(change["limit_w"], "", decimals=0)
    return paper.show(RADII, on="radii_updated", limit=limit)


def _type_b_text(paper, u_m):
    if u_m is None:
        return None
    return paper.word("texts.of_type_b", u=paper.number(u_m, "mm", digits=2))
