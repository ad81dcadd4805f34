"""Outcome of a job: `outcome.json` in its folder, written after each step, and its summary row.

It contains no time and no worker, so its bytes do not depend on the number of workers. An
interrupted batch continues from these files.
"""

import json
import os
from dataclasses import asdict, dataclass, field
from pathlib import Path

from tankcal.batch.asked import FOLDERS, STEPS
from tankcal.batch.kept_data import is_step
from tankcal.errors import InputError
from tankcal.record import manifest
from tankcal.report.batch.paper import STATUSES

JOBS, FILE, FORMAT = "jobs", "outcome.json", "tankcal-outcome/1"
FINAL = ("done", "unsound", "refused")  # statuses that the same input would give again
MOST_TOLD = 20  # largest number of saved problems and warnings of a step


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
        The first MOST_TOLD, in the form of `errors.problem_of`.
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

    def is_settled_for(self, keys):
        """Return whether all steps of {step: key} have current results."""
        for step, key in keys.items():
            if not self.is_settled(step, key):
                return False
            if step == "run" and self.steps[step].status != "done":
                return True  # the other steps need the results of the run
        return True


def folder_of(out, name):
    """Return the folder of a job in the folder of its batch."""
    return Path(out) / JOBS / name


def load_outcome(out, name):
    """Return the `Outcome` in the folder of a job; None if it is missing or invalid."""
    folder = folder_of(out, name)
    try:
        saved = json.loads((folder / FILE).read_bytes())
        if saved.get("format") != FORMAT:
            return None
        steps = {
            step: StepOutcome(**values) for step, values in saved["steps"].items() if step in STEPS
        }
        if not (isinstance(saved["name"], str) and isinstance(saved["source"], str)):
            return None
        whole = {step: outcome for step, outcome in steps.items() if is_step(outcome)}
        there = {
            step: outcome
            for step, outcome in whole.items()
            if _has_its_files(folder, step, outcome)
        }
        return Outcome(saved["name"], saved["source"], there)
    except (OSError, ValueError, LookupError, TypeError, AttributeError, RecursionError):
        return None


def _has_its_files(folder, step, outcome):
    """Return whether all files of a step still exist with the digests of SHA256SUMS."""
    if not outcome.files:
        return True
    place = folder / FOLDERS[step]
    try:
        listed = manifest.read_manifest(place)
    except InputError:
        return False
    return listed is not None and all(
        (place / name).is_file() and listed.digests.get(name) == manifest.digest_of(place / name)
        for name in outcome.files
        if name != manifest.FILE
    )


def save_outcome(out, outcome):
    """Write an outcome to the folder of its job, all or nothing."""
    steps = {step: asdict(outcome.steps[step]) for step in STEPS if step in outcome.steps}
    saved = {"format": FORMAT, "name": outcome.name, "source": outcome.source, "steps": steps}
    folder = folder_of(out, outcome.name)
    folder.mkdir(parents=True, exist_ok=True)
    write_whole(folder / FILE, json.dumps(saved, ensure_ascii=False, indent=1) + "\n")


def write_whole(path, text):
    """Write a text file to the disk by replacing it with a complete temporary file."""
    waiting = path.with_name(f".{path.name}.{os.getpid()}.tmp")
    try:
        with waiting.open("w", encoding="utf-8", errors="replace", newline="\n") as file:
            file.write(text)
            file.flush()
            os.fsync(file.fileno())
        waiting.replace(path)
    finally:
        waiting.unlink(missing_ok=True)


def known_names(out):
    """Return {source: name} of the jobs in the folder of a batch."""
    names = {}
    try:
        folder_names = sorted(folder.name for folder in (Path(out) / JOBS).iterdir())
    except OSError:
        return names
    for name in folder_names:
        outcome = load_outcome(out, name)
        if outcome is not None and outcome.name == name:
            names[outcome.source] = name
    return names
