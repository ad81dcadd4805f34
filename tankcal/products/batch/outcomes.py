"""Steps and options of the jobs of a batch, and the outcome of each job after its steps.

`outcome.json` in the folder of a job is written after each step. It contains no time and no
worker, so its bytes do not depend on the number of workers. An interrupted batch continues from
these files.
"""

import json
import os
from dataclasses import asdict, dataclass, field, replace
from functools import cache
from math import isfinite
from os.path import exists
from pathlib import Path

from tankcal.errors import InputError, Problem
from tankcal.messages import message
from tankcal.record import manifest
from tankcal.report.batch import OF_RULE, STATUSES
from tankcal.report.folders import replace_file
from tankcal.text.words import load_words

STEPS = ("run", "report", "compare", "inspect", "upkeep", "export")  # in their order
FOLDERS = {
    "run": "results",
    "report": "report",
    "compare": "comparison",
    "inspect": "inspection",
    "export": "export",
    "upkeep": "upkeep",
}


@dataclass(frozen=True)
class Options:
    """Steps to run for each job, and their options.

    Attributes
    ----------
    steps : tuple of str
        Some of STEPS, in their order.
    papers : bool
        False: `run` writes the record and the CSV files only.
    language : str or None
        Language of the output of `report`, `compare` and `inspect`. None: language of the job.
    letterhead : str or None
        Path of the letterhead file for the reports.
    former : str or None
        A former table, or a folder of former tables named after the jobs.
    compare_by, inspect_by : str or None
        Names or files of the rules.
    profile : str or None
        Name or file of the profile for `export`.
    """

    steps: tuple[str, ...] = ("run",)
    papers: bool = True
    language: str | None = None
    letterhead: str | None = None
    former: str | None = None
    compare_by: str | None = None
    inspect_by: str | None = None
    profile: str | None = None

    def override(self, overrides):
        """Return a copy with the options of one job, {name: text}; blank texts are ignored."""
        return replace(self, **{name: text for name, text in overrides.items() if text})

    def absolute(self):
        """Return a copy with absolute paths of existing files, for use in other processes."""
        texts = {name: getattr(self, name) for name in FILES}
        paths = {
            name: os.path.abspath(path) for name, path in texts.items() if path and exists(path)
        }
        return replace(self, **paths)


FILES = ("letterhead", "former", "compare_by", "inspect_by", "profile")
# Options that a list of jobs may state for each job, in columns of these names.
LIST_OPTIONS = ("former", "compare_by", "inspect_by", "profile", "language")


def parse_steps(text):
    """Return the steps named in a text such as "run,export", in the order of STEPS.

    Raises InputError for unknown names.

    Examples
    --------
    >>> from tankcal.products.batch.outcomes import parse_steps
    >>> parse_steps("export, run")
    ('run', 'export')
    """
    names = [part.strip() for part in text.split(",") if part.strip()]
    unknown = [name for name in names if name not in STEPS]
    if unknown or not names:
        expected = message(
            "batch_steps",
            "found {text!r}; expected one or more of {steps}, separated by commas",
            text=text[:60],
            steps=[*STEPS],
        )
        raise InputError(Problem("--do", expected))
    if "upkeep" in names and not {"upkeep", "export"}.issuperset(names):
        text = message("batch_upkeep_alone", "found {text!r}; expected upkeep, alone or with "
                       "export: its input are folders with upkeep.toml",
                       text=text[:60])  # fmt: skip
        raise InputError(Problem("--do", text))
    return tuple(step for step in STEPS if step in names)


def refuse_incomplete(options, jobs):
    """Raise InputError if a job lacks the former table or the profile that a step requires."""
    former = message(
        "batch_needs_former",
        "missing; compare requires a former table: a file, a folder of tables, or a column "
        "former in the list of jobs",
    )
    profile = message(
        "batch_needs_profile",
        "missing; export requires a profile that tankcal export --list shows, or a .toml file",
    )
    needed = (
        ("compare", "former", "--former", former),
        ("export", "profile", "--profile", profile),
    )
    problems = [
        Problem(option, text)
        for step, name, option, text in needed
        if step in options.steps and any(getattr(job.options, name) is None for job in jobs)
    ]
    if problems:
        raise InputError(problems)


def refuse_unreadable(options):
    """Raise InputError for an invalid letterhead, rule or profile."""
    problems = []
    for check in (_check_letterhead, _check_profile, _check_rules):
        try:
            check(options)
        except InputError as error:
            problems += error.problems
    if problems:
        raise InputError(problems)


