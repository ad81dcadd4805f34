"""Saved part of strapping, and the tables that print it: readings, corrections, tapes, courses."""

import numpy as np

from tankcal.record.schema import Finite, Saved, key
from tankcal.record.survey import radius_sd, shell_by_survey
from tankcal.record.table import bottom_choice, roof_choice, top_choice
from tankcal.report.tables.table import Column, Table
from tankcal.units import FULL_TURN


class StrapReading(Saved):
    """A reading of a tape round the tank, and the resulting circumference."""

    circumference: str = key("name; repeats share it")
    course: str = key("of the circumference")
    level_m: float = key("above the table's zero")
    tape: str = key("name")
    reading_m: float = key("as read")
    certificate_m: float = key("correction by the certificate of the tape, or by its master")
    temperature_m: float = key("correction for the temperature of the tape")
    tension_m: float = key("correction for its pull")
    tape_thickness_m: float = key("correction for half the thickness of the tape")
    rise_m: float = key("correction for obstacles between tape and shell")
    sag_m: float | None = key("correction for the sag of free parts", optional=True)
    out_of_level_m: float = key("correction for a tape that is not level")
    circumference_m: float = key("of the painted shell, after these corrections")
    sd_m: float = key("its sd, from errors of this reading alone")
    difference_m: float = key("from the circumference of its course")
    w: float | None = key("deviation from all other readings over its sd; null: uncontrolled")
    mdb_m: float | None = key("smallest blunder that the test detects; null: uncontrolled")
    used: bool = key("false: only compared, or rejected")
    row: int | None = key("of the file")


class TapeUsed(Saved):
    """A tape, with the correction of its readings."""

    tape: str = key("name")
    certificate: str = key('its number; "": not given')
    correction: Finite = key("true = reading (1 + correction)")
    u_scale: Finite = key("standard uncertainty of its scale, relative")
    u_comparison: Finite = key("relative, by the comparison with its master; 0: none")
    master: str = key('tape with which it was compared; "": none')
    master_certificate: str = key('number of its certificate; "": not given, or no master')
    comparisons: int = key("number of readings of both tapes")


class StrapOfCourse(Saved):
    """Results of the straps of a course."""

    course: str = key("name")
    circumference_m: float = key("mean, of the painted shell")
    area_term_m: float = key("its reduction by the area term")
    radius_m: float = key("of the circle of equal area, outside")
    radius_sd_m: float = key("its standard deviation, as the mean of the course")
    thickness_m: float = key("of the plates")
    plate_sd_m: float | None = key(
        "standard uncertainty of the thickness by a gauge; null: not read"
    )
    paint_m: float = key("thickness")
    inside_radius_m: float = key("at the temperature of the survey")


class StrappingRecord(Saved):
    """Circumferences by tape: every reading with its corrections, tapes, courses."""

    readings: list[StrapReading] = key("in the order of the file")
    tapes: list[TapeUsed] = key("used for the readings")
    courses: list[StrapOfCourse] = key(
        "from the bottom up; with former radii only courses that were measured again"
    )
    shape_sd_m: float = key(
        "standard deviation of the radius round the wall: declared, by the points, or typical"
    )
    area_term: Finite = key("relative excess of the circle of a perimeter")
    area_term_sd: Finite = key("its standard deviation")
    wave_m: float | None = key("largest deviation of a tape from its level; null: not given")
    helix_m: float | None = key("largest difference in height of its ends; null: not given")


def save_strapping(result):
    """`StrappingRecord` of a result."""
    straps, strapping = result.straps, result.job.strapping
    return StrappingRecord(
        readings=_readings(result),
        tapes=tapes_of(straps.tapes, strapping),
        courses=_courses(result),
        shape_sd_m=straps.shape_sd_m,
        area_term=straps.area_term.mean,
        area_term_sd=straps.area_term.sd,
        wave_m=strapping.wave_m,
        helix_m=strapping.helix_m,
    )


