"""Runs the benchmarks one after the other, keeps their results as data, tells which ratios fell.

    python benchmarks/run.py [NAME ...]        (default: all; NAME as in BENCHMARKS)

Results go to build/benchmarks.json; `page.py` makes the tables of docs/studies/benchmarks.md of
them. The exit status is 1 where a benchmark failed or tankcal gave a wrong answer. A ratio that
fell against the last release (guard.py) is told and changes no status: a clock is no proof.
"""

import datetime
import importlib.metadata
import json
import os
import platform
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from guard import RELEASED, fallen
from measured import ROOT, ROUNDS, gathered, line_of, read
from threadpoolctl import threadpool_info

import tankcal

HERE = Path(__file__).resolve().parent
OUT = ROOT / "build" / "benchmarks.json"
BENCHMARKS = {
    "main_job": (),
    "strapping": (),
    "table": (),
    "volumes": (),
    "uncertainty": (),
    "monte_carlo": ("9500", str(ROUNDS)),
    "wall": (),
    "clouds": (),
    "cloud_cells": (),
    "cloud_peers": (),
    "cloud_readers": (),
    "workbook": (),
    "planning": (str(ROUNDS),),
    "exports": (),
    "ships": (),
    "writing": ("--runs", "1"),
    "app": (),
    "growth": (),
    "adjustment/run": (),
    "adjustment/network": (),
}


def main(names):
    """Run what is asked for, write the results and print them; the exit status."""
    begun, failed = now(), []
    with tempfile.TemporaryDirectory() as folder:
        kept = Path(folder) / "told.jsonl"
        kept.touch()
        environment = {**os.environ, "BENCHMARKS": str(kept), "OPENBLAS_NUM_THREADS": "1"}
        for name in names or BENCHMARKS:
            command = [sys.executable, str(HERE / f"{name}.py"), *BENCHMARKS[name]]
            if subprocess.run(command, env=environment).returncode:
                failed.append(name)
        told = gathered(kept.read_text(encoding="utf-8").splitlines())
    results = {
        "date": datetime.date.today().isoformat(),
        "version": tankcal.__version__,
        "rounds": ROUNDS,
        "machine": machine(),
        "others_cores": others(begun),
        **told,
    }
    OUT.parent.mkdir(exist_ok=True)
    OUT.write_text(json.dumps(results, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")
    return tell_all(results, failed)


def tell_all(results, failed):
    """Print the results, what was wrong and what fell; the exit status."""
    print("\nthe benchmarks\n" + named(results))
    found = read(results)
    for rows in found.values():
        for one in rows:
            print(line_of(one))
    wrong = sorted({one.name for one in found["rows"] if one.met[0] is False})
    for name in failed:
        print(f"failed: benchmarks/{name}.py")
    for name in wrong:
        print(f"wrong answer of tankcal: {name}")
    if RELEASED.exists():
        for line in fallen(results, json.loads(RELEASED.read_text(encoding="utf-8"))):
            print(line)
    return 1 if failed or wrong else 0


def named(results):
    """The machine, the versions and the day, on a line."""
    machine = results["machine"]
    busy = results["others_cores"]
    beside = "" if busy is None else f"; other programs took {busy:.1f} cores meanwhile"
    return (
        f"{results['date']}, tankcal {results['version']}, {machine['processor']}, "
        f"{machine['cores']} cores, {machine['kernel']}, "
        + ", ".join(f"{name} {version}" for name, version in machine["versions"].items())
        + beside
    )


def machine():
    """What the benchmarks run on, and with."""
    versions = {"Python": platform.python_version()}
    versions |= {name: importlib.metadata.version(name) for name in ("numpy", "scipy", "numba")}
    for one in threadpool_info():
        if one["user_api"] == "blas":
            versions["BLAS"] = f"{one['internal_api']} {one['version']}"
    return {
        "processor": processor(),
        "cores": os.cpu_count(),
        "kernel": f"{platform.system()} {platform.release().split('-')[0]}",
        "versions": versions,
    }


def processor():
    """The name of the processor, as the system has it."""
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        return platform.processor() or platform.machine()
    named = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    return named[0] if named else platform.machine()


def now():
    """(clock, processor of all programs, of these) in seconds; None where no system tells."""
    own = sum(
        used.ru_utime + used.ru_stime
        for used in map(resource.getrusage, (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))
    )
    try:
        fields = Path("/proc/stat").read_text(encoding="utf-8").split("\n")[0].split()[1:9]
    except OSError:
        return time.monotonic(), None, own
    user, nice, system, _, _, *interrupts = map(int, fields)
    busy = (user + nice + system + sum(interrupts)) / os.sysconf("SC_CLK_TCK")
    return time.monotonic(), busy, own


def others(begun):
    """Cores that other programs took since then, on the average; None where no system tells."""
    clock, busy, own = now()
    if busy is None:
        return None
    return round(max(0.0, (busy - begun[1] - (own - begun[2])) / (clock - begun[0])), 2)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
