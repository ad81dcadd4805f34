"""History of the tables of one tank: its input, and its changes on one basis.

Every table is compared with the newest one (`recalibration.comparison.compare`), which brings it
to the newest basis. Each table is also compared with the one before it, which shows the changes
between them. All results are results of these comparisons.
"""

import hashlib
import json
import os
from collections import Counter
from dataclasses import dataclass, field, replace
from datetime import date
from itertools import pairwise
from pathlib import Path

import numpy as np

from tankcal import record as records
from tankcal.errors import InputError, Problem, reason_of
from tankcal.job.tables import Log
from tankcal.messages import list_some, message
from tankcal.products.recalibration.agreement import coverage_factor, normalized_error
from tankcal.products.recalibration.comparison import (
    PARTS_OF_HEIGHT,
    compare,
    read_course_sizes,
    rows_file,
)
from tankcal.products.recalibration.former import FormerTable
from tankcal.products.recalibration.reading import read_former
from tankcal.products.register.certificates import read_certificates
from tankcal.record.inspection import INSPECTION, VERDICTS
from tankcal.record.recalibration import (
    CertificateInHistory,
    CheckInHistory,
    HistoryFile,
    InspectionInHistory,
    MonthInHistory,
    RadiusChange,
    RadiusInHistory,
    TableChange,
    VolumeInHistory,
)
from tankcal.record.schema import warnings_of
from tankcal.text.delimited import decode_text, find_encoding

DAYS_OF_YEAR = 365.25
MOST_WARNINGS = 100
SAME_M = 1e-3  # largest difference of equal dimensions and reference heights


@dataclass(frozen=True)
class DatedTable:
    """A capacity table of a tank, with its date.

    Attributes
    ----------
    table : FormerTable
        Its name is its location.
    sha256 : str
        SHA-256 of its file.
    day : date
    """

    table: FormerTable
    sha256: str
    day: date

    @property
    def tank(self):
        """Id of the tank in the record; None without a record."""
        record = self.table.record
        return None if record is None else record["job"]["tank"].get("id")


def history_of(
    tables,
    inspections=(),
    months=(),
    *,
    dips_m=None,
    courses=None,
    register=None,
    left_out=(),
    warnings=(),
    progress=None,
):
    """Return the history of a tank.

    Parameters
    ----------
    tables : sequence of DatedTable
        At least one table, in any order.
    inspections : sequence of InspectionInHistory
    months : sequence of MonthInHistory
    dips_m : sequence of float, optional
        Dips of the volumes shown; None: fifths of the common range of all tables.
    courses : (heights, thicknesses), optional
        Courses of an upright tank, m, if no record has them.
    register : dict, optional
        {number: RegisteredCertificate} of `products.register`; None: states are not known.
    left_out, warnings : sequence of Problem
        Problems met while files were searched and read.
    progress : callable, optional
        progress(text, done, total)

    Returns
    -------
    record.recalibration.HistoryFile

    Raises
    ------
    InputError
        With every pair of tables that cannot be of one tank, and every dip outside all tables.

    Examples
    --------
    >>> import numpy as np
    >>> dips = np.linspace(0.0, 8.0, 81)
    >>> def table(year, area):
    ...     rows = FormerTable(f"{year}.csv", dips, area * dips, U_m3=0.2 * dips)
    ...     return DatedTable(rows, "", date(year, 5, 1))
    >>> history = history_of([table(2020, 100.05), table(2010, 100.0)])
    >>> [entry.date for entry in history.certificates], round(history.changes[0].top_d_m3, 3)
    (['2010-05-01', '2020-05-01'], 0.4)
    """
    ordered = sorted(tables, key=_sort_key)
    progress = progress or (lambda text, done, total: None)
    on_newest, successive = _comparisons(ordered, courses, progress)
    k = coverage_factor(_newest_with_U(ordered))
    rows = _select_dips(on_newest, dips_m)
    newest = ordered[-1].table
    problems = [*warnings, *_table_warnings(ordered), *_register_warnings(ordered, register)]
    return HistoryFile(
        notice=_notice(newest),
        tank=next((table.tank for table in reversed(ordered) if table.tank), None),
        kind=newest.kind or ordered[0].table.kind,
        coverage_k=k,
        certificates=_certificates(ordered, register),
        dips_m=rows,
        volumes=[
            volume
            for number, comparison in enumerate(on_newest, 1)
            for volume in _volumes(number, comparison, rows)
        ],
        radii=[
            radius
            for number, comparison in enumerate(on_newest, 1)
            for radius in _radii(number, comparison, k)
        ],
        changes=[
            _change(number, comparison, ordered[number - 1 : number + 1], k)
            for number, comparison in enumerate(successive, 1)
        ],
        inspections=sorted(
            inspections,
            key=lambda inspection: (inspection.date is None, inspection.date, inspection.file),
        ),
        months=sorted(months, key=lambda month: (month.month, month.file)) or None,
        left_out=warnings_of(left_out),
        warnings=_warnings(problems, successive),
    )


