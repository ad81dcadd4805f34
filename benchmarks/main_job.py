"""Processor time and memory of the main job, each command in a process of its own, in turns.

    python benchmarks/main_job.py [JOB]        (default: the shipped example)

The goals: all outputs in under 3 s, --help in under 0.5 s, under 500 MB; a report of 22 pages set
in 0.5 s. The last is that of the shipped example with more rows, in a process that has set nothing.
"""

import json
import os
import re
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from measured import ROOT, ROUNDS, Row, interleaved, tell


def main(job):
    """A row for each command."""
    memory = {}
    with tempfile.TemporaryDirectory() as folder:
        run = ["run", job, "--out", f"{folder}/results", "--quiet"]
        commands = {
            "tankcal --help": ["--help"],
            "tankcal run --no-papers": [*run, "--no-papers"],
            "tankcal run, all outputs": run,
        }
        spent = interleaved({
            name: lambda name=name, given=given: timed(given, memory, name)
            for name, given in commands.items()
        })  # fmt: skip
    for name, seconds in spent.items():
        tell(Row(name, Path(job).name, seconds, memory_mb=memory[name]))
    with tempfile.TemporaryDirectory() as folder:
        report_alone(folder)


REPORT_STEP = "step_m = 0.003"  # of the example's table: with it the report has 22 pages


def report_alone(folder):
    """A row for the PDF of a report, the notebook of which is there."""
    job, results = Path(folder) / "job", Path(folder) / "results"
    shutil.copytree(ROOT / "examples" / "silva-1995", job)
    text = (job / "job.toml").read_text(encoding="utf-8")
    changed = re.sub(r"^step_m = .*$", REPORT_STEP, text, count=1, flags=re.MULTILINE)
    (job / "job.toml").write_text(changed, encoding="utf-8")
    timed(["run", str(job), "--out", str(results), "--quiet"], {}, "")
    command = [sys.executable, __file__, "--set", str(results)]
    found = [json.loads(subprocess.check_output(command)) for _ in range(ROUNDS)]
    seconds, (pages, *_) = zip(*found, strict=True)
    tell(Row("report.pdf alone", f"{pages} pages", seconds))


def set_report(results):
    """Print seconds of processor and pages of the report, set in this process."""
    from nbformat import read

    from tankcal.report.document import blocks_of
    from tankcal.report.pdf import pdf

    notebook = read(Path(results) / "report.ipynb", as_version=4)
    start = time.process_time()
    made = pdf(blocks_of(notebook), results)
    print(json.dumps([time.process_time() - start, pages_of(made)]))


def pages_of(pdf):
    """How many pages a PDF has."""
    return int(re.search(rb"/Type\s*/Pages\s*/Count (\d+)", pdf)[1])


def timed(arguments, memory, name):
    """Seconds of processor of one tankcal command; its memory is kept."""
    command = [sys.executable, "-m", "tankcal", *arguments]
    environment = {**os.environ, "OPENBLAS_NUM_THREADS": "1"}
    child = subprocess.Popen(command, stdout=subprocess.DEVNULL, env=environment)
    _, status, used = os.wait4(child.pid, 0)
    if status:
        sys.exit(1)
    memory[name] = used.ru_maxrss / 1024
    return used.ru_utime + used.ru_stime


if __name__ == "__main__":
    if sys.argv[1:2] == ["--set"]:
        sys.exit(set_report(sys.argv[2]))
    main(sys.argv[1] if len(sys.argv) > 1 else str(ROOT / "examples" / "silva-1995"))
