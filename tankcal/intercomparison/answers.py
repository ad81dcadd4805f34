"""Answers: empty forms, and answers of any program read with all their problems at once."""

import csv
import io
import json
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.stats import norm

from tankcal.job.contract.shorthand import choice, number, positive
from tankcal.job.entries import read_columns, read_section, unknown_section
from tankcal.job.fields import Field
from tankcal.job.folder import MAX_SETTINGS_BYTES, declared_marks, read_csv, read_toml
from tankcal.job.tables import SEPARATORS, nearest, read_bytes
from tankcal.messages import list_some, message
from tankcal.record.intercomparison import ANSWERS, Answer, AnswersFile, Participant
from tankcal.text.decoding import find_encoding

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
SAME_M = 1e-6  # heights that are one
MOST_NAMED = 5
MOST_TIMES = 4  # as many rows as heights that were asked: beyond it one line says so
ABOUT = (
    message(
        "ic_about_participant",
        "Who answers, with what. Tables with ; and decimal commas: say so under [csv].",
    ),
    message("ic_about_readme", "The formats: README.md of the package"),
)


@dataclass(frozen=True)
class Answers:
    """What a participant handed in, checked against what was asked.

    saved    AnswersFile        folder  its name        warnings  Problems that stop nothing
    """

    saved: AnswersFile
    folder: str
    warnings: tuple


def file_of(tank, method):
    """Name of the table of a survey."""
    return f"{tank}_{method}.csv"


# ---- written


def template_files(manifest, said=str):
    """{name: bytes} of empty forms for every survey of a package.

    said  said(message) gives a comment in the language of whoever fills it in
    """
    lines = [*(f"# {said(one)}" for one in ABOUT), "", "[participant]"]
    for one in KEYS:
        value = manifest["truth_sha256"] if one.name == "package" else ""
        value = "2026-01-31" if one.kind == "date" else _quoted(value)
        lines.append(f"{'' if one.required else '# '}{one.name} = {value}  # {said(one.note)}")
    lines += ["", "# [csv]", '# separator = ";"', '# decimal = ","', ""]
    files = {PARTICIPANT: "\n".join(lines).encode()}
    heights = {one["tank"]: one["heights_m"] for one in manifest["tanks"]}
    for job in manifest["jobs"]:
        rows = [[f"{height:g}", "", "", ""] for height in heights[job["tank"]]]
        files[file_of(job["tank"], job["method"])] = _table(rows)
    return files


def answer_files(saved):
    """{name: bytes} of an AnswersFile: what any program may write."""
    who = saved.participant
    lines = ["[participant]"]
    for one in KEYS:
        value = getattr(who, one.name)
        if value is not None:
            lines.append(f"{one.name} = {value}" if one.kind == "date" else
                         f"{one.name} = {_quoted(value)}")  # fmt: skip
    files = {PARTICIPANT: ("\n".join(lines) + "\n").encode()}
    for one in saved.answers:
        columns = zip(one.height_m, one.volume_m3, one.U_m3, one.k, strict=True)
        rows = [[f"{height:g}", *map(_cell, rest)] for height, *rest in columns]
        files[file_of(one.tank, one.method)] = _table(rows)
    return files


def _table(rows):
    stream = io.StringIO()
    csv.writer(stream, lineterminator="\n").writerows(
        [[one.name for one in ROWS if one.name != "coverage"], *rows]
    )
    return stream.getvalue().encode()


def _cell(value):
    return "" if value is None or not np.isfinite(value) else f"{value:.9g}"


def _quoted(text):
    return json.dumps(text, ensure_ascii=False)


# ---- read