def _sort_key(table):
    """Sort key: date, then number, program and file, so that the order is reproducible."""
    record = table.table.record or {}
    return table.day, str(table.table.number or ""), record.get("tankcal") or "", table.table.name


def _newest_with_U(ordered):
    """Newest table with U, else the newest table."""
    known = [table.table for table in ordered if table.table.U_m3 is not None]
    return known[-1] if known else ordered[-1].table


def _comparisons(ordered, courses, progress):
    """Compare each table with the newest, and with the one before: two lists of ComparisonFile."""
    newest, problems, comparisons = ordered[-1].table, {}, ([], [])
    pairs = [(0, table.table, newest) for table in ordered]
    pairs += [(1, a.table, b.table) for a, b in pairwise(ordered)]
    for done, (role, former, new) in enumerate(pairs):
        text = message("history_comparing", "comparing {count} tables", count=len(ordered))
        progress(text, done, len(pairs))
        try:
            comparisons[role].append(compare(former, new, courses=courses))
        except InputError as error:
            problems |= dict.fromkeys(error.problems)
    if problems:
        raise InputError(list(problems))
    return comparisons


def _warnings(problems, comparisons):
    """Return problems and warnings of the comparisons as WarningRecords, without duplicates."""
    records = warnings_of(problems)
    for comparison in comparisons:
        records += [
            warning for warning in comparison.warnings if warning.code != "compare_dates_turned"
        ]
    return list({(record.file, record.text): record for record in records}.values())[:MOST_WARNINGS]


def _notice(table):
    certificate = (table.record or {}).get("job", {}).get("certificate") or {}
    return str(certificate.get("notice") or "")


# ---- content of the file


def _register_warnings(ordered, register):
    """Yield a Problem for each certificate whose number the register has for another record."""
    for dated in ordered:
        entry = (register or {}).get(str(dated.table.number or "").strip())
        if entry and dated.table.record is not None and entry.record_sha256 != dated.sha256:
            text = message(
                "history_other_record",
                "number {number} is registered for another record; expected the record that the "
                "register names",
                number=entry.number,
            )
            yield Problem(dated.table.name, text)


def _state(table, register):
    """Return the state of a certificate and its date, as keys of CertificateInHistory."""
    if register is None:
        return {}
    entry = register.get(str(table.number or "").strip())
    if entry is None:
        return {"state": "not_registered"}
    return {"state": entry.state, "state_since": entry.since}