def _check_letterhead(options):
    """Raise InputError for an invalid letterhead file."""
    if options.letterhead is not None:
        from tankcal.report.laboratory import load

        load(options.letterhead)


def _check_profile(options):
    """Raise InputError for a profile that does not exist or is invalid."""
    if options.profile is not None and "export" in options.steps:
        from tankcal.products.exports.profiles import find_profile

        find_profile(options.profile)


def _check_rules(options):
    """Raise InputError for an invalid rule of `compare` or `inspect`."""
    from tankcal.job.tables import Log

    log = Log()
    if options.inspect_by is not None and "inspect" in options.steps:
        from tankcal.products.inspection.rules import find_rule

        find_rule(options.inspect_by, log)
    if options.compare_by is not None and "compare" in options.steps:
        from tankcal.job.rule_files import named_rule

        named_rule(options.compare_by, log)
    log.stop_if_problems()


JOBS, FILE, FORMAT = "jobs", "outcome.json", "tankcal-outcome/1"
FINAL = ("done", "unsound", "refused")  # statuses that the same input would give again
MOST_REPORTED = 20  # largest number of saved problems and warnings of a step
TEXTS = ("tank", "kind", "date", "rule", *OF_RULE)
NUMBERS = ("height_m", "volume_m3", "U_m3", "former_m3", "of_tank_m3")
PLACES = ("book", "column", "cell")
PASSED = "global_test"  # the only Boolean verdict


@dataclass(frozen=True)
class StepOutcome:
    """Outcome of one step.

    Attributes
    ----------
    key : str
        SHA-256 of all data that affect the step.
    status : str
        One of STATUSES: refused for its input, without valid solution, or failed for another
        reason. A failed step is repeated by the next batch.
    files : list of str
        Written files, below the folder of the job.
    values : dict
        Values for the summary.
    problems, warnings : list of dict
        The first MOST_REPORTED, in the form of `errors.problem_of`.
    problem_count, warning_count : int
        Number of all problems and warnings.
    """

    key: str
    status: str
    files: list = field(default_factory=list)
    values: dict = field(default_factory=dict)
    problems: list = field(default_factory=list)
    problem_count: int = 0
    warnings: list = field(default_factory=list)
    warning_count: int = 0


@dataclass(frozen=True)
class Outcome:
    """Outcome of a job: name, source, {step: StepOutcome}."""

    name: str
    source: str
    steps: dict = field(default_factory=dict)

    def is_settled(self, step, key):
        """Return whether a step has a final result for this key."""
        known = self.steps.get(step)
        return known is not None and known.key == key and known.status in FINAL

    def status(self, steps):
        """Return the worst status of some steps; steps not reached are ignored."""
        statuses = [self.steps[step].status for step in steps if step in self.steps]
        return max(statuses, key=STATUSES.index, default="failed")

    def result(self, steps):
        """Return the status, a list of at most one problem, and the number of all problems."""
        reached = [self.steps[step] for step in steps if step in self.steps]
        problems = [problem for step in reached for problem in step.problems]
        return self.status(steps), problems[:1], sum(step.problem_count for step in reached)

    def is_complete(self, keys):
        """Return whether all steps of {step: key} have current results."""
        for step, key in keys.items():
            if not self.is_settled(step, key):
                return False
            if step == "run" and self.steps[step].status != "done":
                return True  # the other steps need the results of the run
        return True


def job_folder(out, name):
    """Return the folder of a job in the folder of its batch."""
    return Path(out) / JOBS / name


def load_outcome(out, name, is_verified=True):
    """Return the `Outcome` in the folder of a job; None if it is missing or invalid.

    Steps without all of their files are left out; with `is_verified` also steps whose files have
    other digests than SHA256SUMS. That reads all results, so a batch does it once per job.
    """
    folder = job_folder(out, name)
    try:
        saved = json.loads((folder / FILE).read_bytes())
        if saved.get("format") != FORMAT:
            return None
        steps = {
            step: StepOutcome(**values) for step, values in saved["steps"].items() if step in STEPS
        }
        if not (isinstance(saved["name"], str) and isinstance(saved["source"], str)):
            return None
        valid = {
            step: outcome
            for step, outcome in steps.items()
            if _is_step(outcome) and _has_its_files(folder / FOLDERS[step], outcome, is_verified)
        }
        return Outcome(saved["name"], saved["source"], valid)
    except (OSError, ValueError, LookupError, TypeError, AttributeError, RecursionError):
        return None


