"""Summary of a batch: one row per job with the changes since the last batch, and its files.

It contains no time and no worker: the same jobs give the same bytes for any number of workers and
interruptions.
"""

import json
import tempfile
from pathlib import Path

import tankcal
from tankcal.products.batch.options import FOLDERS
from tankcal.products.batch.outcomes import JOBS, is_summary_row, load_outcome
from tankcal.report.batch import JSON, summary_files

VALUES = (
    *("tank", "kind", "date", "height_m", "volume_m3", "U_m3", "global_test", "rule"),
    *("rule_verdict", "comparison_verdict", "inspection_verdict"),
)
VERDICTS = ("global_test", "rule_verdict", "comparison_verdict", "inspection_verdict")
PAPERS = (  # in order of priority: the summary links to the first
    *("certificate.pdf", "report.pdf", "comparison.pdf", "inspection.pdf", "capacity.xlsx"),
    *("capacity.csv", "record.json"),
)
MOST_REPORTED = 1  # problems and warnings of a job in the summary


def write_summary(out, jobs, language):
    """Write the summary of the jobs into the folder of their batch.

    Parameters
    ----------
    out : path
    jobs : list of finding.BatchJob
    language : str

    Returns
    -------
    rows : list of dict
    files : list of Path
    """
    out = Path(out)
    former = _former_rows(out / JSON)
    rows = []
    for job in jobs:
        row = _row(out, job)
        row["changes"] = None if former is None else find_changes(row, former.get(job.name))
        rows.append(row)
    names = {row["name"] for row in rows}
    steps = dict.fromkeys(step for job in jobs for step in job.options.steps)
    summary = {
        "format": "tankcal-batch/1",
        "tankcal": tankcal.__version__,
        "do": [*steps],
        "rows": rows,
        "gone": sorted(set(former or ()) - names),
    }
    with tempfile.TemporaryDirectory(prefix=".tankcal-", dir=out / JOBS) as folder:
        files = summary_files(summary, language, Path(folder))
        for name in files:
            (Path(folder) / name).replace(out / name)
    return rows, [out / name for name in files]


def _former_rows(path):
    """Return {name: row} of the last summary; None if it is missing or invalid."""
    try:
        rows = json.loads(path.read_bytes())["rows"]
        return {row["name"]: row for row in rows} if all(map(is_summary_row, rows)) else None
    except (OSError, ValueError, LookupError, TypeError, RecursionError):
        return None


def _row(out, job):
    """Return the summary row of a job, from its outcome only."""
    outcome, steps = load_outcome(out, job.name), job.options.steps
    row = {"name": job.name, "source": job.source, "status": "failed", **dict.fromkeys(VALUES)}
    problems, warnings, papers, counts = [], [], [], [0, 0]
    for step in () if outcome is None else steps:
        done = outcome.steps.get(step)
        if done is None:
            continue
        row |= {key: done.values[key] for key in VALUES if done.values.get(key) is not None}
        problems += done.problems[:MOST_REPORTED]
        warnings += done.warnings[:MOST_REPORTED]
        counts[0] += done.problem_count
        counts[1] += done.warning_count
        papers += [f"{JOBS}/{job.name}/{FOLDERS[step]}/{name}" for name in done.files]
    if outcome is not None:
        row["status"] = outcome.status(steps)
    best = [paper for name in PAPERS for paper in papers if paper.endswith(f"/{name}")]
    return row | {
        "problems": problems[:MOST_REPORTED],
        "problem_count": counts[0],
        "warnings": warnings[:MOST_REPORTED],
        "warning_count": counts[1],
        "papers": [*best, *(paper for paper in papers if paper not in best)][:1],
    }


def find_changes(row, former):
    """Return the differences from the row of the last batch.

    Parameters
    ----------
    row, former : dict
        former None: the last batch did not contain the job.

    Returns
    -------
    list of dict
        {"code", ...}: "first"; "status" and verdicts with "old" and "new"; "height_m"; "volume_m3"
        with "by_m3" and "U_m3", the larger of the two U.

    Examples
    --------
    >>> from tankcal.products.batch.summary import find_changes
    >>> row = {"status": "done", "height_m": 9.5, "volume_m3": 100.5, "U_m3": 0.2}
    >>> find_changes(row, row | {"volume_m3": 100.25})
    [{'code': 'volume_m3', 'by_m3': 0.25, 'U_m3': 0.2}]
    """
    if former is None:
        return [{"code": "first"}]
    changes = []
    for key in ("status", *VERDICTS):
        old, new = former.get(key), row.get(key)
        if old != new:
            changes.append({"code": key, "old": old, "new": new})
    if former.get("height_m") != row.get("height_m"):
        changes.append({"code": "height_m"})
    volumes = [summary_row.get("volume_m3") for summary_row in (former, row)]
    if None not in volumes and volumes[0] != volumes[1]:
        most = max(former.get("U_m3") or 0.0, row.get("U_m3") or 0.0)
        changes.append({"code": "volume_m3", "by_m3": volumes[1] - volumes[0], "U_m3": most})
    return changes
