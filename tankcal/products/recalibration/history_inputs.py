"""Input of `tankcal history`: folders of results, saved files, former tables."""

import hashlib
import json
import os
from collections import Counter
from dataclasses import dataclass, field, replace
from datetime import date
from pathlib import Path

from tankcal import record as records
from tankcal.errors import InputError, Problem, reason_of
from tankcal.job.tables import Log
from tankcal.messages import list_some, message
from tankcal.products.recalibration.comparison import read_course_sizes, rows_file
from tankcal.products.recalibration.history import DatedTable, history_of
from tankcal.products.recalibration.reading import read_former
from tankcal.products.register.certificates import read_certificates
from tankcal.record.history import CheckInHistory, InspectionInHistory, MonthInHistory
from tankcal.record.inspection import INSPECTION, VERDICTS
from tankcal.text.delimited import decode_text, find_encoding

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
    record.history.HistoryFile

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
