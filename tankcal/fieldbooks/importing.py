"""Import of instrument files into the tables of a job."""

import datetime
from collections import Counter
from dataclasses import dataclass, field, replace
from pathlib import Path

from tankcal.errors import Problem
from tankcal.fieldbooks.book import MOST_M, NO_YEAR
from tankcal.fieldbooks.detection import MAX_BYTES, read_book
from tankcal.fieldbooks.faces import reduce_faces
from tankcal.fieldbooks.gsi import Custom
from tankcal.fieldbooks.profile import read_profile
from tankcal.fieldbooks.rows import check_rows, make_rows, sort_readings
from tankcal.fieldbooks.summary import collect_warnings, summarise
from tankcal.fieldbooks.writing import write_tables
from tankcal.job.tables import Log, read_bytes
from tankcal.messages import list_some, message

SAME_M = 0.001  # tolerance of repeated coordinates of one point
SHOWN = 6


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
