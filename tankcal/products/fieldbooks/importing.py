"""Import of instrument files into the tables of a job.

The summary of an import lists contents, applied corrections, and records left out.
"""

import datetime
from collections import Counter
from dataclasses import dataclass, field, replace
from pathlib import Path

from tankcal.errors import Problem
from tankcal.job.tables import Log, read_bytes
from tankcal.messages import list_some, message
from tankcal.products.fieldbooks.book import MOST_M, NO_YEAR
from tankcal.products.fieldbooks.detection import MAX_BYTES, NAMES, read_book
from tankcal.products.fieldbooks.gsi import Custom
from tankcal.products.fieldbooks.profile import read_profile
from tankcal.products.fieldbooks.rows import (
    LARGE_DEG,
    LARGE_M,
    check_rows,
    make_rows,
    reduce_faces,
    sort_readings,
    write_tables,
)
from tankcal.survey.wall_hits import MOST_HITS
from tankcal.units import ARCSEC_PER_DEG

SAME_M = 0.001  # tolerance of repeated coordinates of one point
SHOWN = 6
LISTED_NAMES = 8
APPLIED_BY_INSTRUMENT = ("gsi", "sdr")  # formats with distances that include the prism constant


@dataclass(frozen=True)
class Choices:
    """Options of an import.

    Attributes
    ----------
    hits, control, leave, check : tuple of str
        Patterns of names or codes: reflectorless readings of the wall, control targets, readings to
        leave out, and hits for comparison only. Without `hits`: names and codes that begin with
        WALL, HIT, PAREDE or PARED.
    no_hits : bool
        The files contain targets only.
    format : str or None
        One of "gsi", "rw5", "jxl", "sdr", "csv". None: determined from the content.
    profile : str or Path or None
        TOML file with the meaning of the columns of a plain table.
    instrument : str
        Name of the instrument in instruments.toml; "": blank.
    targets_mm, targets_arcsec : float or None
        Standard deviations of distances and angles to targets that tie set-ups.
    begin, end : datetime or None
        Times of the first and the last reading, for files without times.
    no_control : bool
        Do not write known coordinates.
    codes : str or None
        GSI code blocks are codes of the following readings ("before") or of the readings since the
        previous block ("after"). None: code blocks are reported and not used.
    station_code : str or None
        Code of the blocks that begin a station in a GSI file.
    """

    hits: tuple = ()
    control: tuple = ()
    leave: tuple = ()
    check: tuple = ()
    no_hits: bool = False
    format: str | None = None
    profile: object = None
    instrument: str = ""
    targets_mm: float | None = None
    targets_arcsec: float | None = None
    begin: datetime.datetime | None = None
    end: datetime.datetime | None = None
    no_control: bool = False
    codes: str | None = None
    station_code: str | None = None


@dataclass
class Imported:
    """Result of an import.

    Attributes
    ----------
    summary : list of str
        Lines with set-ups, hits, targets, units, applied corrections and records left out.
    warnings : list of Problem
    paths : list of Path
        Written files.
    """

    summary: list = field(default_factory=list)
    warnings: list = field(default_factory=list)
    paths: list = field(default_factory=list)


