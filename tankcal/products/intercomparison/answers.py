"""Answers of a comparison: empty forms, answers of any program, and answers of tankcal."""

import csv
import datetime
import io
import json
import math
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from scipy.stats import norm

from tankcal.errors import InputError, Problem, TankcalError
from tankcal.job.entries import read_columns, read_section, unknown_section
from tankcal.job.fields import Field, choice, number, positive
from tankcal.job.folder import MAX_SETTINGS_BYTES, declared_marks, read_csv, read_toml
from tankcal.job.tables import SEPARATORS, nearest, read_bytes
from tankcal.messages import list_some, message
from tankcal.record.intercomparison import ANSWERS, Answer, AnswersFile, Participant
from tankcal.text.delimited import find_encoding
from tankcal.version import find_version

PARTICIPANT = "participant.toml"
ROWS = (
    number(
        "height_m",
        message("ic_note_height", "height above the dip plate, as asked, metres"),
        -100,
        100,
        required=True,
    ),
    number("volume_m3", "volume below it, cubic metres; blank: not answered", 0, 1e7),
    positive("U_m3", "its expanded uncertainty, cubic metres; blank: not stated", 1e6),
    positive("k", "coverage factor of U_m3; blank: not stated", 100),
    positive("coverage", "coverage probability of U_m3, in place of k", 0.999999),
)
KEYS = (
    Field("name", "text", message("ic_note_name", "name of the participant"), required=True),
    Field(
        "software",
        "text",
        message("ic_note_software", "software that computed the answers"),
        required=True,
    ),
    Field("version", "text", message("ic_note_version", "version of the software"), required=True),
    Field(
        "package",
        "text",
        message("ic_note_package", "truth_sha256 of the package's manifest.json"),
        required=True,
    ),
    Field("date", "date", message("ic_note_date", "day of the answers, year-month-day")),
    Field("contact", "text", message("ic_note_contact", "how to reach the participant")),
    Field(
        "remarks", "text", message("ic_note_remarks", "anything that is to stand beside the scores")
    ),
)
CSV_KEYS = (
    choice("separator", "between the columns of the tables", SEPARATORS),
    choice("decimal", "mark of their decimals", (".", ",")),
)
SECTIONS = {"participant": KEYS, "csv": CSV_KEYS}
SAME_M = 1e-6  # largest difference of heights that are treated as equal
MOST_NAMED = 5  # largest number of heights listed in a message
MOST_TIMES = 4  # largest number of rows per requested height; more rows give a single problem
ABOUT = (
    message(
        "ic_about_participant",
        "Who answers, with what. Tables with ; and decimal commas: say so under [csv].",
    ),
    message("ic_about_readme", "The formats: README.md of the package"),
)


@dataclass(frozen=True)
class Answers:
    """Answers of a participant, checked against the requested surveys and heights.

    Attributes
    ----------
    saved : AnswersFile
        The answers.
    folder : str
        Name of their folder.
    warnings : tuple of Problem
        Warnings about the answers.
    """

    saved: AnswersFile
    folder: str
    warnings: tuple


def answer_file(tank, method):
    """Name of the table of answers for a survey."""
    return f"{tank}_{method}.csv"


# ---- writing


def make_forms(manifest, translate=str):
    """Empty forms for all surveys of a package, {name: bytes}.

    `translate(message)` returns the text of a comment in the language of the participant.
    """
    lines = [*(f"# {translate(item)}" for item in ABOUT), "", "[participant]"]
    for item in KEYS:
        value = manifest["truth_sha256"] if item.name == "package" else ""
        value = "2026-01-31" if item.kind == "date" else _quote(value)
        lines.append(
            f"{'' if item.required else '# '}{item.name} = {value}  # {translate(item.note)}"
        )
    lines += ["", "# [csv]", '# separator = ";"', '# decimal = ","', ""]
    files = {PARTICIPANT: "\n".join(lines).encode()}
    heights = {item["tank"]: item["heights_m"] for item in manifest["tanks"]}
    for job in manifest["jobs"]:
        rows = [[f"{height:g}", "", "", ""] for height in heights[job["tank"]]]
        files[answer_file(job["tank"], job["method"])] = _table(rows)
    return files