def _certificates(ordered, register):
    days = [table.day.isoformat() for table in ordered]
    certificates = []
    for number, (dated, after) in enumerate(zip(ordered, [*days[1:], None], strict=True), 1):
        table, record = dated.table, dated.table.record
        tank = {} if record is None else record["job"]["tank"]
        rule = None if record is None else record.get("rule")
        fit = None if record is None else record.get("adjustment")
        certificates.append(
            CertificateInHistory(
                certificate=number,
                file=table.name,
                sha256=dated.sha256,
                origin="table" if record is None else "record",
                tank=dated.tank,
                date=dated.day.isoformat(),
                superseded=after,
                number=table.number,
                laboratory=table.laboratory,
                method=table.method,
                tankcal=None if record is None else record["tankcal"],
                nominal_diameter_m=tank.get("nominal_diameter_m"),
                nominal_height_m=tank.get("nominal_height_m"),
                reference_temperature_c=table.reference_temperature_c,
                liquid_density_kg_m3=table.liquid_density_kg_m3,
                reference_height_m=table.reference_height_m,
                zero=None if record is None else record["capacity"].get("zero"),
                top_dip_m=float(table.height_m[-1]),
                top_volume_m3=float(table.volume_m3[-1]),
                U_top_m3=None if table.U_m3 is None else float(table.U_m3[-1]),
                k=None if table.U_m3 is None else table.k,
                rule=rule and rule["rule"]["name"],
                rule_verdict=rule and rule["code"],
                sigma0=fit and fit["sigma0"],
                global_test_passed=fit and fit["passed"] if fit and fit["redundancy"] else None,
                **_state(table, register),
            )
        )
    return certificates


def _select_dips(on_newest, dips_m):
    """Dips of the newest table, for use in all comparisons, at which volumes are shown."""
    common = None
    for comparison in on_newest:
        use = set(
            np.asarray(comparison.rows.height_m)[np.asarray(comparison.rows.for_use)].tolist()
        )
        common = use if common is None else common & use
    dips = np.array(sorted(common))
    if not len(dips):
        expected = message("history_no_range", "no dip that every table has; expected one")
        raise InputError(Problem(on_newest[-1].new.name, expected))
    if dips_m is None:
        wanted = [dips[0] + part * (dips[-1] - dips[0]) for part in PARTS_OF_HEIGHT]
    else:
        wanted = list(dips_m)
        outside = [dip for dip in wanted if not dips[0] - 1e-9 <= dip <= dips[-1] + 1e-9]
        if outside:
            raise InputError([
                Problem(
                    "--at",
                    message(
                        "history_dip_outside",
                        "found {dip:g} m; expected {low:g} to {high:g} m, which every table has",
                        dip=dip, low=float(dips[0]), high=float(dips[-1]),
                    ),
                )
                for dip in outside
            ])  # fmt: skip
    nearest = dict.fromkeys(float(dips[np.argmin(np.abs(dips - dip))]) for dip in wanted)
    return sorted(nearest)


def _volumes(number, comparison, rows_m):
    rows = comparison.rows
    places = {float(dip): place for place, dip in enumerate(rows.height_m)}
    c = comparison.correlation.c or 0.0
    for dip in rows_m:
        at = places[dip]
        d = 0.0 - float(rows.d_m3[at])
        U, of_newest = _none_if_nan(rows.U_former_m3[at]), _none_if_nan(rows.U_new_m3[at])
        E_n = None if None in (U, of_newest) else float(normalized_error(d, U, of_newest, c))
        yield VolumeInHistory(number, dip, float(rows.former_on_basis_m3[at]), U, d, E_n)


def _none_if_nan(value):
    return None if np.isnan(value) else float(value)


def _radii(number, comparison, k):
    for course in comparison.courses:
        U = None if course.u_former_m is None else float(k * course.u_former_m)
        yield RadiusInHistory(
            number, course.course, course.bottom_m, course.top_m, course.former_m, U
        )


def _change(number, comparison, pair, k):
    rows, worst = comparison.rows, comparison.correlation
    c = worst.c or 0.0
    U = [_none_if_nan(of[-1]) for of in (rows.U_former_m3, rows.U_new_m3)]
    U_top = None if None in U else float(np.sqrt(U[0] ** 2 + U[1] ** 2 - 2 * c * U[0] * U[1]))
    if U_top is not None and worst.coverage_k is not None:
        U_top *= k / worst.coverage_k
    former, new = pair
    return TableChange(
        former=number,
        new=number + 1,
        years=(new.day - former.day).days / DAYS_OF_YEAR,
        low_m=comparison.low_m,
        high_m=comparison.high_m,
        top_d_m3=float(rows.d_m3[-1]),
        U_top_m3=U_top,
        worst_E_n=worst.worst_E_n,
        c=worst.c,
        zero_m=comparison.zero.height_m,
        zero_source=comparison.zero.source,
        not_made=[
            step.code for step in comparison.steps if step.state in ("not_declared", "not_possible")
        ],
        verdict=comparison.verdict,
        rule=comparison.rule.name,
        radii=[
            RadiusChange(
                course.course,
                course.d_m,
                None if course.u_m is None else float(k * course.u_m),
                None if course.w is None else course.w / k,
            )
            for course in comparison.courses
        ],
    )