def import_fieldbooks(files, folder, choices=Choices(), *, replace_tables=False):
    """Read field books of instruments and write them as tables of a job.

    Parameters
    ----------
    files : sequence of str or Path
        Field books in the order of measurement.
    folder : str or Path
        Folder of the job; created if missing.
    choices : Choices
    replace_tables : bool
        Whether tables that already contain rows are replaced.

    Returns
    -------
    Imported

    Raises
    ------
    InputError
        With all problems of all files; no file is written then.

    Examples
    --------
    >>> from tempfile import TemporaryDirectory
    >>> with TemporaryDirectory() as folder:
    ...     result = import_fieldbooks(["examples/wall-hits/field-book.gsi"], folder)
    >>> [path.name for path in result.paths]
    ['setups.csv', 'wall_hits.csv', 'control_readings.csv', 'control.csv']
    >>> print(result.summary[4])
    hits of the wall: 200
    """
    log, result = Log(), Imported()
    _check_times(choices, log)
    books = _read_all(files, choices, log)
    log.stop_if_problems()
    all_setups, shots = _join_books(books)
    shots = _complete_times(shots, choices)
    readings, reports = reduce_faces(shots, log)
    log.stop_if_problems()
    names = _name_setups(all_setups, sorted({shot.setup for shot in shots}))
    # Set-ups with readings; a set-up without a station stands for its own station.
    setups = {}
    for place, name in names.items():
        setup, file = all_setups[place]
        setups[place] = replace(setup, station=setup.station or name), file
    known = _collect_coordinates(books, setups, log)
    unused = {}
    chosen = sort_readings(
        readings, choices, {*known, *(setup.station for setup, _ in setups.values())}, log,
        lambda what, reading: unused.setdefault(what, []).append(reading.shot),
    )  # fmt: skip
    _leave_out_empty_setups(books)
    chosen = _keep_timed_control(chosen, choices, unused, log)
    _check_ties(chosen, choices, log)
    log.stop_if_problems()
    stations = {} if choices.no_control else _stations(known, setups, chosen, log)
    used = {reading.shot.setup for reading in (*chosen.hits, *chosen.control, *chosen.ties)}
    names = {place: name for place, name in names.items() if place in used}
    tables = make_rows(setups, names, stations, chosen, choices)
    check_rows(tables, log)
    if not tables.keys() - {"setups", "control"} and not log.problems:
        text = message("nothing_read", "no usable reading; expected readings of hits or targets")
        log.problem(Path(files[0]).name, text)
    log.stop_if_problems()
    result.paths, filled_tables = write_tables(folder, tables, replace=replace_tables)
    result.summary = summarise(books, chosen, unused, names, setups, reports, (known, stations),
                              filled_tables)  # fmt: skip
    result.warnings = [
        *_code_option_warnings(choices, books),
        *collect_warnings(chosen, names, setups, reports),
    ]
    return result


def _code_option_warnings(choices, books):
    """Yield warnings about options for code blocks if no file is GSI."""
    if any(book.format == "gsi" for book in books):
        return
    options = (("--codes", choices.codes), ("--station-code", choices.station_code))
    for option, value in options:
        if value is not None:
            text = message(
                "option_of_gsi",
                "without effect: none of the files is GSI, and other formats state to which "
                "readings a code belongs",
            )
            yield Problem(option, text)


def _check_times(choices, log):
    """Report an end that is not later than the beginning."""
    begin, end = choices.begin, choices.end
    if end is not None and (begin is None or end <= begin):
        log.problem("--end", message("end_before_begin", "expected a time later than --begin"))


def _read_all(files, choices, log):
    """Return the FieldBooks of all files."""
    described = None
    if choices.profile is not None:
        described = read_profile(Path(choices.profile), log)
        if described is None:
            return []
    books, seen = [], {}
    custom = Custom(choices.codes, choices.station_code)
    for path in map(Path, files):
        data = read_bytes(path, log, MAX_BYTES)
        if data is not None and data in seen:
            text = message("file_twice", "identical to {other}; expected each file once",
                           other=seen[data])  # fmt: skip
            log.problem(path.name, text)
            continue
        seen[data] = path.name
        book = None if data is None else read_book(path.name, data, log, choices.format, described,
                                                   custom)  # fmt: skip
        if book is not None:
            books.append(book)
    return books


def _join_books(books):
    """Return ([(SetUp, file)], shots) of all books, with consecutive indices of set-ups."""
    setups, shots = [], []
    for book in books:
        shots += [replace(shot, setup=shot.setup + len(setups)) for shot in book.shots]
        setups += [(setup, book.file) for setup in book.setups]
    return setups, shots


def _leave_out_empty_setups(books):
    """Count set-ups without readings as left out."""
    for book in books:
        used = {shot.setup for shot in book.shots}
        for place, setup in enumerate(book.setups):
            if place not in used:
                what = message("setups_without_readings", "set-ups without readings")
                book.leave_out(what, setup.row)


def _name_setups(setups, places):
    """Return {index: name}: the station, or S1, S2, ...; a repeated station gets -2."""
    named = {setups[place][0].station for place in places} - {""}
    free = (f"S{number}" for number in range(1, len(places) + len(named) + 2))
    free = (candidate for candidate in free if candidate not in named)
    setup_names, counts = {}, Counter()
    for place in places:
        name = setups[place][0].station or next(free)
        counts[name] += 1
        while counts[name] > 1 and f"{name}-{counts[name]}" in (*named, *setup_names.values()):
            counts[name] += 1
        setup_names[place] = name if counts[name] == 1 else f"{name}-{counts[name]}"
    return setup_names


