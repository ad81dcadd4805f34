"""Time and memory of the main job, each command in a process of its own, median of five or $ROUNDS.

    python benchmarks/main_job.py [JOB]        (default: the shipped example)

The goals: all outputs in under 10 s, --help in under 0.5 s, under 500 MB.
"""

import os
import resource
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
RUNS = int(os.environ.get("ROUNDS", 5))


def main(job):
    """Print a line for each command."""
    with tempfile.TemporaryDirectory() as folder:
        commands = {
            "tankcal --help": ["--help"],
            "tankcal run, all outputs": ["run", job, "--out", f"{folder}/results", "--quiet"],
        }
        for name, arguments in commands.items():
            seconds = [timed(arguments) for _ in range(RUNS)]
            print(f"{name}: {statistics.median(seconds):.2f} s (worst {max(seconds):.2f} s)")
    peak = resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss / 1024
    print(f"largest process: {peak:.0f} MB")


def timed(arguments):
    """Seconds of one tankcal command."""
    start = time.perf_counter()
    subprocess.run(
        [sys.executable, "-m", "tankcal", *arguments],
        check=True,
        stdout=subprocess.DEVNULL,
        env={**os.environ, "OPENBLAS_NUM_THREADS": "1"},
    )
    return time.perf_counter() - start


if __name__ == "__main__":
    main(sys.argv[1] if len(sys.argv) > 1 else str(ROOT / "examples" / "silva-1995"))
