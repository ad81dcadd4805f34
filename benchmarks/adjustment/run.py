"""Adjustment against Ceres, gtsam and scipy: the same problems, interleaved, right answers first.

    OPENBLAS_NUM_THREADS=1 python benchmarks/adjustment/run.py [a b c d] [--repeats 5]

a, b: networks of sim_tank.py; c: "Bundle Adjustment in the Large", Ladybug 16-22106. Both are read
from the shared data ($TANKCAL_DATA, else ../shared). Ours is the public call, checks and results
included, loops compiled before. Ceres in C++ (Debian's libceres-dev, automatic derivatives) is
Solve() and Covariance with its defaults, and once with a wide trust region; pyceres, gtsam and
scipy are in python_peers.py. The problems of all peers are already built. d: 200 photos, 20 000
points, ours alone, on two threads of BLAS: time and peak memory (large.py).
"""

import argparse
import bz2
import json
import os
import subprocess
import sys
import tempfile
import time
from functools import partial
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import numpy as np
import problems
from ceres import Ceres, built
from measured import ROUNDS, SHARED, Row, Skipped, digits_of, peer_module, tell
from python_peers import Gtsam, GtsamBal, Pyceres, Scipy

from tankcal.survey.network import adjust

HERE = Path(__file__).resolve().parent
SIZES = {
    "a": (),
    "b": ("--stations", "60", "--points", "3000"),
    "d": ("--stations", "200", "--points", "20000"),
}
BAL = SHARED / "data" / "bal-16-22106" / "problem-16-22106-pre.txt.bz2"
RIGHT = {  # cost, trace of the 3 x 3 covariances of all points in m2: three programs agree
    "a": (2.0725167112e02, 6.575062e-04),
    "b": (4.8840395382e04, 7.802723e-03),
    "c": (1.8033903479e04, None),
}
LEAST = 5.0  # digits of either
STEPS = {  # what is compared, its place in RIGHT
    "solve": ("cost", 0),
    "covariance of points": ("trace of the covariances", 1),
    "both": ("trace of the covariances", 1),
}
KIND = {"a": "full", "b": "marginal"}  # of the covariances of points
OFTEN = 41  # rounds of a, whose solutions take milliseconds
OFTEN_S, ONCE_S = 0.1, 3.0  # peers that take longer: $ROUNDS rounds, or once, with the answer


class Tankcal:
    """The public call on a survey."""

    name, covers = "tankcal", True

    def __init__(self, survey, datum):
        self.survey, self.datum = survey, datum
        self.adjusted = None

    def solve(self):
        """(seconds, cost)."""
        start = time.process_time()
        self.adjusted = adjust(self.survey, datum=self.datum)
        return time.process_time() - start, 0.5 * self.adjusted.solution.chi2

    def covariance(self, kind):
        """(seconds, trace of all points)."""
        start = time.process_time()
        if kind == "full":
            trace = np.trace(self.adjusted.covariance_m2())
        else:
            trace = np.einsum("nii->", self.adjusted.point_covariances_m2)
        return time.process_time() - start, float(trace)


def made(name, folder):
    """(tankcal on a problem, its peers that are there)."""
    if name == "c":
        text = folder / "bal.txt"
        text.write_bytes(bz2.decompress(BAL.read_bytes()))
        ours, kind, path = Tankcal(problems.bal(BAL), "inner"), "bal", text
        classes, given = {"gtsam": GtsamBal}, text
    else:
        simulate(name, folder)
        given = dict(np.load(folder / f"{name}.npz"))
        ours, kind, path = Tankcal(problems.tank(given), "control"), "tank", folder / f"{name}.bin"
        classes = {"pyceres": Pyceres, "gtsam": Gtsam, "scipy": Scipy}
    peers = []
    if wrong := built():
        tell(Skipped(f"adjustment {name}", "Ceres in C++", wrong))
    else:
        peers += [Ceres(kind, path), Ceres(kind, path, radius=1e10)]
    if name == "b":
        classes = {}
        for peer in ("pyceres", "gtsam"):
            tell(Skipped("adjustment b", peer, "53 643 readings by functions in Python"))
        tell(Skipped("adjustment b", "scipy least_squares", "8 GB for its dense Jacobian"))
    for package, make in classes.items():
        if found := peer_module(package, f"adjustment {name}"):
            peers.append(make(*found, given))
    return ours, peers


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
    found = json.loads(answer)
    size = f"{found['photos']} photos, {found['points']} points, {found['equations']} equations"
    for step in ("solve", "covariances"):
        note = f"two threads of BLAS, sigma0 {found['sigma0']:.5f}"
        tell(Row(f"adjustment {name}, {step}", size, (found[f"{step}_s"],),
                 memory_mb=found["peak_mb"], note=note))  # fmt: skip


def compare(name, repeats, folder):
    """A row for each step and peer: answers, then seconds."""
    ours, peers = made(name, folder)
    tasks = {}
    for one in (ours, *peers):
        tasks[one.name, "solve"] = one.solve
        if name in KIND and one.covers:
            tasks[one.name, "covariance of points"] = partial(one.covariance, KIND[name])
    found = {key: task() for key, task in tasks.items()}  # compiles, too
    spent = in_turns(tasks, found, max(repeats, OFTEN) if name == "a" else repeats)
    for (one, step), times in [*spent.items()]:
        if step != "solve":
            both = zip(spent[one, "solve"], times, strict=False)
            spent[one, "both"] = tuple(solve + more for solve, more in both)
            found[one, "both"] = found[one, step]
    size = (f"{len(ours.survey.photos.names)} photos, {len(ours.survey.points)} points, "
            f"{ours.adjusted.solution.rows} equations")  # fmt: skip
    for step, (what, place) in STEPS.items():
        if (ours.name, step) not in spent:
            continue
        able = [one for one in peers if (one.name, step) in spent]
        own = digits_of(found[ours.name, step][1], RIGHT[name][place])
        for peer in able:
            digits = own, digits_of(found[peer.name, step][1], RIGHT[name][place])
            tell(Row(f"adjustment {name}, {step}", size, spent[ours.name, step],
                     peer.name, peer.version, spent[peer.name, step],
                     what, digits, LEAST, note=peer.note))  # fmt: skip
        if not able:
            tell(Row(f"adjustment {name}, {step}", size, spent[ours.name, step],
                     answer=what, digits=(own, None), least=LEAST))  # fmt: skip
    for peer in peers:
        peer.close()


def in_turns(tasks, found, rounds):
    """{(program, step): seconds of each round}; what takes a peer long is not done again."""
    spent = {key: [] for key in tasks}
    for turn in range(rounds):
        for key, task in tasks.items():
            first = found[key][0]
            if key[0] != "tankcal" and first > ONCE_S:
                spent[key] = [first]
            elif key[0] == "tankcal" or turn < ROUNDS or first < OFTEN_S:
                spent[key].append(task()[0])
    return {key: tuple(seconds) for key, seconds in spent.items()}


def main():
    """Read the arguments and measure."""
    os.environ["TANKCAL_COMPILED"] = "1"
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("problems", nargs="*", default=["a", "b", "c", "d"])
    parser.add_argument("--repeats", type=int, default=ROUNDS)
    given = parser.parse_args()
    if not (SHARED / "bench").is_dir():
        tell(Skipped("adjustment", "", "its problems are not there: set TANKCAL_DATA"))
        return
    with tempfile.TemporaryDirectory() as folder:
        for name in given.problems:
            if name == "d":
                large(name, Path(folder))
            else:
                compare(name, given.repeats, Path(folder))


if __name__ == "__main__":
    main()
