"""Summary of an import: contents, applied corrections, and records left out."""

from tankcal.errors import Problem
from tankcal.fieldbooks.detection import NAMES
from tankcal.fieldbooks.faces import LARGE_DEG, LARGE_M
from tankcal.messages import list_some, message
from tankcal.survey.wall_hits import MOST_HITS
from tankcal.units import ARCSEC_PER_DEG

SHOWN = 8
APPLIED_BY_INSTRUMENT = ("gsi", "sdr")  # formats with distances that include the prism constant


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
    lines.append(message("import_setups", "set-ups: {names}", names=list_some(shown, SHOWN)))
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
                names=list_some(list(stations), SHOWN) or ["-"],
            )
        )
    for what, shots in unused.items():
        lines.append(
            message(
                "import_not_used",
                "not used: {what}: {count} ({names})",
                what=what,
                count=len(shots),
                names=list_some(list(dict.fromkeys(shot.point or "?" for shot in shots)), SHOWN),
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
                          count=len(readings), names=list_some(points, SHOWN))  # fmt: skip
        elif points:
            yield message("import_ties", "readings of targets that tie set-ups: {count} ({names})",
                          count=len(readings), names=list_some(points, SHOWN))  # fmt: skip


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