def _collect_coordinates(books, setups, log):
    """Return {name: list of (xyz, file, row)} of all coordinates in the files."""
    items = [
        (setup.station, setup.xyz_m, file, setup.row)
        for setup, file in setups.values()
        if setup.xyz_m is not None
    ]
    items += [
        (point.point, point.xyz_m, book.file, point.row) for book in books for point in book.known
    ]
    coordinates = {}
    for point, xyz, file, row in items:
        if any(abs(coordinate) > MOST_M for coordinate in xyz if coordinate is not None):
            text = message("coordinate_too_large", "coordinates of {point!r} beyond {most:g} m",
                           point=point[:40], most=MOST_M)  # fmt: skip
            log.problem(file, text, row)
        else:
            coordinates.setdefault(point, []).append((xyz, file, row))
    return coordinates


def _complete_times(shots, choices):
    """Return shots with complete times.

    The year comes from `begin`. If begin and end are given, shots without a time get times evenly
    spaced between both.
    """
    begin, end = choices.begin, choices.end
    dated = []
    for shot in shots:
        time = shot.time
        if time is not None and time.year == NO_YEAR:
            time = None if begin is None else _set_year(time, begin.year)
        dated.append(replace(shot, time=time))
    if begin is None or end is None or len(dated) < 2:
        return dated
    step = (end - begin) / (len(dated) - 1)
    return [
        replace(shot, time=(begin + place * step).replace(microsecond=0)) if shot.time is None
        else shot
        for place, shot in enumerate(dated)
    ]  # fmt: skip


def _set_year(time, year):
    """Return the same day in another year; None for 29 February in other years."""
    try:
        return time.replace(year=year)
    except ValueError:
        return None


def _keep_timed_control(chosen, choices, unused, log):
    """Remove control readings without a time; report them if the user selected them."""
    without = [reading.shot for reading in chosen.control if reading.shot.time is None]
    if choices.control:
        for shot in without:
            text = message(
                "control_without_time",
                "control target {point!r} has no time in the file; expected --begin and --end "
                "(for a GSI file without a year --begin), or --leave for the target",
                point=shot.point[:40],
            )
            log.problem(shot.file, text, shot.row)
    elif without:
        what = message(
            "again_without_time",
            "targets with repeated readings but without a time in the file; with --begin and "
            "--end they are written to control_readings.csv",
        )
        unused[what] = without
    kept = tuple(reading for reading in chosen.control if reading.shot.time is not None)
    return replace(chosen, control=kept)


def _check_ties(chosen, choices, log):
    """Report missing standard deviations of readings to targets that tie set-ups."""
    if not chosen.ties:
        return
    for key, value in (("--targets-mm", choices.targets_mm),
                       ("--targets-arcsec", choices.targets_arcsec)):  # fmt: skip
        if value is None:
            points = list(dict.fromkeys(reading.shot.point for reading in chosen.ties))
            text = message(
                "ties_without_sd",
                "targets {points} tie set-ups; expected the standard deviation of readings to "
                "targets, which instrument files do not contain",
                points=list_some(points, SHOWN),
            )
            log.problem(key, text)


def _stations(known, setups, chosen, log):
    """Return {point: (xyz, file, row)} of the stations and of the targets that tie set-ups."""
    used = [setup.station for setup, _ in setups.values()] + [
        reading.shot.point for reading in chosen.ties
    ]
    stations, reported = {}, set()
    for point in dict.fromkeys(used):
        for xyz, file, row in known.get(point, ()):
            before = stations.setdefault(point, (xyz, file, row))
            pairs = [(a, b) for a, b in zip(before[0], xyz, strict=True) if None not in (a, b)]
            if any(abs(a - b) > SAME_M for a, b in pairs) and (point, xyz) not in reported:
                reported.add((point, xyz))
                text = message(
                    "imported_known_twice",
                    "point {point!r} has different coordinates in row {row} of {file}; expected "
                    "one position of each known point: rename one of two different points, delete "
                    "the invalid coordinates, or leave all out with --no-control",
                    point=point[:40],
                    row=str(before[2]),
                    file=before[1],
                )
                log.problem(file, text, row)
    return stations