def _readings(result):
    """Return `StrapReading` of each reading."""
    straps = result.straps
    names = [part.name for part in result.job.courses or result.job.rings]
    circumference_m = dict(zip(names, straps.circumference_m, strict=True))
    w, mdb_m = np.full((2, len(straps.reduced)), np.nan)
    w[straps.adjusted], mdb_m[straps.adjusted] = straps.w, straps.mdb_m
    rejected = set(straps.adjusted[~straps.accepted].tolist())
    return [
        StrapReading(
            circumference=reduced.strap.name,
            course=reduced.strap.course,
            level_m=reduced.strap.level_m,
            tape=reduced.strap.tape,
            reading_m=reduced.strap.reading_m,
            **{f"{step}_m": size for step, size in reduced.steps_m.items()},
            circumference_m=reduced.circumference_m,
            sd_m=reduced.sd_m,
            difference_m=reduced.circumference_m - circumference_m[reduced.strap.course],
            w=w[index],
            mdb_m=mdb_m[index],
            used=not reduced.strap.check and index not in rejected,
            row=reduced.strap.row,
        )
        for index, reduced in enumerate(straps.reduced)
    ]


def tapes_of(tapes, strapping):
    """Return `TapeUsed` of each (Tape, sd of its scale by the comparison with its master)."""
    certificates = {tape.name: tape.certificate for tape in strapping.tapes}
    return [
        TapeUsed(
            tape=tape.name,
            certificate=tape.certificate,
            correction=tape.correction,
            u_scale=tape.u_scale,
            u_comparison=sd,
            master=tape.master,
            master_certificate=certificates.get(tape.master, ""),
            comparisons=len(strapping.comparisons) if tape.master else 0,
        )
        for tape, sd in tapes
    ]


def _radius_sds(result):
    """Return the standard deviations of the mean radii of courses or rings as measured, m."""
    if result.rings is not None:
        scale = result.body.parts[0].scale
        return result.rings.radius_sd_m(result.body.parts[0].factors) / scale
    shell = shell_by_survey(result)
    return [radius_sd(shell, course) for course in result.body.shell.volume.courses]


def _courses(result):
    """Return `StrapOfCourse` of the courses or rings with straps."""
    straps, radius_sds = result.straps, _radius_sds(result)
    courses = list(enumerate(result.job.courses or result.job.rings))
    if result.radii is not None:  # the radii of other courses are former inside radii, no straps
        courses = [courses[index] for index in result.radii.updated.update.measured.tolist()]
    rows = []
    for index, course in courses:
        radius_m, circumference_m = straps.radius_m[index], straps.circumference_m[index]
        rows.append(
            StrapOfCourse(
                course=course.name,
                circumference_m=circumference_m,
                area_term_m=FULL_TURN * radius_m - circumference_m,
                radius_m=radius_m,
                radius_sd_m=radius_sds[index],
                thickness_m=course.thickness_m,
                plate_sd_m=straps.plate_sd_m.get(index),
                paint_m=course.paint_m,
                inside_radius_m=radius_m - course.thickness_m - course.paint_m,
            )
        )
    return rows


def choices_of(result):
    """Choices on straps, alone or beside points: {code: value}; {} for rings."""
    job = result.job
    if result.wall is not None:
        is_inside = job.survey.side == "inside"
        return {"straps": "beside_points"} | ({"thickness": "inside_strapped"} if is_inside else {})
    if result.strapped is None:
        return {}
    is_partial = job.radii is not None  # the other courses keep their former radii
    return {
        "bottom": bottom_choice(job),
        "survey": "strapping_again" if is_partial else "strapping",
        "area_term": _area_term_choice(job.strapping.shape_sd_m),
        **top_choice(job),
        "between_sections": "cylinders",
        "tilt": "not_measured",
        "course_heights": "along_axis",
        "roof": roof_choice(job),
        "form": "learned",
    }


def _area_term_choice(shape_sd_m):
    if shape_sd_m is None:
        return "assumed"
    return "none" if shape_sd_m == 0 else 1000 * shape_sd_m


_STEPS = (
    *("certificate", "temperature", "tension", "tape_thickness", "rise", "sag", "out_of_level"),
)
_BOTH = "straps strap_corrections"

