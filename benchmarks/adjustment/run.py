"""Adjustment against C++ Ceres: the same problems, interleaved, correctness beside time.

    make -C benchmarks/adjustment          (needs Debian's libceres-dev)
    OPENBLAS_NUM_THREADS=1 python benchmarks/adjustment/run.py [a b c d] [--repeats 5]

a, b: networks of sim_tank.py; c: "Bundle Adjustment in the Large", Ladybug 16-22106. Both are read
from the shared data ($TANKCAL_DATA, else ../shared). Ours is the public call, checks and results
included, loops compiled before; Ceres is Solve() and Covariance with its defaults (and once with a
wide trust region), the problem already built. d: 200 photos, 20 000 points, ours alone, on two
threads of BLAS: time and peak memory (large.py).
"""

import argparse
import bz2
import json
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from statistics import median

import numpy as np
import problems

from tankcal.survey.network import adjust

HERE = Path(__file__).resolve().parent
SHARED = Path(os.environ.get("TANKCAL_DATA", HERE.parents[2] / "shared"))
SIZES = {
    "a": (),
    "b": ("--stations", "60", "--points", "3000"),
    "d": ("--stations", "200", "--points", "20000"),
}
BAL = SHARED / "data" / "bal-16-22106" / "problem-16-22106-pre.txt.bz2"


class Peer:
    """A running ceres_peer: one command, one answer."""

    def __init__(self, kind, path):
        command = [HERE / "build" / "ceres_peer", kind, path]
        self.process = subprocess.Popen(
            command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
        )

    def ask(self, line):
        """The answer to a command, a dict."""
        self.process.stdin.write(line + "\n")
        self.process.stdin.flush()
        return json.loads(self.process.stdout.readline())


def made(name, folder):
    """The survey and the running peer of a problem."""
    if name == "c":
        text = folder / "bal.txt"
        text.write_bytes(bz2.decompress(BAL.read_bytes()))
        return problems.bal(BAL), Peer("bal", text)
    simulate(name, folder)
    return problems.tank(dict(np.load(folder / f"{name}.npz"))), Peer(
        "tank", folder / f"{name}.bin"
    )


def simulate(name, folder):
    """Write a network of sim_tank.py."""
    make = [sys.executable, SHARED / "bench" / "sim_tank.py", folder / name, *SIZES[name]]
    subprocess.run(make, check=True, stdout=subprocess.DEVNULL)


def large(name, folder):
    """The large network in its own process, on two threads."""
    simulate(name, folder)
    command = [sys.executable, HERE / "large.py", folder / f"{name}.npz"]
    environment = {**os.environ, "OPENBLAS_NUM_THREADS": "2"}
    answer = subprocess.run(
        command, check=True, stdout=subprocess.PIPE, text=True, env=environment
    ).stdout
    print(f"\n{name}: a large network, ours alone")
    for key, value in json.loads(answer).items():
        print(f"{key:26}{value:14.6g}")


def ours(name, survey):
    """Times, cost and trace of one run through the public call."""
    begin = time.perf_counter()
    adjusted = adjust(survey, datum="inner" if name == "c" else "control")
    solved = time.perf_counter()
    trace = np.nan
    if name == "a":
        trace = np.trace(adjusted.covariance_m2())
    if name == "b":
        trace = np.trace(adjusted.point_covariances_m2, axis1=1, axis2=2).sum()
    done = time.perf_counter()
    return solved - begin, done - solved, 0.5 * adjusted.solution.chi2, trace


def compare(name, repeats, solver, folder):
    """One row of the table for each program."""
    survey, peer = made(name, folder)
    ours(name, survey)  # compile
    kind = {"a": "full", "b": "marginal"}.get(name)
    mine, defaults, wide, covariances = [], [], [], []
    for turn in range(repeats):
        mine.append(ours(name, survey))
        defaults.append(peer.ask(f"solve {solver} 0 0"))
        wide.append(peer.ask(f"solve {solver} 1e10 0"))
        if kind == "full" or (kind and turn == 0):  # of b: half a minute each
            covariances.append(peer.ask(f"covariance {kind}"))
    solve, covariance = (median(run[i] for run in mine) for i in (0, 1))
    found = {
        "tankcal": (solve, covariance if kind else np.nan, mine[-1][2], mine[-1][3]),
    }
    for label, runs in (("Ceres, defaults", defaults), ("Ceres, wide trust region", wide)):
        c = median(run["seconds"] for run in covariances) if kind else np.nan
        trace = covariances[-1]["trace"] if kind else np.nan
        found[label] = (median(r["seconds"] for r in runs), c, runs[-1]["cost"], trace)
    print(f"\n{name}: median of {repeats} interleaved runs, Ceres with {solver}")
    print(f"{'':26}{'solve ms':>10}{'ratio':>7}{'cov ms':>11}{'ratio':>9}  cost, trace m2")
    for label, (s, c, cost, trace) in found.items():
        print(
            f"{label:26}{1e3 * s:10.2f}{s / solve:7.2f}{1e3 * c:11.2f}{c / covariance:9.1f}"
            f"  {cost:.10e} {trace:.10e}"
        )
    if kind:
        total = found["Ceres, defaults"]
        print(
            f"both together, Ceres' defaults over ours: {sum(total[:2]) / (solve + covariance):.2f}"
        )
        print(f"traces agree to {abs(found['tankcal'][3] / total[3] - 1):.1e}")


def main():
    """Read the arguments and print the tables."""
    os.environ["TANKCAL_COMPILED"] = "1"
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("problems", nargs="*", default=["a", "b", "c", "d"])
    parser.add_argument("--repeats", type=int, default=5)
    parser.add_argument("--solver", default="DENSE_SCHUR", help="Ceres' fastest here")
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        for name in given.problems:
            if name == "d":
                large(name, Path(folder))
                continue
            repeats = max(given.repeats, 41) if name == "a" else given.repeats
            compare(name, repeats, given.solver, Path(folder))


if __name__ == "__main__":
    main()