def answer_files(saved):
    """Files of an AnswersFile, {name: bytes}, in the format for all programs."""
    participant = saved.participant
    lines = ["[participant]"]
    for item in KEYS:
        value = getattr(participant, item.name)
        if value is not None:
            lines.append(f"{item.name} = {value}" if item.kind == "date" else
                         f"{item.name} = {_quote(value)}")  # fmt: skip
    files = {PARTICIPANT: ("\n".join(lines) + "\n").encode()}
    for item in saved.answers:
        columns = zip(item.height_m, item.volume_m3, item.U_m3, item.k, strict=True)
        rows = [[f"{height:g}", *map(_cell, values)] for height, *values in columns]
        files[answer_file(item.tank, item.method)] = _table(rows)
    return files


def _table(rows):
    """Bytes of a CSV table with the headings of answers."""
    stream = io.StringIO()
    csv.writer(stream, lineterminator="\n").writerows(
        [[field.name for field in ROWS if field.name != "coverage"], *rows]
    )
    return stream.getvalue().encode()


def _cell(value):
    """Text of a value; blank for None or nan."""
    return "" if value is None or not np.isfinite(value) else f"{value:.9g}"


def _quote(text):
    """Text as a TOML string, whose escapes are those of JSON."""
    return json.dumps(text, ensure_ascii=False)


# ---- reading


def read_answers(folder, requested, log):
    """Read the `Answers` of a folder.

    Parameters
    ----------
    folder : path
        Folder with participant.toml and tables, or with answers.json.
    requested : dict
        Requested heights and methods of the truth or the manifest, {tank: (heights, set of
        methods)}.
    log : Log
        Receives the problems and warnings.

    Returns
    -------
    Answers or None
        None if the folder has problems.
    """
    folder, problem_count = Path(folder), len(log.problems)
    if not folder.is_dir():
        log.problem(str(folder.name or folder), message("ic_no_folder", "not found; expected a "
                    "folder of answers with participant.toml and tables"))  # fmt: skip
        return None
    warnings = _WarningStart(log)
    if (folder / ANSWERS.file).is_file():
        saved = _read_json(folder / ANSWERS.file, requested, log, warnings)
    else:
        saved = _read_tables(folder, requested, log, warnings)
    if saved is not None and not saved.answers and len(log.problems) == problem_count:
        log.problem(folder.name, message("ic_no_answers", "no volume in any table; expected the "
                    "answers of one survey at least"))  # fmt: skip
    if len(log.problems) > problem_count:
        return None
    return Answers(saved, folder.resolve().name, tuple(log.warnings[warnings.first :]))


class _WarningStart:
    """Index of the first warning of a folder in a log."""

    def __init__(self, log):
        self.first = len(log.warnings)


def _read_tables(folder, requested, log, warnings):
    """AnswersFile of participant.toml and CSV tables, or None without a participant."""
    participant, marks = _participant(folder / PARTICIPANT, log)
    known = {
        answer_file(tank, method): (tank, method)
        for tank, (_, methods) in requested.items()
        for method in methods
    }
    answers = []
    for path in sorted(folder.iterdir()):
        if path.suffix.lower() != ".csv" or path.name.startswith((".", "~")):
            continue
        if path.name not in known:
            text = message("ic_unknown_table", "no survey is called so{hint}; expected names such "
                           "as {such}", hint=nearest(path.name, known),
                           such=list_some(sorted(known), 3))  # fmt: skip
            log.problem(path.name, text)
            continue
        answer = _read_table(path, *known[path.name], requested, marks, log)
        if answer is not None:
            answers.append(answer)
    return AnswersFile(participant, answers) if participant else None


def _participant(path, log):
    """Participant and (separator, decimal mark) of participant.toml, each None if invalid."""
    problem_count, data = len(log.problems), read_bytes(path, log, MAX_SETTINGS_BYTES)
    settings, sections = (None, {}) if data is None else read_toml(path.name, data, log)
    if settings is None:
        return None, None
    for section in settings:
        if section not in SECTIONS:
            text = unknown_section(section, SECTIONS)
            log.problem(path.name, text, sections.get(section), f"[{section}]")
    section_values = {
        name: read_section(path.name, name, fields, settings.get(name, {}), sections.get(name), log)
        for name, fields in SECTIONS.items()
    }
    marks = declared_marks(path.name, settings, log)
    if len(log.problems) > problem_count:
        return None, marks
    values = section_values["participant"]
    day = values["date"]
    return Participant(**values | {"date": None if day is None else str(day)}), marks