def summarise(books, chosen, unused, names, setups, reports, coordinates, filled_tables):
    """Return the lines of the summary.

    Parameters
    ----------
    books : list of FieldBook
    chosen : SortedReadings
    unused : dict
        {reason: shots}
    names : dict
        {index: name of the set-up}
    setups : dict
        {index: (SetUp, file)}
    reports : list of FaceReport
    coordinates : tuple of dict
        Known points, and the points written to control.csv.
    filled_tables : list of str
        Other tables of the folder that contain rows.
    """
    lines = []
    for book in books:
        lines += _describe_book(book)
    shown = []
    for place, name in names.items():
        station = setups[place][0].station
        shown.append(name if name == station else f"{name} ({station})")
    lines.append(message("import_setups", "set-ups: {names}", names=list_some(shown, LISTED_NAMES)))
    reports = [report for report in reports if report.setup in names]
    for report in reports:
        lines += _describe_faces(names[report.setup], report)
    lines.append(message("import_hits", "hits of the wall: {count}", count=len(chosen.hits)))
    lines += _describe_targets(chosen)
    known, stations = coordinates
    if known:
        lines.append(
            message(
                "import_known",
                "points with coordinates: {count}; written to control.csv, without standard "
                "deviations: {names}",
                count=len(known),
                names=list_some(list(stations), LISTED_NAMES) or ["-"],
            )
        )
    for what, shots in unused.items():
        lines.append(
            message(
                "import_not_used",
                "not used: {what}: {count} ({names})",
                what=what,
                count=len(shots),
                names=list_some(
                    list(dict.fromkeys(shot.point or "?" for shot in shots)), LISTED_NAMES
                ),
            )
        )
    if filled_tables:
        tables = [f"{table}.csv" for table in filled_tables]
        lines.append(
            message(
                "import_standing",
                "{tables}: unchanged, the files contain no data for them",
                tables=tables,
            )
        )
    return lines


def _describe_book(book):
    """Yield the lines about a file."""
    source = [NAMES[book.format], *([book.instrument] if book.instrument else [])]
    yield message("import_file", "{file}: {made}; {units}", file=book.file, made=source,
                  units=book.units or ["-"])  # fmt: skip
    if book.format in APPLIED_BY_INSTRUMENT and book.shots:
        constants = sorted({shot.prism_mm for shot in book.shots if shot.prism_mm is not None})
        yield message(
            "import_applied",
            "{file}: distances as written by the instrument, including its prism constant "
            "({constants}) and ppm: no correction is applied again",
            file=book.file,
            constants=[f"{constant:+g} mm" for constant in constants] or ["-"],
        )
    for note in book.notes:
        yield message("import_note", "{file}: {note}", file=book.file, note=note)
    for counts, is_rejected in ((book.rejected, True), (book.left_out, False)):
        for what, (count, row) in counts.items():
            values = {"file": book.file, "what": what, "count": count, "row": str(row)}
            if is_rejected:
                yield message("import_rejected", "{file}: {what}, not used: {count}, the first in"
                              " row {row}", **values)  # fmt: skip
            else:
                yield message(
                    "import_left_out",
                    "{file}: not recognised and left out: {what}: {count}, the first in row {row}",
                    **values,
                )


def _describe_faces(setup, report):
    """Yield the lines about the faces of a set-up."""
    yield message(
        "import_faces",
        "set-up {setup}: {pairs} points on both faces (averaged), {first} on face 1 only, "
        "{second} on face 2 only",
        setup=setup,
        pairs=report.pairs,
        first=report.single[0],
        second=report.single[1],
    )
    if report.collimation is not None and report.index is not None:
        yield message(
            "import_collimation",
            "set-up {setup}: collimation {c_arcsec:+.1f} arcsec (largest deviation "
            "{c_spread:.1f}), index error {i_arcsec:+.1f} arcsec (largest deviation "
            "{i_spread:.1f}), distances of the two faces within {apart_mm:.1f} mm",
            setup=setup,
            c_arcsec=ARCSEC_PER_DEG * report.collimation[0],
            c_spread=ARCSEC_PER_DEG * report.collimation[1],
            i_arcsec=ARCSEC_PER_DEG * report.index[0],
            i_spread=ARCSEC_PER_DEG * report.index[1],
            apart_mm=1000 * report.apart_m,
        )
    if sum(report.single) and (report.collimation or report.index):
        yield message(
            "import_freed",
            "set-up {setup}: {count} readings on one face corrected by the mean collimation and "
            "index errors of the pairs",
            setup=setup,
            count=sum(report.single),
        )


