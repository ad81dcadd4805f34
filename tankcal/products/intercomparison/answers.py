"""Answers of a comparison and their scores against assigned values, as in proficiency tests.

Answers come from any program, as filled-in forms, or from tankcal. x is the answer, X the assigned
value, U the stated expanded uncertainty, and u = U / k. The assigned values come from a quadrature,
whose numerical error is U_ref. The scores are those of ISO 13528:2022, 9.7 and 9.6:

    E_n = (x - X) / sqrt(U^2 + U_ref^2)          zeta = (x - X) / sqrt(u^2 + u_ref^2)

For a coverage probability of 95 %, |E_n| <= 1 is expected for 95 % of the answers. The rows of a
table have nearly all errors in common. Tables, not rows, are therefore the independent units, and
the standard deviation of a share of rows follows from a ratio of sums over tables,

    p = sum m_i / sum n_i      s^2 = J / (J - 1) sum (m_i - p n_i)^2 / (sum n_i)^2

For the top rows of tables, the exact binomial bounds (Clopper and Pearson) are computed.
"""

import csv
import datetime
import io
import json
import math
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from scipy.stats import beta, norm

from tankcal.errors import InputError, Problem, TankcalError
from tankcal.job.entries import read_columns, read_section, unknown_section
from tankcal.job.fields import Field, choice, number, positive
from tankcal.job.folder import MAX_SETTINGS_BYTES, declared_marks, read_csv, read_toml
from tankcal.job.tables import SEPARATORS, Log, nearest, read_bytes
from tankcal.messages import list_some, message
from tankcal.products.intercomparison.package import load_package, load_truth
from tankcal.record.intercomparison import (
    ANSWERS,
    PACKAGE,
    Answer,
    AnswersFile,
    MethodScore,
    Participant,
    ScoredRows,
    ScoredTable,
    ScoresFile,
    TableForm,
)
from tankcal.record.schema import warnings_of
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


def score_folders(folders, truth, package=None):
    """Score folders of answers.

    Parameters
    ----------
    folders : sequence of path
        Folders of answers, one for each participant.
    truth : path
        The file truth.json, or its folder.
    package : path, optional
        The package; its manifest must also state the SHA-256 of this truth.

    Returns
    -------
    ScoresFile

    Raises
    ------
    InputError
        If the folders, the truth or the package have problems, or if answers or manifest refer to
        another truth. The error lists all problems.
    """
    log, committed = Log(), []
    coverage = 0.95
    if package is not None:
        manifest = load_package(package, log)
        if manifest is not None:
            committed.append((PACKAGE.file, manifest["truth_sha256"]))
            coverage = manifest["coverage_probability"]
    truth_and_hash = load_truth(truth, committed, log)
    if truth_and_hash is None:
        log.stop_if_problems()
    truth_data, truth_sha256 = truth_and_hash
    requested = {
        item["tank"]: (item["heights_m"], set(truth_data["methods"]))
        for item in truth_data["tanks"]
    }
    problems, participants = list(log.problems), []
    for folder in folders:
        folder_log = Log()
        answers = read_answers(folder, requested, folder_log)
        if answers is not None and answers.saved.participant.package != truth_sha256:
            folder_log.problem(
                ANSWERS.file if (Path(folder) / ANSWERS.file).is_file() else PARTICIPANT,
                _other_package(answers.saved.participant.package, truth_sha256),
            )
        problems += [_add_folder(folder, item, folders) for item in folder_log.problems]
        if answers is not None:
            warnings = [_add_folder(folder, item, folders) for item in answers.warnings]
            participants.append(replace(answers, warnings=tuple(warnings)))
    if problems:
        raise InputError(problems)
    return score(participants, truth_data, truth_sha256, coverage)


def _other_package(promised, own):
    """Message that answers refer to another package."""
    return message(
        "ic_other_package",
        "the answers are to the package with truth_sha256 {promised}, the truth has {own}: it was "
        "changed, or belongs to another package",
        promised=promised,
        own=own,
    )


def _add_folder(folder, problem, folders):
    """Problem with the folder before its file name if several folders are scored."""
    if len(folders) < 2:
        return problem
    return replace(problem, file=f"{Path(folder).resolve().name}/{problem.file}")


EVERY = "*"  # replaces the method in scores of all methods
DELIVERIES_M = (0.01, 0.1, 2.0)  # differences of height of the scored deliveries
FEWEST_ROWS = 4  # least number of rows for the fit of zero and scale
BOUNDS = 0.95  # probability between the exact bounds


