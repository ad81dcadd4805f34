"""Processor time and memory of the main job, each command in a process of its own, in turns.

    python benchmarks/main_job.py [JOB]        (default: the shipped example)

The goals: all outputs in under 3 s, --help in under 0.5 s, under 500 MB.
"""

import os
import subprocess
import sys
import tempfile
from pathlib import Path

from measured import ROOT, Row, interleaved, tell


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
    main(sys.argv[1] if len(sys.argv) > 1 else str(ROOT / "examples" / "silva-1995"))