def _describe_targets(chosen):
    """Yield the lines about targets."""
    for readings, is_control in ((chosen.control, True), (chosen.ties, False)):
        points = list(dict.fromkeys(reading.shot.point for reading in readings))
        if points and is_control:
            yield message("import_control", "readings of control targets: {count} ({names})",
                          count=len(readings), names=list_some(points, LISTED_NAMES))  # fmt: skip
        elif points:
            yield message("import_ties", "readings of targets that tie set-ups: {count} ({names})",
                          count=len(readings), names=list_some(points, LISTED_NAMES))  # fmt: skip


def collect_warnings(chosen, names, setups, reports):
    """Return warnings about readings that may need correction."""
    problems = []
    for place, name in names.items():
        setup, file = setups[place]
        if not setup.is_recorded and setup.height_m is not None:
            text = message(
                "station_of_readings",
                "set-up {setup}: the file has no station record, only an instrument height; the "
                "station is named by the readings or unknown, and a second station without a "
                "record is not detected; check setups.csv",
                setup=name,
            )
            problems.append(Problem(file, text, setup.row))
        elif not setup.is_recorded:
            text = message(
                "no_station",
                "set-up {setup}: the file has no station, so the station name and the instrument "
                "height are unknown; enter them in setups.csv before you run the job",
                setup=name,
            )
            problems.append(Problem(file, text, setup.row))
        elif setup.height_m is None:
            text = message(
                "no_instrument_height",
                "set-up {setup}: the file has no instrument height; it is left blank (0)",
                setup=name,
            )
            problems.append(Problem(file, text, setup.row))
    for report in (report for report in reports if report.setup in names):
        name, file = names[report.setup], setups[report.setup][1]
        for what in (report.collimation, report.index):
            if what is not None and max(abs(what[0]), what[1]) > LARGE_DEG:
                text = message(
                    "instrument_to_adjust",
                    "set-up {setup}: the two faces differ by an error of {size:.0f} arcsec, above "
                    "the limit of {limit:.0f} (is the instrument adjusted?); readings on one face "
                    "are corrected by the mean error only",
                    setup=name,
                    size=ARCSEC_PER_DEG * max(abs(what[0]), what[1]),
                    limit=ARCSEC_PER_DEG * LARGE_DEG,
                )
                problems.append(Problem(file, text))
                break
        if report.apart_m > LARGE_M:
            text = message(
                "distances_apart",
                "set-up {setup}: distances of the two faces differ by {apart_mm:.1f} mm, above the "
                "limit of {limit_mm:.0f}",
                setup=name,
                apart_mm=1000 * report.apart_m,
                limit_mm=1000 * LARGE_M,
            )
            problems.append(Problem(file, text))
    if len(chosen.hits) > MOST_HITS:
        shot = chosen.hits[0].shot
        text = message(
            "more_hits_than_a_job_takes",
            "{count} hits, but a job allows at most {most}; leave some out with --leave",
            count=len(chosen.hits),
            most=MOST_HITS,
        )
        problems.append(Problem(shot.file, text, shot.row))
    problems += _check_constants(chosen)
    if chosen.ties:
        text = message(
            "frame_not_held",
            "targets tie set-ups, but no file has standard deviations of coordinates; enter the "
            "standard deviations of known points here, or set [adjustment] datum = 'minimal' in "
            "job.toml",
        )
        problems.append(Problem("control.csv", text))
    return problems


def _check_constants(chosen):
    """Yield warnings about hits with an unlikely prism constant."""
    hits = {reading.shot.prism_mm for reading in chosen.hits} - {None}
    targets = {reading.shot.prism_mm for reading in (*chosen.control, *chosen.ties)} - {None}
    first = chosen.hits[0].shot if chosen.hits else None
    if len(hits) > 1:
        text = message("several_constants", "hits with several prism constants: {constants} mm",
                       constants=[f"{constant:+g}" for constant in sorted(hits)])  # fmt: skip
        yield Problem(first.file, text, first.row)
    elif hits - {0.0} and hits == targets:
        text = message(
            "constant_of_prism",
            "hits without reflector have the prism constant of the targets, {constant:+g} mm "
            "(was the instrument set to reflectorless measurement?)",
            constant=next(iter(hits)),
        )
        yield Problem(first.file, text, first.row)