# ---- warnings about the tables


def _table_warnings(ordered):
    """Compare each table (DatedTable, oldest first) with the one before it; return Problems.

    Examples
    --------
    >>> from datetime import date
    >>> from tankcal.products.recalibration.former import FormerTable
    >>> from tankcal.products.recalibration.history import DatedTable
    >>> tables = [
    ...     DatedTable(FormerTable("a.csv", [0, 1], [0, 1], reference_height_m=x), "", date.min)
    ...     for x in (9.1, 9.2)
    ... ]
    >>> [problem.expected.code for problem in _table_warnings(tables)]
    ['history_same_day', 'history_reference_height']
    """
    problems = []
    for before, after in pairwise(ordered):
        problems += _pair_warnings(before, after)
    return problems


def _pair_warnings(before, after):
    name, other = after.table.name, before.table.name
    if before.day == after.day:
        text = message(
            "history_same_day",
            "of {date}, as {other}: which of them came first is not known; is one of them to be "
            "left out?",
            date=after.day.isoformat(),
            other=other,
        )
        yield Problem(name, text)
    if None not in (before.tank, after.tank) and before.tank != after.tank:
        text = message(
            "history_other_id",
            "of tank {tank}, {other} of tank {other_tank}: taken as one tank, as wanted",
            tank=after.tank,
            other=other,
            other_tank=before.tank,
        )
        yield Problem(name, text)
    yield from _size_warnings(name, other, _tank(before), _tank(after))
    heights = before.table.reference_height_m, after.table.reference_height_m
    if None not in heights and abs(heights[1] - heights[0]) > SAME_M:
        text = message(
            "history_reference_height",
            "reference height {new:.4f} m, {old:.4f} m in {other}: the volumes are brought to one "
            "zero by these; has the dip plate or the reference point been moved?",
            new=heights[1],
            old=heights[0],
            other=other,
        )
        yield Problem(name, text)
    zeros = _zero(before), _zero(after)
    if None not in zeros and zeros[0] != zeros[1]:
        text = message(
            "history_other_zero",
            "dips count from {new}, from {old} in {other}",
            new=zeros[1],
            old=zeros[0],
            other=other,
        )
        yield Problem(name, text)


def _tank(table):
    return {} if table.table.record is None else table.table.record["job"]


def _zero(table):
    return None if table.table.record is None else table.table.record["capacity"].get("zero")


def _size_warnings(name, former_name, was, now):
    """Report changed nominal dimensions or courses."""
    for key in ("nominal_diameter_m", "nominal_height_m"):
        sizes = [(job.get("tank") or {}).get(key) for job in (was, now)]
        if None not in sizes and abs(sizes[1] - sizes[0]) > SAME_M:
            text = message(
                "history_other_size",
                "{key} {new:g}, {old:g} in {other}; expected the sizes of one tank",
                key=key,
                new=sizes[1],
                old=sizes[0],
                other=former_name,
            )
            yield Problem(name, text)
    heights = [[course["height_m"] for course in job.get("courses") or ()] for job in (was, now)]
    if not all(heights):
        return
    same = len(heights[0]) == len(heights[1])
    if not same or np.abs(np.subtract(*heights)).max() > SAME_M:
        text = message(
            "history_other_courses",
            "courses of other heights than {other}: radii are compared by those of the newer one",
            other=former_name,
        )
        yield Problem(name, text)


RECORD = "record.json"
UPKEEP, UPKEEP_FORMAT = "upkeep.json", "tankcal-upkeep/1"
MOST_NAMED = 10  # largest number of tanks listed in a message
TABLES = (".csv", ".xlsx", ".pdf", ".toml")


