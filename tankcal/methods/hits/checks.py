"""Checks of bare wall hits as a whole: set-ups, instruments, angles, other measurements."""

import numpy as np

from tankcal.job.checking import has_rows, refuse_repeated, tell_missing
from tankcal.job.checks.extent import has_survey, tells_by_tape
from tankcal.job.checks.survey.files import SurveyFiles, refuse_undefined
from tankcal.job.checks.survey.instruments import check_correction
from tankcal.job.checks.survey.readings import check_angle, warn_copies
from tankcal.job.checks.tapes import refuse_others, tapes_of
from tankcal.job.contract.registers import FREE
from tankcal.messages import message
from tankcal.survey.wall_hits import FEWEST_HITS, MOST_HITS, too_many_hits

RANGES = ("slope_distances", "distances")  # tables by which a network determines an offset
RANGE_NOTHING = ("plummet", "stadia", "level")  # kinds of instruments without a distance


def check_hits(values, tables, registers, raw, log, *, undeclared_offset=None):
    """Check hits, their set-ups and the accuracy of the instruments; as for `Method.check`.

    undeclared_offset : Message, optional
        Message about an offset that is neither declared nor determined by a network, for tanks
        where neither a tape nor the other side of the wall determines it; None: these may do so.
    """
    hits, control = tables["wall_hits"], tables["control_readings"]
    if not has_rows(hits):
        if has_rows(control):
            expected = message("no_hits", "without effect: the job has no wall hits")
            log.warning(control.file, expected)
        return
    if len(hits.rows) > MOST_HITS:
        log.problem(hits.file, too_many_hits(len(hits.rows)))
        return
    count = sum(use != "check" for use in hits.of("use"))
    if count < FEWEST_HITS and not hits.skipped:
        expected = message(
            "too_few_hits",
            "{count} hits that are not only compared; expected at least {fewest} on each course",
            count=count,
            fewest=FEWEST_HITS,
        )
        log.problem(hits.file, expected)
    if has_rows(tables["points"]):
        expected = message(
            "beside_hits",
            "given together with wall hits; expected only one of them: tankcal does not join"
            " them yet",
        )
        log.problem(tables["points"].file, expected)
    if has_rows(tables["targets"]) and not has_survey(tables):
        expected = message(
            "targets_without_network",
            "given together with wall hits, but nothing observes these targets; expected"
            " directions and distances to them (directions.csv, slope_distances.csv)",
        )
        log.problem(tables["targets"].file, expected)
    reported = frozenset((problem.file, problem.row) for problem in log.problems)
    files = SurveyFiles(values, tables, registers, raw, log, reported)
    for table in (hits, control):
        if has_rows(table):
            _check_readings(files, table, is_needed=table is hits)
    courses = tables["courses"]
    if courses is not None:
        refuse_others(hits, "course", tuple(courses.of("course")), log)
    if has_rows(tables["setups"]) and not has_survey(tables):
        refuse_repeated(tables["setups"], "setup", log)
        refuse_undefined(
            files, tables["setups"], "instrument", registers["instruments"], "instruments"
        )
    _check_instruments(files, hits, undeclared_offset)


def _check_readings(files, table, *, is_needed):
    setups = files.tables["setups"]
    defined = () if setups is None else dict.fromkeys(setups.of("setup"))
    refuse_undefined(files, table, "setup", defined, "setups")
    for angle in ("direction", "zenith"):
        check_angle(files, table, angle, is_needed=is_needed)
    warn_copies(files, table, are_sights=True)


def _check_instruments(files, hits, undeclared_offset):
    tables, log, raw = files.tables, files.log, files.raw
    setups, ranging = tables["setups"], ranging_of(files.registers)
    if setups is None or raw.registers.get("instruments", 0) is None:
        return
    if not files.registers["instruments"]:
        tell_missing(log, raw.file_of("instruments"), setups.file, "instrument")
        return
    used = instruments_used(setups, ranging)
    file, reported = raw.file_of("instruments"), set()
    rows = dict(zip(setups.of("setup"), setups.rows, strict=True))
    for name in dict.fromkeys(hits.of("setup")):
        if name in used and used[name] not in ranging and name not in reported:
            reported.add(name)
            expected = message(
                "setup_of_no_instrument",
                "found {name!r}; expected the instrument of {file} that took the hits: a total"
                " station with s_mm, s_arcsec and u_offset_mm",
                name=used[name] or "",
                file=file,
            )
            log.problem(setups.file, expected, rows[name], "instrument")
    places = {}
    for place, name in enumerate(hits.of("setup")):
        if used.get(name) in ranging:
            places.setdefault(used[name], []).append(place)
    for name, hits_of_instrument in places.items():
        places_of_hits = np.array(hits_of_instrument)
        _check_instrument(files, hits, name, ranging[name], places_of_hits, undeclared_offset)
        if not has_survey(tables):  # otherwise the check of the survey includes all instruments
            check_correction(files, name, ranging[name])


def _check_instrument(files, hits, name, given, places, undeclared_offset):
    for key in ("s_mm", "s_arcsec"):
        blank = np.isnan(hits.numbers(key)[places])
        if given[key] is None and blank.any():
            expected = message(
                "sd_of_hits_missing",
                "missing; expected it here, or in each row of wall_hits.csv",
            )
            files.tell_key(files.log.problem, "instruments", name, key, expected)
    if given["u_scale_ppm"] == FREE and not _told_by_network(files, name):
        expected = message(
            "scale_of_hits_free",
            "found free; expected its standard uncertainty: no distance of a network tells it",
        )
        files.tell_key(files.log.problem, "instruments", name, "u_scale_ppm", expected)
    offset = given["u_offset_mm"]
    is_known = offset is not None and (offset != FREE or _told_by_network(files, name))
    is_determined = undeclared_offset is None and (
        tells_by_tape(files.tables)
        or len(set(hits.of("setup"))) > 1  # perhaps from both sides
        or files.is_unreadable("circumferences")
    )
    if not is_known and not is_determined:
        expected = undeclared_offset or offset_unknown()
        files.tell_key(files.log.problem, "instruments", name, "u_offset_mm", expected)


def offset_unknown():
    """Message about an offset that is neither given nor determined by the job."""
    return message(
        "offset_of_hits_unknown",
        "not given; expected the standard uncertainty of the offset without reflector, a"
        " circumference by tape, or hits from both sides of the wall: an offset goes wholly into"
        " every radius, and nothing in the job tells it",
    )


def _told_by_network(files, name):
    """Return True if distances of a network determine scale and offset of the instrument."""
    setups, distances = files.tables["setups"], files.tables["distances"]
    slopes = files.tables["slope_distances"]
    used = instruments_used(setups, ranging_of(files.registers))
    by_setup = has_rows(slopes) and any(used.get(setup) == name for setup in slopes.of("setup"))
    return by_setup or (has_rows(distances) and name in distances.of("instrument"))


def ranging_of(registers):
    """{name: {key: value}} of the instruments that measure distances, except tapes."""
    instruments, tapes = registers["instruments"], tapes_of(registers)
    return {
        name: given
        for name, given in instruments.items()
        if name not in tapes and (given["kind"] or "").strip().lower() not in RANGE_NOTHING
    }


def instruments_used(setups, ranging):
    """{set-up: name of its instrument}; a blank means the only instrument, None if several."""
    only = next(iter(ranging)) if len(ranging) == 1 else None
    pairs = zip(setups.of("setup"), setups.of("instrument"), strict=True)
    return {setup: name or only for setup, name in pairs}