def _has_its_files(place, outcome, is_verified):
    """Return whether all files of a step exist, with the digests of SHA256SUMS if `is_verified`."""
    if not all((place / name).is_file() for name in outcome.files):
        return False
    if not (outcome.files and is_verified):
        return True
    try:
        listed = manifest.read_manifest(place)
    except InputError:
        return False
    return listed is not None and all(
        listed.digests.get(name) == manifest.digest_of(place / name)
        for name in outcome.files
        if name != manifest.FILE
    )


def save_outcome(out, outcome):
    """Write an outcome to the folder of its job, all of it or none."""
    steps = {step: asdict(outcome.steps[step]) for step in STEPS if step in outcome.steps}
    saved = {"format": FORMAT, "name": outcome.name, "source": outcome.source, "steps": steps}
    folder = job_folder(out, outcome.name)
    folder.mkdir(parents=True, exist_ok=True)
    _write_whole(folder / FILE, json.dumps(saved, ensure_ascii=False, indent=1) + "\n")


def _write_whole(path, text):
    """Write a text file to the disk by replacing it with a complete temporary file."""
    with (
        replace_file(path) as waiting,
        waiting.open("w", encoding="utf-8", errors="replace", newline="\n") as file,
    ):
        file.write(text)
        file.flush()
        os.fsync(file.fileno())


def read_known_names(out):
    """Return {source: name} of the jobs in the folder of a batch."""
    names = {}
    try:
        folder_names = sorted(folder.name for folder in (Path(out) / JOBS).iterdir())
    except OSError:
        return names
    for name in folder_names:
        outcome = load_outcome(out, name, is_verified=False)
        if outcome is not None and outcome.name == name:
            names[outcome.source] = name
    return names


# ---- validation of the outcomes and summary rows of an earlier batch
#
# Users can edit both files. Invalid data are treated as missing: the job is computed again, and no
# change is reported.


def _is_step(step):
    """Return whether the attributes of a `StepOutcome` have valid types."""
    return (
        isinstance(step.key, str)
        and isinstance(step.status, str)
        and step.status in _codes("statuses")
        and isinstance(step.files, list)
        and all(isinstance(name, str) for name in step.files)
        and isinstance(step.values, dict)
        and _are_values(step.values)
        and all(isinstance(rows, list) for rows in (step.problems, step.warnings))
        and all(map(_is_problem, (*step.problems, *step.warnings)))
        and all(map(_is_count, (step.problem_count, step.warning_count)))
    )


def is_summary_row(row):
    """Return whether a row of a summary can be compared with another row."""
    return (
        isinstance(row, dict)
        and isinstance(row.get("name"), str)
        and isinstance(row.get("status"), str)
        and row["status"] in _codes("statuses")
        and _are_values(row)
    )


def _are_values(values):
    """Return whether the numbers, texts and verdicts among values are valid."""
    return (
        all(_is_number(values.get(name)) for name in NUMBERS)
        and all(_is_text(values.get(name)) for name in TEXTS if name != PASSED)
        and isinstance(values.get(PASSED), bool | None)
        and all(
            values.get(name) is None or values[name].lower() in _codes(words)
            for name, words in OF_RULE.items()
            if name != PASSED
        )
    )


def _is_problem(plain):
    """Return whether plain data have the form of `errors.problem_of`."""
    return (
        isinstance(plain, dict)
        and isinstance(plain.get("file"), str)
        and all(_is_text(plain.get(name)) for name in PLACES)
        and isinstance(plain.get("row"), int | None)
        and _is_message(plain)
    )


def _is_message(plain):
    """Return whether plain data contain a text with its code and with values that have words."""
    return (
        isinstance(plain.get("text"), str)
        and _is_text(plain.get("code"))
        and isinstance(plain.get("values"), dict)
        and all(map(_has_words, plain["values"].values()))
    )


def _has_words(value):
    """Return whether each message in a value, or in the lists in it, is valid."""
    if isinstance(value, list):
        return all(map(_has_words, value))
    return _is_message(value) if isinstance(value, dict) else True


def _is_number(value):
    is_number = isinstance(value, int | float) and not isinstance(value, bool)
    return value is None or (is_number and abs(value) < 1e300 and isfinite(value))


def _is_text(value):
    return isinstance(value, str | None)


def _is_count(value):
    return isinstance(value, int) and not isinstance(value, bool) and value >= 0


@cache
def _codes(words):
    """Return the codes of the summary with words: of "statuses" or of a verdict."""
    return frozenset(load_words("en")["batch"][words])