@dataclass
class HistoryArchive:
    """Content of an archive.

    Attributes
    ----------
    tables : list of DatedTable
    inspections : list of InspectionInHistory
    months : list of MonthInHistory
    left_out : list of Problem
        Files that cannot be part of a history, with the reason.
    warnings : list of Problem
    problems : list of Problem
        Unreadable files.
    ids : dict
        {id of a tank: number of its files}.
    tanks : tuple of str
        Ids of the tank; files of other tanks are skipped. Empty: all files are read.
    seen : dict
        {SHA-256: name} of the files read.
    """

    tables: list = field(default_factory=list)
    inspections: list = field(default_factory=list)
    months: list = field(default_factory=list)
    left_out: list = field(default_factory=list)
    warnings: list = field(default_factory=list)
    problems: list = field(default_factory=list)
    ids: dict = field(default_factory=dict)
    tanks: tuple = ()
    seen: dict = field(default_factory=dict)

    def is_of_other_tank(self, tank):
        """Return whether the id of a tank is none of the ids asked for."""
        return bool(self.tanks) and tank not in self.tanks

    def is_repeated(self, name, digest):
        """Return whether a file was read before under another name; it is then left out."""
        if digest not in self.seen:
            self.seen[digest] = name
            return False
        text = message(
            "history_same_file", "is the same file as {other}: it counts once",
            other=self.seen[digest],
        )  # fmt: skip
        self.left_out.append(Problem(name, text))
        return True

    def count(self, tank):
        """Count a file of a tank."""
        self.ids[tank] = self.ids.get(tank, 0) + 1


def history_of_files(paths, *, tanks=(), dips_m=None, courses=None, register=None, progress=None):
    """Return the history of the tank whose results are in the given folders.

    Parameters
    ----------
    paths : sequence of path
        Folders, searched for record.json and inspection.json; such files; former tables in any form
        that `read_former` reads, with a former.toml that states their date.
    tanks : sequence of str
        Ids of the tank; files of other tanks are skipped. Empty: all files must be of one tank.
    dips_m : sequence of float, optional
        As in `history_of`.
    courses : path, optional
        courses.csv of an upright tank, if no record has its courses.
    register : path, optional
        Register of certificates (`products.register`), for the states of the certificates.
    progress : callable, optional
        As in `history_of`.

    Returns
    -------
    record.recalibration.HistoryFile

    Raises
    ------
    InputError
        With every unreadable file; for several tanks without `tanks`; and for tables that cannot be
        of one tank.
    """
    archive = HistoryArchive(tanks=tuple(tanks))
    files = find_files(paths, progress)
    for done, (path, name, is_searched) in enumerate(files):
        if progress is not None:
            progress(message("history_reading", "reading the files"), done, len(files))
        try:
            _read(archive, path, name, is_searched)
        except InputError as error:
            archive.problems += [
                replace(problem, file=name) if problem.file in (path.name, RECORD) else problem
                for problem in error.problems
            ]
    log = Log()
    shell = None if courses is None else read_course_sizes(Path(courses), log)
    archive.problems += log.problems
    certificates = {}
    if register is not None:
        try:
            certificates = read_certificates(register)
        except InputError as error:
            archive.problems += error.problems
    if archive.problems:
        raise InputError(archive.problems)
    _refuse_several(archive, paths)
    if not archive.tables:
        raise InputError(_no_table_problems(archive, paths))
    return history_of(
        archive.tables,
        archive.inspections,
        archive.months,
        dips_m=dips_m,
        courses=shell,
        register=None if register is None else certificates,
        left_out=archive.left_out,
        warnings=archive.warnings,
        progress=progress,
    )