def _read_table(path, tank, method, requested, marks, log):
    """Read the Answer of a table; None if the table is empty or invalid."""
    problem_count, data = len(log.problems), read_bytes(path, log)
    if data is None:
        return None
    marks = marks or _likely_marks(data)
    table = read_csv(path.name, data, *marks, log, settings_file=PARTICIPANT)
    if table is None or _has_too_many(path.name, len(table.rows), requested[tank][0], log):
        return None
    values = read_columns(None, table, log, ROWS)
    if "volume_m3" not in table.headings:
        text = message("ic_no_volumes", "missing column; expected volumes in cubic metres")
        log.problem(path.name, text, table.heading_row, "volume_m3")
    if len(log.problems) > problem_count:
        return None
    height, volume, U, k, coverage = (values.numbers(item.name) for item in ROWS)
    k = _factors(path.name, values.rows, U, k, coverage, log)
    _check_heights(path.name, values.rows, height, requested[tank][0], log)
    given = np.isfinite(volume)
    for row, is_given, spread in zip(values.rows, given, U, strict=True):
        if not is_given and np.isfinite(spread):
            text = message("ic_U_alone", "an uncertainty without a volume; expected both")
            log.problem(path.name, text, row, "U_m3")
    if len(log.problems) > problem_count:
        return None
    _warn_about_missing(path.name, height[given], requested[tank][0], log)
    if not given.any():
        return None
    if np.any(np.isfinite(U) & ~np.isfinite(k)):
        text = message("ic_no_k", "U_m3 without k or coverage in some rows: they have E_n, no zeta")
        log.warning(path.name, text)
    columns = (item[given].tolist() for item in (height, volume, U, k))
    return Answer(tank, method, *columns)


def _likely_marks(data):
    """Probable separator and decimal mark of a table without a valid participant.toml."""
    text = data.decode(find_encoding(data), "replace")
    heading = text.partition("\n")[0]
    separator = next((mark for mark in SEPARATORS[1:] if mark in heading), SEPARATORS[0])
    return separator, "," if separator != "," and "," in text else "."


def _factors(name, rows, U, k, coverage, log):
    """Coverage factors: stated, or of a normal distribution for the stated probability."""
    for row, factor, probability in zip(rows, k, coverage, strict=True):
        if np.isfinite(factor) and np.isfinite(probability):
            text = message("ic_k_twice", "k and coverage both given; expected one of them")
            log.problem(name, text, row, "coverage")
    factors = np.where(np.isfinite(coverage), norm.ppf((1 + np.nan_to_num(coverage)) / 2), k)
    return np.where(np.isfinite(U), factors, np.nan)


def _has_too_many(name, count, requested, log):
    """Whether a table has too many rows for a message about each; if so, report it to `log`."""
    if count <= MOST_TIMES * len(requested):
        return False
    text = message("ic_too_many_rows", "{count} rows; expected {asked} at most, one for each "
                   "height that is asked", count=count, asked=len(requested))  # fmt: skip
    log.problem(name, text)
    return True


def _check_heights(name, rows, height, requested, log):
    """Report heights that were not requested or that occur twice."""
    requested_m, seen = np.asarray(requested), {}
    for row, value in zip(rows, height, strict=True):
        nearest = int(np.argmin(np.abs(requested_m - value)))
        if abs(requested_m[nearest] - value) > SAME_M:
            text = message("ic_not_asked", "{height:g} m was not asked; the nearest height that was"
                           " is {near:g} m", height=value, near=requested_m[nearest])  # fmt: skip
            log.problem(name, text, row, "height_m")
        elif nearest in seen:
            text = message("ic_height_twice", "{height:g} m stands in row {first}, too; expected "
                           "each height once", height=value, first=seen[nearest])  # fmt: skip
            log.problem(name, text, row, "height_m")
        else:
            seen[nearest] = row


def _warn_about_missing(name, height, requested, log):
    """Warn of requested heights without a volume."""
    missing = [item for item in requested if not np.any(np.abs(height - item) <= SAME_M)]
    if missing:
        text = message(
            "ic_missing_heights", "{missing} of {asked} heights without a volume ({heights})",
            missing=len(missing), asked=len(requested),
            heights=list_some(
                [message("ic_height", "{height:g} m", height=item) for item in missing], MOST_NAMED
            ),
        )  # fmt: skip
        log.warning(name, text)


