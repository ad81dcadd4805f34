"""Bare wall hits: checks of set-ups, instruments and angles, and `WallHits` in SI."""

from dataclasses import replace

import numpy as np

from tankcal.job.checking import has_rows, refuse_repeated, tell_missing
from tankcal.job.checks.extent import has_survey, tells_by_tape
from tankcal.job.checks.survey.readings import (
    SurveyFiles,
    check_angle,
    check_correction,
    refuse_undefined,
    warn_copies,
)
from tankcal.job.checks.tapes import refuse_others, tapes_of
from tankcal.job.contract.registers import FREE, USUAL_INCIDENCE_MM
from tankcal.job.structure import angle_in_rad
from tankcal.messages import message
from tankcal.survey.wall_hits import (
    FEWEST_HITS,
    MOST_HITS,
    ControlReading,
    RangingInstrument,
    WallHits,
    too_many_hits,
)
from tankcal.units import ARCSEC

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
    if given["u_scale_ppm"] == FREE and not _is_calibrated_by_network(files, name):
        expected = message(
            "scale_of_hits_free",
            "found free; expected its standard uncertainty: no distance of a network tells it",
        )
        files.tell_key(files.log.problem, "instruments", name, "u_scale_ppm", expected)
    offset = given["u_offset_mm"]
    is_known = offset is not None and (offset != FREE or _is_calibrated_by_network(files, name))
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


def _is_calibrated_by_network(files, name):
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


AXES = "xyz"
CLOSE_M, ROUNDS = 1e-12, 20  # convergence limit and largest number of iterations
MILLIMETRES = 3  # decimals to which heights of hits are rounded to form levels


def make_hits(tables, registers):
    """Build `WallHits` from tables and registers without problems."""
    table, setups = tables["wall_hits"], _setups(tables["setups"], registers)
    names = tuple(table.of("setup"))
    used = dict.fromkeys(setups[name].instrument for name in names)
    ranging = ranging_of(registers)
    instruments = [ranging[setups[name].instrument] for name in names]
    # The sd of the row takes precedence over the sd of the instrument.
    sd_mm, sd_arcsec = (
        np.where(
            np.isnan(table.numbers(key)),
            [entry[key] or 0.0 for entry in instruments],
            table.numbers(key),
        )
        for key in ("s_mm", "s_arcsec")
    )
    return WallHits(
        setup=names,
        set=tuple(table.of("set")),
        course=tuple(table.of("course")),
        direction_rad=angle_in_rad(table, "direction"),
        zenith_rad=angle_in_rad(table, "zenith"),
        distance_m=table.numbers("distance_m"),
        sd_m=sd_mm / 1000,
        sd_rad=sd_arcsec * ARCSEC,
        surface=tuple(entry or "" for entry in table.of("surface")),
        check=np.array([use == "check" for use in table.of("use")], dtype=bool),
        setups=setups,
        instruments={name: _instrument(name, ranging[name]) for name in used},
        stations=_stations(tables["control"]),
        control=_control(tables["control_readings"]),
        rows=table.rows,
        file=table.file,
    )


def _setups(table, registers):
    from tankcal.job.measuring import setups_of  # not loaded for a job without a survey

    used = instruments_used(table, ranging_of(registers))
    return {setup.name: replace(setup, instrument=used[setup.name]) for setup in setups_of(table)}


def _instrument(name, given):
    offset, scale, bias = (given[key] for key in ("u_offset_mm", "u_scale_ppm", "u_incidence_mm"))
    return RangingInstrument(
        name,
        correction=given["correction"] or 0.0,
        correction_m=(given["correction_mm"] or 0.0) / 1000,
        u_scale=np.nan if scale == FREE else (scale or 0.0) / 1e6,
        u_offset_m=np.nan if offset in (None, FREE) else offset / 1000,
        u_incidence_m=(USUAL_INCIDENCE_MM if bias is None else bias) / 1000,
        certificate=given["certificate"] or "",
    )


