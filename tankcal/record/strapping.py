"""The part of the record that says what a tape measured: readings, their corrections, tapes."""

import numpy as np

from tankcal.record.schema import Finite, Saved, key
from tankcal.record.survey import radius_sd, surveyed_shell
from tankcal.units import FULL_TURN


class StrapReading(Saved):
    """A reading of a tape round the tank, and the circumference that it gives."""

    circumference: str = key("name; repeats share it")
    course: str = key("that it is on")
    level_m: float = key("above the table's zero")
    tape: str = key("name")
    reading_m: float = key("as read")
    certificate_m: float = key("correction by the certificate of the tape, or by its master")
    temperature_m: float = key("correction for the temperature of the tape")
    tension_m: float = key("correction for its pull")
    tape_thickness_m: float = key("correction for half the thickness of the tape")
    rise_m: float = key("correction for what keeps it off the shell")
    sag_m: float | None = key("correction for where it hangs free", optional=True)
    out_of_level_m: float = key("correction for a tape that is not level")
    circumference_m: float = key("of the painted shell, after these corrections")
    sd_m: float = key("of it, of what no other reading shares")
    difference_m: float = key("from the circumference of its course")
    w: float | None = key("departure from what all others show over its sd; null: uncontrolled")
    mdb_m: float | None = key("smallest blunder that this test finds; null: no other controls it")
    used: bool = key("false: only compared, or rejected")
    row: int | None = key("of the file")


class TapeUsed(Saved):
    """A tape, as its readings were corrected."""

    tape: str = key("name")
    certificate: str = key('its number; "": not given')
    correction: Finite = key("true = reading (1 + correction)")
    u_scale: Finite = key("standard uncertainty of its scale, relative")
    u_comparison: Finite = key("the same, by the comparison with its master; 0: none")
    master: str = key('tape that it was compared with; ""')
    master_certificate: str = key('number of its certificate; "": not given, or no master')
    comparisons: int = key("readings of both")


class StrapOfCourse(Saved):
    """What the straps of a course give."""

    course: str = key("name")
    circumference_m: float = key("mean, of the painted shell")
    area_term_m: float = key("what the area term takes off it")
    radius_m: float = key("of the circle of equal area, outside")
    radius_sd_m: float = key("its standard deviation, as the mean of the course")
    thickness_m: float = key("of the plates")
    plate_sd_m: float | None = key("standard uncertainty of that by a gauge; null: none was read")
    paint_m: float = key("thickness")
    inside_radius_m: float = key("at the temperature of the survey")


class StrappingRecord(Saved):
    """Circumferences by tape: every reading with its corrections, tapes, courses."""

    readings: list[StrapReading] = key("in the order of the file")
    tapes: list[TapeUsed] = key("those that were read")
    courses: list[StrapOfCourse] = key(
        "from the bottom up; beside former radii only those that were measured again"
    )
    shape_sd_m: float = key(
        "standard deviation of the radius round the wall: declared, by the points, or typical"
    )
    area_term: Finite = key("by how much the circle of a perimeter is too large, relative")
    area_term_sd: Finite = key("its standard deviation")
    wave_m: float | None = key("bound of how far a tape was out of level; null: not given")
    helix_m: float | None = key("bound of how far its ends stood apart; null: not given")


def strapping_of(result):
    """`StrappingRecord` of a result; None where no tape was put round."""
    straps, given = result.straps, result.job.strapping
    if straps is None:
        return None
    return StrappingRecord(
        readings=_readings(result),
        tapes=tapes_of(straps.tapes, given),
        courses=_courses(result),
        shape_sd_m=straps.shape_sd_m,
        area_term=straps.area_term.mean,
        area_term_sd=straps.area_term.sd,
        wave_m=given.wave_m,
        helix_m=given.helix_m,
    )


def _readings(result):
    straps = result.straps
    names = [part.name for part in result.job.courses or result.job.rings]
    of_course = dict(zip(names, straps.circumference_m, strict=True))
    w, mdb = np.full((2, len(straps.reduced)), np.nan)
    w[straps.adjusted], mdb[straps.adjusted] = straps.w, straps.mdb_m
    set_aside = set(straps.adjusted[~straps.accepted].tolist())
    return [
        StrapReading(
            circumference=one.strap.name,
            course=one.strap.course,
            level_m=one.strap.level_m,
            tape=one.strap.tape,
            reading_m=one.strap.reading_m,
            **{f"{step}_m": size for step, size in one.steps_m.items()},
            circumference_m=one.circumference_m,
            sd_m=one.sd_m,
            difference_m=one.circumference_m - of_course[one.strap.course],
            w=w[index],
            mdb_m=mdb[index],
            used=not one.strap.check and index not in set_aside,
            row=one.strap.row,
        )
        for index, one in enumerate(straps.reduced)
    ]


def tapes_of(tapes, given):
    """`TapeUsed` of each (Tape, sd of its scale by a master), of a `Strapping`."""
    return [_tape(*one, given) for one in tapes]


def _tape(tape, sd, given):
    certificates = {one.name: one.certificate for one in given.tapes}
    return TapeUsed(
        tape=tape.name,
        certificate=tape.certificate,
        correction=tape.correction,
        u_scale=tape.u_scale,
        u_comparison=sd,
        master=tape.master,
        master_certificate=certificates.get(tape.master, ""),
        comparisons=len(given.comparisons) if tape.master else 0,
    )


def _radius_sds(result):
    """(courses or rings,) standard deviations of the mean radii as measured."""
    if result.rings is not None:
        scale = result.body.parts[0].scale
        return result.rings.radius_sd_m(result.body.parts[0].factors) / scale
    shell = surveyed_shell(result)
    return [radius_sd(shell, course) for course in result.body.shell.volume.courses]


def _courses(result):
    """Courses, or rings; beside former radii only those that were measured again."""
    straps, found, sds = result.straps, [], _radius_sds(result)
    courses = list(enumerate(result.job.courses or result.job.rings))
    if result.radii is not None:  # what the others have is a former radius, inside: no strap's
        measured = result.radii.updated.update.measured.tolist()
        courses = [courses[index] for index in measured]
    for index, course in courses:
        radius, whole = straps.radius_m[index], straps.circumference_m[index]
        found.append(
            StrapOfCourse(
                course=course.name,
                circumference_m=whole,
                area_term_m=FULL_TURN * radius - whole,
                radius_m=radius,
                radius_sd_m=sds[index],
                thickness_m=course.thickness_m,
                plate_sd_m=straps.plate_sd_m.get(index),
                paint_m=course.paint_m,
                inside_radius_m=radius - course.thickness_m - course.paint_m,
            )
        )
    return found