def score(participants, truth, truth_sha256, coverage=0.95):
    """Score the answers of several participants.

    Parameters
    ----------
    participants : sequence of Answers
        Answers of each participant.
    truth : dict
        Plain data of `package.load_truth`.
    truth_sha256 : str
        SHA-256 of the truth file.
    coverage : float
        Requested coverage probability of U.

    Returns
    -------
    ScoresFile
    """
    true = {item["tank"]: item for item in truth["tanks"]}
    tables = [
        score_table(number, answer, true[answer.tank])
        for number, item in enumerate(participants)
        for answer in item.saved.answers
    ]
    order = {method: i for i, method in enumerate([*truth["methods"], EVERY])}
    methods = []
    for participant in range(len(participants)):
        tables_of_participant = [item for item in tables if item.participant == participant]
        for method in order:
            tables_of_method = [
                item for item in tables_of_participant if method in (item.method, EVERY)
            ]
            asked = len(true) * (len(truth["methods"]) if method == EVERY else 1)
            if tables_of_method:
                methods.append(score_method(participant, method, tables_of_method, asked))
    return ScoresFile(
        tankcal=find_version(),
        truth_sha256=truth_sha256,
        coverage_probability=coverage,
        participants=[item.saved.participant for item in participants],
        tables=sorted(tables, key=lambda item: (item.participant, item.tank, order[item.method])),
        methods=methods,
        warnings=warnings_of([w for item in participants for w in item.warnings]),
    )


def score_table(participant, answer, true):
    """Score one table of answers.

    Parameters
    ----------
    participant : int
        Index of the participant.
    answer : Answer
        Answers for one survey.
    true : dict
        The tank in the truth file.

    Returns
    -------
    ScoredTable
    """
    requested_m, assigned = np.array(true["heights_m"]), np.array(true["volume_m3"])
    order = np.argsort(answer.height_m)
    height = np.array(answer.height_m, float)[order]
    # Index of the requested height of each row.
    at = np.argmin(np.abs(requested_m[:, None] - height), axis=0)
    volume, U, k = (
        np.array([np.nan if value is None else value for value in values], float)[order]
        for values in (answer.volume_m3, answer.U_m3, answer.k)
    )
    exact, error, full = assigned[at], volume - assigned[at], assigned[-1]
    reference = true["numerical_error_m3"]
    E_n = error / np.hypot(U, reference)
    zeta = error / np.hypot(U / k, reference)
    is_judged = np.isfinite(E_n)
    has_top = at[-1] == len(requested_m) - 1
    return ScoredTable(
        participant=participant,
        tank=answer.tank,
        method=answer.method,
        rows=ScoredRows(
            *(value.tolist() for value in (requested_m[at], exact, error, U, E_n, zeta))
        ),
        missing=len(requested_m) - len(height),
        top_error_ppm=float(1e6 * error[-1] / full) if has_top else None,
        top_E_n=float(E_n[-1]) if has_top and is_judged[-1] else None,
        rms_ppm=float(1e6 * _rms(error) / full),
        within=int(np.sum(np.abs(E_n[is_judged]) <= 1)),
        judged=int(is_judged.sum()),
        mean_U_ppm=_or_none(1e6 * _mean(U[np.isfinite(U)]) / full),
        rms_zeta=_or_none(_rms(zeta[np.isfinite(zeta)])),
        form=form_of(height, volume, exact, full),
    )


def form_of(height, volume, exact, full):
    """Determine errors of zero, scale, form and deliveries of a table.

    Parameters
    ----------
    height, volume, exact : ndarray, shape (n,)
        Ascending heights, m, answers and assigned values, m3.
    full : float
        Largest assigned value, m3.

    Returns
    -------
    TableForm
    """
    error = volume - exact
    zero = scale = form = None
    if len(height) >= FEWEST_ROWS:
        # error = zero + scale * volume + form; the form is the residual of the line.
        design = np.column_stack([np.ones(len(exact)), exact])
        (zero, scale), *_ = np.linalg.lstsq(design, error, rcond=None)
        form = float(1e6 * _rms(error - design @ [zero, scale]) / full)
        zero, scale = float(zero), float(1e6 * scale)
    small, larger, large = (_deliveries(height, volume, exact, step) for step in DELIVERIES_M)
    return TableForm(
        falling_rows=int(np.sum(np.diff(volume) <= 0)),
        zero_m3=zero,
        scale_ppm=scale,
        form_ppm=form,
        delivery_1cm_percent=_or_none(100 * _rms(small)),
        delivery_10cm_percent=_or_none(100 * _rms(larger)),
        delivery_2m_ppm=_or_none(1e6 * _rms(large)),
        worst_2m_ppm=float(1e6 * large[np.argmax(np.abs(large))]) if len(large) else None,
    )