# ---- answers.json


def _read_json(path, requested, log, warnings):
    """AnswersFile of answers.json, or None if it has problems."""
    from tankcal.products.intercomparison.package import load_saved

    data = load_saved(ANSWERS, path, log)
    if data is None:
        return None
    problem_count, answers, seen = len(log.problems), [], set()
    for entry in data["answers"]:
        name = f"{path.name}, {entry['tank']} {entry['method']}"
        lengths = {len(entry[key]) for key in ("height_m", "volume_m3", "U_m3", "k")}
        place = entry["tank"], entry["method"]
        if entry["tank"] not in requested or entry["method"] not in requested[entry["tank"]][1]:
            log.problem(name, message("ic_unknown_survey", "no such survey in the package"))
        elif place in seen:
            log.problem(name, message("ic_survey_twice", "answered twice; expected once"))
        elif len(lengths) > 1:
            log.problem(name, message("ic_uneven", "lists of different lengths; expected a value "
                        "(or null) for each height"))  # fmt: skip
        elif not _has_too_many(name, len(entry["height_m"]), requested[entry["tank"]][0], log):
            U, k = (_check_positive(name, key, entry[key], log) for key in ("U_m3", "k"))
            height = np.array(entry["height_m"], float)
            _check_heights(
                name, range(1, len(height) + 1), height, requested[entry["tank"]][0], log
            )
            _warn_about_missing(name, height, requested[entry["tank"]][0], log)
            if len(height):
                answers.append(Answer(*place, entry["height_m"], entry["volume_m3"], U, k))
        seen.add(place)
    if len(log.problems) > problem_count:
        return None
    return AnswersFile(Participant(**data["participant"]), answers)


def _check_positive(name, key, values, log):
    """List of values, nan for None; report values that are not positive."""
    numbers = np.array([np.nan if value is None else value for value in values], float)
    if np.any(numbers <= 0):
        log.problem(name, message("ic_not_positive", "a value of 0 or below; expected above 0, or "
                    "null"), None, key)  # fmt: skip
    return numbers.tolist()


# ---- answers of tankcal


def answer_package(folder, manifest, progress=None, run=None):
    """Compute every survey of a package.

    Parameters
    ----------
    folder : path
        Folder of the package.
    manifest : dict
        Checked manifest of the package.
    progress : callable, optional
        Function progress(text, done, total).
    run : callable, optional
        Function run(folder of a job) that returns an object with a method `at(height)`; by default
        tankcal.

    Returns
    -------
    AnswersFile
        Answers to all surveys with a valid solution.
    tuple of Problem
        Problems of the other surveys.
    """
    progress = progress or (lambda *_: None)
    run = run or _run
    heights = {item["tank"]: item["heights_m"] for item in manifest["tanks"]}
    answers, problems = [], []
    step = message("ic_answering", "computing the surveys")
    for done, job in enumerate(manifest["jobs"]):
        progress(step, done, len(manifest["jobs"]))
        requested = heights[job["tank"]]
        try:
            table = run(Path(folder) / job["folder"])
            volumes = [table.at(height) for height in requested]
        except InputError as error:
            problems += [
                replace(item, file=f"{job['folder']}/{item.file}") for item in error.problems
            ]
            continue
        except TankcalError as error:
            problems += [Problem(job["folder"], text) for text in error.texts]
            continue
        U = [item.U_m3 if item.U_m3 > 0 else math.nan for item in volumes]
        k = [math.nan if item.k is None else item.k for item in volumes]
        values = [item.value_m3 for item in volumes]
        answers.append(Answer(job["tank"], job["method"], list(requested), values, U, k))
    progress(step, len(manifest["jobs"]), len(manifest["jobs"]))
    participant = Participant(
        name="tankcal",
        software="tankcal",
        version=find_version(),
        date=datetime.date.today().isoformat(),
        contact=None,
        remarks=None,
        package=manifest["truth_sha256"],
    )
    return AnswersFile(participant, answers), tuple(problems)


def _run(folder):
    """Capacity table of a job by tankcal."""
    import tankcal

    return tankcal.run(tankcal.load(folder))