def find_files(paths, progress=None):
    """Return [(path, name shown, whether found in a folder)] of all candidate files.

    Links to other folders are not followed, which excludes endless loops. Hidden folders are
    skipped.
    """
    files, problems = [], []
    for source in map(Path, paths):
        if source.is_dir():
            if progress is not None:
                text = message("history_searching", "searching {folder}", folder=str(source))
                progress(text, 0, 0)
            for path in _files_below(source, problems):
                files.append((path, len(path.relative_to(source).parts)))
        elif source.is_file():
            files.append((source, 0))
        else:
            text = message(
                "history_nothing_there",
                "is not there; expected a folder with results, a record.json, an inspection.json "
                "or a former table",
            )
            problems.append(Problem(source.name or str(source), text))
    if problems:
        raise InputError(problems)
    return _name_files(files)


def _name_files(files):
    """Return (path, name, whether found in a folder), named with enough folders to be unique.

    files: (path, fewest parts of the name, or 0 if not found in a folder) of each file.
    """
    places = {Path(os.path.abspath(path)).parts: least for path, least in reversed(files)}
    tails, named = {}, []
    for parts, least in reversed(places.items()):
        count = max(least, 1)
        while _count_tails(places, count, tails)[parts[-count:]] > 1:
            count += 1
        named.append((Path(*parts), "/".join(parts[-count:]), least > 0))
    return named


def _count_tails(places, count, known):
    """Number of paths that end in these `count` parts; `known` caches the counts."""
    if count not in known:
        known[count] = Counter(parts[-count:] for parts in places)
    return known[count]


def _files_below(folder, problems):
    """Paths of candidate files below a folder; unreadable folders are reported."""

    def report(error):
        text = message(
            "history_folder_unreadable",
            "a folder that cannot be read ({why}); expected one that can, or it left out",
            why=reason_of(error),
        )
        problems.append(Problem(str(error.filename), text))

    for place, folders, files in os.walk(folder, onerror=report):
        folders[:] = sorted(folder for folder in folders if not folder.startswith("."))
        for name in (RECORD, INSPECTION.file, UPKEEP):
            if name in files and Path(place, name).is_file():  # excludes pipes and broken links
                yield Path(place, name)


def _read(archive, path, name, is_searched):
    """Read one file and add it to the archive.

    is_searched  whether the file was found in a folder, and may be of another tank or program
    """
    if path.suffix.lower() in TABLES:
        _add_former(archive, path, name)
        return
    data = path.read_bytes()
    content = data if find_encoding(data) == "utf-8" else _encode_utf8(data, path)
    if (
        is_searched
        and archive.tanks
        and not any(_may_name(content, tank) for tank in archive.tanks)
    ):
        if content.rstrip()[-1:] != b"}":
            text = message("history_cut_off", "is cut off: of which tank it was is not known")
            archive.left_out.append(Problem(name, text))
        return
    saved = _parse_json(content, path)
    kind = str(saved.get("format") or "") if isinstance(saved, dict) else ""
    if is_searched and not kind.startswith("tankcal-"):
        text = message("history_not_ours", "no file of tankcal: passed over")
        archive.left_out.append(Problem(name, text))
        return
    digest = hashlib.sha256(data).hexdigest()
    if kind.startswith(f"{INSPECTION.name}/"):
        _add_inspection(archive, INSPECTION.migrated(saved, path.name), name, digest)
    elif kind == UPKEEP_FORMAT:
        _add_upkeep(archive, saved, name, digest)
    else:
        _add_record(archive, records.migrated(saved, path.name), path, name, digest)


def _may_name(content, tank):
    """Whether bytes contain the id of a tank as JSON; a fast filter for large archives."""
    return any(
        json.dumps(tank, ensure_ascii=is_ascii).encode("utf-8", "replace") in content
        for is_ascii in (False, True)
    )


def _encode_utf8(data, path):
    try:
        return decode_text(data).encode("utf-8")
    except ValueError as error:
        raise _unreadable(error, path) from None


def _parse_json(content, path):
    try:
        return json.loads(content)
    except (ValueError, RecursionError) as error:
        raise _unreadable(error, path) from None


def _unreadable(error, path):
    text = message("history_no_json", "cannot be read: {error}", error=reason_of(error))
    return InputError(Problem(path.name, text))