STRAPS = Table(
    "straps",
    (
        Column("circumference", sheet="circumference", width=14, csv="circumference"),
        Column("course", on="straps", sheet="course", width=9, csv="course"),
        Column("level_m", "m", decimals=3, on="straps", sheet="strap_level_m", csv="level_m"),
        Column("tape", on="straps", sheet="tape", width=12, csv="tape"),
        Column("reading_m", "m", decimals=4, on=_BOTH, sheet="strap_reading_m", csv="reading_m"),
        *(
            Column(f"{step}_m", "mm", decimals=2, heading=f"strap_{step}", on="strap_corrections",
                   sheet=f"strap_{step}_mm", csv=f"{step}_mm", csv_unit="mm")
            for step in _STEPS
        ),
        Column("circumference_m", "m", decimals=4, heading="strap_circumference_m", on=_BOTH,
               sheet="strap_circumference_m", csv="circumference_m"),
        Column("sd_m", "mm", decimals=2, heading="strap_sd", on="straps", sheet="strap_sd_mm",
               csv="s_mm", csv_unit="mm"),
        Column("difference_m", "mm", decimals=1, heading="strap_difference", on="straps",
               sheet="strap_difference_mm", csv="difference_mm", csv_unit="mm"),
        Column("w", decimals=1, on="straps", sheet="w", width=8, csv="w"),
        Column("mdb_m", "mm", decimals=1, heading="mdb", on="straps", sheet="strap_mdb_mm",
               csv="mdb_mm", csv_unit="mm"),
        Column("used", sheet="used", width=8, csv="used", on="straps"),
    ),
    rows=lambda record: record["strapping"]["readings"],
    csv_style="%.6f",
)  # fmt: skip


def convert_to_ppm(tape):
    """Return a tape with its scale in ppm; values of a missing comparison are None."""
    shown = {key: 1e6 * tape[key] for key in ("correction", "u_scale", "u_comparison")}
    shown["certificate"] = tape["certificate"] or None
    if not tape["master"]:
        shown |= dict.fromkeys(("u_comparison", "master", "comparisons"))
    return tape | shown


TAPES = Table(
    "tapes",
    (
        Column("tape", sheet="tape", width=12),
        Column("certificate", heading="tape_certificate", sheet="tape_certificate", width=18),
        Column("correction", "ppm", decimals=1, heading="tape_correction",
               sheet="tape_correction_ppm"),
        Column("u_scale", "ppm", decimals=1, heading="tape_u_scale", sheet="tape_u_scale_ppm"),
        Column("u_comparison", "ppm", decimals=1, heading="tape_u_comparison",
               sheet="tape_u_comparison_ppm"),
        Column("master", heading="tape_master", sheet="tape_master"),
        Column("comparisons", decimals=0, heading="tape_comparisons", sheet="tape_comparisons"),
    ),
    rows=lambda record: [convert_to_ppm(tape) for tape in record["strapping"]["tapes"]],
)  # fmt: skip

STRAPPED_COURSES = Table(
    "strapped_courses",
    (
        Column("course", sheet="course", width=9),
        Column("circumference_m", "m", decimals=4, heading="strap_circumference_m",
               sheet="strap_circumference_m"),
        Column("area_term_m", "mm", decimals=2, heading="strap_area_term",
               sheet="strap_area_term_mm"),
        Column("radius_m", "m", decimals=5, heading="outside_radius_m", sheet="outside_radius_m"),
        Column("radius_sd_m", "mm", decimals=2, sheet="u_radius_mm", width=10),
        Column("thickness_m", "mm", decimals=2, sheet="plate_mm", width=9),
        Column("paint_m", "mm", decimals=2, sheet="paint_mm", width=9),
        Column("inside_radius_m", "m", decimals=5, heading="strap_inside_radius_m",
               sheet="strap_inside_radius_m"),
    ),
    rows=lambda record: record["strapping"]["courses"],
)  # fmt: skip


def straps_of(record):
    """Return `STRAPS` with the headings for the tank; a horizontal tank has rings."""
    return _adapt_headings(STRAPS, record)


def strapped_courses_of(record):
    """Return `STRAPPED_COURSES` with the headings for the tank."""
    return _adapt_headings(STRAPPED_COURSES, record)


def _adapt_headings(table, record):
    if record["job"]["tank"]["kind"] != "horizontal":
        return table
    return table.but(
        course={"heading": "ring", "sheet": "ring", "csv": "ring"},
        level_m={"heading": "from_a_m", "sheet": "strap_from_a_m", "csv": "from_a_m"},
    )


def certificates_of_tapes(tapes):
    """Return {tape or master tape: certificate or None} of saved tapes."""
    certificates = {}
    for tape in tapes:
        certificates[tape["tape"]] = tape["certificate"]
        if tape["master"]:
            certificates[tape["master"]] = tape["master_certificate"]
    return certificates