def _stations(table):
    if table is None:
        return {}
    xyz = np.column_stack([table.numbers(f"{axis}_m") for axis in AXES])
    return dict(zip(table.of("point"), xyz, strict=True))


def _control(table):
    if table is None:
        return ()
    angles = (angle_in_rad(table, name) for name in ("direction", "zenith"))
    columns = zip(table.of("setup"), table.of("target"), *angles, table.numbers("distance_m"),
                  table.numbers("time"), table.rows, strict=True)  # fmt: skip
    return tuple(ControlReading(*row) for row in columns)


# ---- hits of a known wall: sights along planned rays, with the inverse of their corrections


def _stations_of_hits(hits):
    """Instrument positions (n, 3) of the hits."""
    places = {
        name: hits.stations.get(setup.station, np.zeros(3)) + [0.0, 0.0, setup.height_m]
        for name, setup in hits.setups.items()
    }
    return np.array([places[name] for name in hits.setup])


def levels_of_hits(job):
    """Return (course, level above the table's zero, m) of each hit as aimed."""
    hits, datum = job.hits, job.datum
    rise = hits.distance_m * np.cos(hits.zenith_rad)
    z = _stations_of_hits(hits)[:, 2] + rise - datum.bottom_z_m - datum.plate_level_m
    return list(zip(hits.course, np.round(z, MILLIMETRES).tolist(), strict=True))


def observe_hits(job, wall, errors):
    """Return hits along their own sights, up to the inside or outside of the wall."""
    from tankcal.survey.wall_hits import bias_by_incidence, rays

    hits, levels = job.hits, levels_of_hits(job)
    station, ray = _stations_of_hits(hits)[:, :2], rays(hits.direction_rad, hits.zenith_rad)[0]
    inside, ray = np.hypot(*station.T) < wall.nominal_m, ray[:, :2]
    distance, cosine = np.empty(len(hits)), np.empty(len(hits))
    kinds = list(zip(levels, inside.tolist(), strict=True))
    for level, within in dict.fromkeys(kinds):
        of_kind = np.array([kind == (level, within) for kind in kinds])
        distance[of_kind], cosine[of_kind] = _intersect(
            wall, station[of_kind], ray[of_kind], level, inside=within
        )
    # Distances with their common errors, then the inverse of the corrections by the certificate.
    known = [hits.instruments[name] for name in hits.instrument]
    bias = [errors.draw_cause("incidence", tool.name) * tool.u_incidence_m for tool in known]
    distance *= 1 + np.array([errors.scale(tool) for tool in known])
    distance += np.array([errors.offset_m(tool) for tool in known])
    distance += np.array(bias) * bias_by_incidence(cosine)
    distance /= 1 + np.array([tool.correction for tool in known])
    distance -= np.array([tool.correction_m for tool in known])
    return replace(
        hits,
        distance_m=distance + errors.draw(hits.sd_m),
        direction_rad=hits.direction_rad + errors.draw(hits.sd_rad),
        zenith_rad=hits.zenith_rad + errors.draw(hits.sd_rad),
    )


def _intersect(wall, station_m, ray, level, *, inside):
    """Distance along horizontal rays (n, 2) to a level of the wall, and cosine of incidence."""
    # First the circle of nominal radius: |station + far ray|^2 = R^2, a quadratic in far.
    square, along = np.sum(ray**2, axis=1), np.sum(station_m * ray, axis=1)
    beyond = along**2 - square * (np.sum(station_m**2, axis=1) - wall.nominal_m**2)
    root = np.sqrt(np.maximum(beyond, 0.0))
    far = (-along + (root if inside else -root)) / square
    # Then Newton: the distance from the axis changes by the slope (cosine of incidence) per metre.
    for _ in range(ROUNDS):
        x, y = (station_m + far[:, None] * ray).T
        away = np.hypot(x, y)
        slope = (x * ray[:, 0] + y * ray[:, 1]) / away
        short = wall.radius_m(*level, np.arctan2(x, y), inside=inside) - away
        far = far + short / slope
        if np.abs(short).max() < CLOSE_M:
            break
    return far, np.abs(slope)