def _add_record(archive, record, path, name, digest):
    tank = ((record["job"] or {}).get("tank") or {}).get("id")
    if archive.is_of_other_tank(tank) or archive.is_repeated(name, digest):
        return
    if tank is not None:
        archive.count(tank)
    if record["capacity"] is None:
        text = message("history_only_survey", "a survey that was only adjusted: it has no table")
        archive.left_out.append(Problem(name, text))
        return
    _add_table(archive, replace(read_former(path), name=name), digest)


def _add_former(archive, path, name):
    table = replace(read_former(path), name=name)
    digest = hashlib.sha256(rows_file(path).read_bytes()).hexdigest()
    if not archive.is_repeated(name, digest):
        _add_table(archive, table, digest)


def _add_table(archive, table, digest):
    archive.warnings += table.warnings if table.record is None else ()
    day = _day(table.date)
    if day is None:
        text = message(
            "history_no_date",
            "without the date of its calibration: it has no place among the others",
        )
        archive.left_out.append(Problem(table.name, text))
        return
    archive.tables.append(DatedTable(table, digest, day))


def _day(text):
    try:
        return date.fromisoformat(str(text or "")[:10])
    except ValueError:
        return None


def _add_inspection(archive, saved, name, digest):
    tank = saved["tank"]
    if archive.is_of_other_tank(tank["id"]) or archive.is_repeated(name, digest):
        return
    archive.count(tank["id"])
    day = _day(tank["survey_date"])
    archive.inspections.append(
        InspectionInHistory(
            file=name,
            sha256=digest,
            tank=tank["id"],
            date=day and day.isoformat(),
            rule=saved["rule"] and saved["rule"]["name"],
            checks=_worst_checks(saved["checks"]),
        )
    )


def _add_upkeep(archive, saved, name, digest):
    """Add the months of an upkeep."""
    if archive.is_of_other_tank(saved["tank"]) or archive.is_repeated(name, digest):
        return
    archive.count(saved["tank"])
    alarm = saved["watch"]["alarm"]
    archive.months += [
        MonthInHistory(
            name, month["month"], saved["record_sha256"], month["leak_l_h"], month["U_l_h"],
            month["throughput_percent"], month["U_percent"], month["verdict"],
            alarm if alarm and alarm.startswith(month["month"]) else None,
        )
        for month in saved["months"]
    ]  # fmt: skip


def _worst_checks(checks):
    """Worst result of each check, by its verdict, then by value over limit."""
    worst = {}
    for check in checks:
        known = worst.get(check["code"])
        if known is None or _gravity(check) > _gravity(known):
            worst[check["code"]] = check
    return [
        CheckInHistory(
            code=check["code"],
            unit=check["unit"],
            value=check["value"],
            U=check["U"],
            limit=check["limit"] and check["limit"]["value"],
            verdict=check["verdict"],
        )
        for check in worst.values()
    ]


def _gravity(check):
    """Rank of a result; a result that could not be judged ranks above one that passed."""
    value = abs(check["value"] or 0.0)
    limit = check["limit"] and check["limit"]["value"]
    return -VERDICTS.index(check["verdict"]), value / limit if limit else value


def _refuse_several(archive, paths):
    """Raise InputError for files of several tanks if no tank was asked for."""
    if archive.tanks or len(archive.ids) < 2:
        return
    ids = sorted(archive.ids)
    text = message(
        "history_several_tanks",
        "files of {count} tanks: {ids}; expected those of one: --tank ID, several times where one "
        "tank has had several",
        count=len(ids),
        ids=list_some(ids, MOST_NAMED),
    )
    raise InputError(Problem(Path(paths[0]).name or str(paths[0]), text))


def _no_table_problems(archive, paths):
    """Message that no table was found, with the files found instead."""
    name = Path(paths[0]).name or str(paths[0])
    text = message(
        "history_no_table",
        "no capacity table with a date; expected record.json of tankcal in or below it",
    )
    if archive.tanks:
        text = message(
            "history_no_table_of_tank",
            "no capacity table with a date of tank {tank}; expected record.json of tankcal with "
            "that id in or below it",
            tank=", ".join(archive.tanks),
        )
    return [Problem(name, text), *archive.left_out]