def _deliveries(height, volume, exact, step):
    """Relative errors of the deliveries between rows whose heights differ by `step`."""
    low, high = np.nonzero(np.abs(height[None, :] - height[:, None] - step) <= SAME_M)
    true = exact[high] - exact[low]
    return (volume[high] - volume[low] - true) / true


def score_method(participant, method, tables, asked):
    """Score the tables of a participant for a method, or for all methods.

    Parameters
    ----------
    participant : int
        Index of the participant.
    method : str
        Method, or EVERY.
    tables : sequence of ScoredTable
        Scored tables of this participant and method.
    asked : int
        Number of requested tables.

    Returns
    -------
    MethodScore
    """
    tops = np.array([table.top_error_ppm for table in tables if table.top_error_ppm is not None])
    E_n = np.array([table.top_E_n for table in tables if table.top_E_n is not None])
    within = np.array([table.within for table in tables])
    judged = np.array([table.judged for table in tables])
    share, u_share = share_within(within, judged)
    good = int(np.sum(np.abs(E_n) <= 1))
    low, high = exact_bounds(good, len(E_n))
    return MethodScore(
        participant=participant,
        method=method,
        tables=len(tables),
        asked=asked,
        bias_ppm=_or_none(_mean(tops)),
        u_bias_ppm=float(np.std(tops, ddof=1) / np.sqrt(len(tops))) if len(tops) > 1 else None,
        rms_top_ppm=_or_none(_rms(tops)),
        rms_ppm=_pool_rms([table.rms_ppm for table in tables]),
        mean_U_ppm=_or_none(_mean(_drop_none(table.mean_U_ppm for table in tables))),
        share_within=share,
        u_share=u_share,
        tops_within=good,
        tops_judged=len(E_n),
        tops_low=low,
        tops_high=high,
        rms_zeta=_pool_rms([table.rms_zeta for table in tables]),
        form_ppm=_pool_rms([table.form.form_ppm for table in tables]),
        delivery_1cm_percent=_pool_rms([table.form.delivery_1cm_percent for table in tables]),
        delivery_10cm_percent=_pool_rms([table.form.delivery_10cm_percent for table in tables]),
        delivery_2m_ppm=_pool_rms([table.form.delivery_2m_ppm for table in tables]),
        falling_rows=sum(table.form.falling_rows for table in tables),
    )


def share_within(within, judged):
    """Share of rows with |E_n| <= 1, and its standard deviation over tables.

    Parameters
    ----------
    within, judged : ndarray of int, shape (tables,)
        Number of rows with |E_n| <= 1, and of all rows with an E_n.

    Returns
    -------
    share, sd : float or None
        None if not determined.

    Examples
    --------
    >>> import numpy as np
    >>> share_within(np.array([10, 5]), np.array([10, 10]))
    (0.75, 0.25)
    """
    has_rows = judged > 0
    within, judged = within[has_rows], judged[has_rows]
    if not len(judged):
        return None, None
    share, count = within.sum() / judged.sum(), len(judged)
    if count < 2:
        return float(share), None
    variance = count / (count - 1) * np.sum((within - share * judged) ** 2) / judged.sum() ** 2
    return float(share), float(np.sqrt(variance))


def exact_bounds(good, count):
    """Exact bounds of a probability, from `good` successes in `count` trials (Clopper and Pearson).

    Examples
    --------
    >>> [round(bound, 4) for bound in exact_bounds(5, 5)]
    [0.4782, 1.0]
    """
    if not count:
        return None, None
    tail = (1 - BOUNDS) / 2
    low = beta.ppf(tail, good, count - good + 1) if good else 0.0
    high = beta.ppf(1 - tail, good + 1, count - good) if good < count else 1.0
    return float(low), float(high)


def _drop_none(values):
    """Array of the values that are not None."""
    return np.array([value for value in values if value is not None], float)


def _pool_rms(values):
    """Root mean square of the values that are not None, or None."""
    return _or_none(_rms(_drop_none(values)))


def _mean(values):
    """Mean; nan for no values."""
    return float(np.mean(values)) if len(values) else np.nan


def _rms(values):
    """Root mean square; nan for no values."""
    return float(np.sqrt(np.mean(np.square(values)))) if len(values) else np.nan


def _or_none(value):
    """Value as float, or None if it is not finite."""
    return float(value) if np.isfinite(value) else None
