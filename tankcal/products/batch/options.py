"""Steps and options of the jobs of a batch."""

import os
from dataclasses import dataclass, replace
from os.path import exists

from tankcal.errors import InputError, Problem
from tankcal.messages import message

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
    >>> from tankcal.products.batch.options import parse_steps
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