def read_answers(folder, asked, log):
    """The `Answers` of a folder; None after telling `log` all that is wrong.

    asked  {tank: heights} of the truth or the manifest, and methods of each: {tank: (heights, set
           of methods or None)}
    """
    folder, before = Path(folder), len(log.problems)
    if not folder.is_dir():
        log.problem(str(folder.name or folder), message("ic_no_folder", "not found; expected a "
                    "folder of answers with participant.toml and tables"))  # fmt: skip
        return None
    warnings = _Told(log)
    if (folder / ANSWERS.file).is_file():
        saved = _read_json(folder / ANSWERS.file, asked, log, warnings)
    else:
        saved = _read_tables(folder, asked, log, warnings)
    if saved is not None and not saved.answers and len(log.problems) == before:
        log.problem(folder.name, message("ic_no_answers", "no volume in any table; expected the "
                    "answers of one survey at least"))  # fmt: skip
    if len(log.problems) > before:
        return None
    return Answers(saved, folder.resolve().name, tuple(log.warnings[warnings.first :]))


class _Told:
    """Where the warnings of one folder begin in a log."""

    def __init__(self, log):
        self.first = len(log.warnings)


def _read_tables(folder, asked, log, warnings):
    participant, marks = _participant(folder / PARTICIPANT, log)
    known = {
        file_of(tank, method): (tank, method)
        for tank, (_, methods) in asked.items()
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
        found = _read_table(path, *known[path.name], asked, marks, log)
        if found is not None:
            answers.append(found)
    return AnswersFile(participant, answers) if participant else None


def _participant(path, log):
    """(Participant or None, (separator, decimal mark) or None) of participant.toml."""
    before, data = len(log.problems), read_bytes(path, log, MAX_SETTINGS_BYTES)
    settings, sections = (None, {}) if data is None else read_toml(path.name, data, log)
    if settings is None:
        return None, None
    for section in settings:
        if section not in SECTIONS:
            text = unknown_section(section, SECTIONS)
            log.problem(path.name, text, sections.get(section), f"[{section}]")
    found = {
        name: read_section(path.name, name, fields, settings.get(name, {}), sections.get(name), log)
        for name, fields in SECTIONS.items()
    }
    marks = declared_marks(path.name, settings, log)
    if len(log.problems) > before:
        return None, marks
    values = found["participant"]
    day = values["date"]
    return Participant(**values | {"date": None if day is None else str(day)}), marks


def _read_table(path, tank, method, asked, marks, log):
    """The Answer of a table; None where it is empty or wrong."""
    before, data = len(log.problems), read_bytes(path, log)
    if data is None:
        return None
    marks = marks or _likely_marks(data)
    table = read_csv(path.name, data, *marks, log, settings_file=PARTICIPANT)
    if table is None or _has_too_many(path.name, len(table.rows), asked[tank][0], log):
        return None
    values = read_columns(None, table, log, ROWS)
    if "volume_m3" not in table.headings:
        text = message("ic_no_volumes", "missing column; expected volumes in cubic metres")
        log.problem(path.name, text, table.heading_row, "volume_m3")
    if len(log.problems) > before:
        return None
    height, volume, U, k, coverage = (values.numbers(one.name) for one in ROWS)
    k = _factors(path.name, values.rows, U, k, coverage, log)
    _check_heights(path.name, values.rows, height, asked[tank][0], log)
    given = np.isfinite(volume)
    for row, is_given, spread in zip(values.rows, given, U, strict=True):
        if not is_given and np.isfinite(spread):
            text = message("ic_U_alone", "an uncertainty without a volume; expected both")
            log.problem(path.name, text, row, "U_m3")
    if len(log.problems) > before:
        return None
    _tell_missing(path.name, height[given], asked[tank][0], log)
    if not given.any():
        return None
    if np.any(np.isfinite(U) & ~np.isfinite(k)):
        text = message("ic_no_k", "U_m3 without k or coverage in some rows: they have E_n, no zeta")
        log.warning(path.name, text)
    columns = (one[given].tolist() for one in (height, volume, U, k))
    return Answer(tank, method, *columns)


def _likely_marks(data):
    """(separator, decimal mark) of a table whose participant.toml cannot be read: told already."""
    text = data.decode(find_encoding(data), "replace")
    heading = text.partition("\n")[0]
    separator = next((one for one in SEPARATORS[1:] if one in heading), SEPARATORS[0])
    return separator, "," if separator != "," and "," in text else "."


def _factors(name, rows, U, k, coverage, log):
    """Coverage factors: as stated, or of the stated probability of a normal distribution."""
    for row, factor, share in zip(rows, k, coverage, strict=True):
        if np.isfinite(factor) and np.isfinite(share):
            text = message("ic_k_twice", "k and coverage both given; expected one of them")
            log.problem(name, text, row, "coverage")
    found = np.where(np.isfinite(coverage), norm.ppf((1 + np.nan_to_num(coverage)) / 2), k)
    return np.where(np.isfinite(U), found, np.nan)


def _has_too_many(name, count, asked, log):
    """Whether, told to `log`, there are so many rows that to name each would help nobody."""
    if count <= MOST_TIMES * len(asked):
        return False
    text = message("ic_too_many_rows", "{count} rows; expected {asked} at most, one for each "
                   "height that is asked", count=count, asked=len(asked))  # fmt: skip
    log.problem(name, text)
    return True


def _check_heights(name, rows, height, asked, log):
    """Heights are those that are asked, each once."""
    wanted, seen = np.asarray(asked), {}
    for row, one in zip(rows, height, strict=True):
        near = int(np.argmin(np.abs(wanted - one)))
        if abs(wanted[near] - one) > SAME_M:
            text = message("ic_not_asked", "{height:g} m was not asked; the nearest height that was"
                           " is {near:g} m", height=one, near=wanted[near])  # fmt: skip
            log.problem(name, text, row, "height_m")
        elif near in seen:
            text = message("ic_height_twice", "{height:g} m stands in row {first}, too; expected "
                           "each height once", height=one, first=seen[near])  # fmt: skip
            log.problem(name, text, row, "height_m")
        else:
            seen[near] = row


def _tell_missing(name, height, asked, log):
    """A warning that names heights without a volume."""
    missing = [one for one in asked if not np.any(np.abs(height - one) <= SAME_M)]
    if missing:
        text = message(
            "ic_missing_heights", "{missing} of {asked} heights without a volume ({heights})",
            missing=len(missing), asked=len(asked),
            heights=list_some(
                [message("ic_height", "{height:g} m", height=one) for one in missing], MOST_NAMED
            ),
        )  # fmt: skip
        log.warning(name, text)


# ---- answers.json


def _read_json(path, asked, log, warnings):
    from tankcal.intercomparison.package import load_saved

    found = load_saved(ANSWERS, path, log)
    if found is None:
        return None
    before, answers, seen = len(log.problems), [], set()
    for one in found["answers"]:
        name = f"{path.name}, {one['tank']} {one['method']}"
        lengths = {len(one[key]) for key in ("height_m", "volume_m3", "U_m3", "k")}
        place = one["tank"], one["method"]
        if one["tank"] not in asked or one["method"] not in asked[one["tank"]][1]:
            log.problem(name, message("ic_unknown_survey", "no such survey in the package"))
        elif place in seen:
            log.problem(name, message("ic_survey_twice", "answered twice; expected once"))
        elif len(lengths) > 1:
            log.problem(name, message("ic_uneven", "lists of different lengths; expected a value "
                        "(or null) for each height"))  # fmt: skip
        elif not _has_too_many(name, len(one["height_m"]), asked[one["tank"]][0], log):
            U, k = (_checked_positive(name, key, one[key], log) for key in ("U_m3", "k"))
            height = np.array(one["height_m"], float)
            _check_heights(name, range(1, len(height) + 1), height, asked[one["tank"]][0], log)
            _tell_missing(name, height, asked[one["tank"]][0], log)
            if len(height):
                answers.append(Answer(*place, one["height_m"], one["volume_m3"], U, k))
        seen.add(place)
    if len(log.problems) > before:
        return None
    return AnswersFile(Participant(**found["participant"]), answers)


def _checked_positive(name, key, values, log):
    found = np.array([np.nan if one is None else one for one in values], float)
    if np.any(found <= 0):
        log.problem(name, message("ic_not_positive", "a value of 0 or below; expected above 0, or "
                    "null"), None, key)  # fmt: skip
    return found.tolist()
