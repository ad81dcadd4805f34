"""The app against its budgets: processor seconds of the server, and memory, without a browser.

    python benchmarks/app.py

A budget is for an idle machine; the test of `main` is twice the budget, in processor seconds.
"""

import json
import subprocess
import sys
import tempfile
import time
from contextlib import ExitStack
from pathlib import Path

from growth import write_points
from measured import ROOT, ROUNDS, Row, tell

sys.path.insert(0, str(ROOT / "tests" / "support"))

from app_visitors import Visitor, serve_app

TANKCAL = [sys.executable, "-m", "tankcal"]
VISITORS = 20
TICKS_PER_S = 100
WITHIN_S = 120
ADDED = ("sx_mm", "sy_mm", "sz_mm", "section", "generatrix")  # columns beside point, x, y and z
MARGIN = 2  # of a budget, before it counts as exceeded


def main():
    """A row for each budget; the exit status is 1 if a budget is exceeded twice."""
    exceeded = []

    def keep(name, size, seconds, budget_s=None, memory_mb=None, budget_mb=None, **more):
        parts = [f"budget {budget_s:g} s"] if budget_s else []
        parts += [f"budget {budget_mb:g} MB"] if budget_mb else []
        tell(Row(name, size, tuple(seconds), memory_mb=memory_mb, note=", ".join(parts), **more))
        if budget_s and sorted(seconds)[len(seconds) // 2] > MARGIN * budget_s:
            exceeded.append(name)
        if budget_mb and memory_mb > MARGIN * budget_mb:
            exceeded.append(name)

    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        started = [start_once(folder / f"start{turn}") for turn in range(ROUNDS)]
        keep("app, start to the home page", "new process", started, 2.0)
        with serve_app(TANKCAL, folder) as (process, address):
            visitor = Visitor(address)
            jobs = [visitor.open_example() for _ in range(3)]
            for job in jobs:
                visitor.get(job)
            again = [timed(process, lambda: visitor.get(jobs[0])) for _ in range(ROUNDS)]
            idle_mb = memory_of(process)
            keep("app, page of a job again", "silva-1995", again, 0.5, idle_mb, 150)
            measure_visitors(process, address, jobs[0], idle_mb, keep)
            measure_run(visitor, jobs[0], folder, keep)
        for size, budget_s in ((5000, 0.1), (30_000, 0.5)):
            measure_edits(folder / str(size), size, budget_s, keep)
    for task in exceeded:
        print(f"more than {MARGIN} times its budget: {task}")
    return 1 if exceeded else 0


def start_once(folder):
    """Processor seconds of a new server until its home page is sent."""
    folder.mkdir(parents=True)
    with serve_app(TANKCAL, folder) as (process, address):
        Visitor(address)
        return processor_s(process)


def measure_visitors(process, address, job, idle_mb, keep):
    """Seconds and memory for each of many visitors who keep a job open."""
    with ExitStack() as windows:
        began = processor_s(process)
        for _ in range(VISITORS):
            visitor = Visitor(address)
            visitor.get(job)
            visitor.get(f"{job}grid/points")
            connection, _ = visitor.events(job)
            windows.callback(connection.close)
        seconds = (processor_s(process) - began) / VISITORS
        each_mb = max(0.0, memory_of(process) - idle_mb) / VISITORS
    keep(f"app, each of {VISITORS} visitors", "home, job, grid, events", [seconds],
         memory_mb=each_mb, budget_mb=1)  # fmt: skip


def measure_run(visitor, job, folder, keep):
    """Seconds by the clock from the button to the results, in turns with `tankcal run`."""
    ours, theirs = [], []
    for turn in range(ROUNDS):
        began = time.monotonic()
        visitor.compute(job, documents=False)
        ours.append(time.monotonic() - began)
        began = time.monotonic()
        out = folder / f"out{turn}"
        subprocess.run(
            [*TANKCAL, "run", "examples/silva-1995", "--no-papers", "--quiet", "--out", out],
            cwd=ROOT, check=True, capture_output=True,
        )  # fmt: skip
        theirs.append(time.monotonic() - began)
    keep("app, from the button to the results (clock)", "silva-1995", ours,
         peer="tankcal run --no-papers", peer_seconds=tuple(theirs))  # fmt: skip


def measure_edits(folder, size, budget_s, keep):
    """Seconds of an edit: the cell itself, the check of all rows, a pasted block."""
    job_folder = folder / "job"
    job_folder.mkdir(parents=True)
    write_points(job_folder, size)
    with serve_app(TANKCAL, folder, str(job_folder)) as (process, address):
        visitor = Visitor(address)
        job = visitor.path
        state = wait_for_check(visitor, job, -1)
        first, whole = [], []
        for turn in range(ROUNDS):
            action = {"kind": "enter", "changes": [[turn, "x_m", "1x" if turn % 2 else "1.5"]]}
            seen = state["revision"]
            began, used = time.monotonic(), processor_s(process)
            answer = visitor.act(f"{job}act", {"name": "points", "action": action, "since": seen,
                                               "revision": seen})  # fmt: skip
            first.append(time.monotonic() - began)
            state = wait_for_check(visitor, job, answer["revision"])
            whole.append(processor_s(process) - used)
        rows = f"{size} rows"
        keep("app, edit to the mark at its cell (clock)", rows, first, 0.05)
        keep("app, edit to the check of all rows", rows, whole, budget_s)
        if size == 5000:
            for name in ADDED:
                action = {"kind": "column", "name": name}
                answer = visitor.act(f"{job}act", {"name": "points", "action": action})
            seen = wait_for_check(visitor, job, answer["revision"])["revision"]
            block = [[f"P{i}", *(f"{i + j / 10:.3f}" for j in range(8))] for i in range(size)]
            action = {"kind": "paste", "row": 0, "column": 0, "cells": block}
            used = processor_s(process)
            answer = visitor.act(f"{job}act", {"name": "points", "action": action, "since": seen,
                                               "revision": seen})  # fmt: skip
            wait_for_check(visitor, job, answer["revision"])
            pasted = processor_s(process) - used
            keep("app, paste to the check of all rows", f"{size} x 9 cells", [pasted], 1.0)


def wait_for_check(visitor, job, since):
    """State of a table once all rows are checked."""
    end = time.monotonic() + WITHIN_S
    while True:
        text = visitor.get(f"{job}changes?name=points&since={since}")
        state = json.loads(text)
        if state["is_checked"]:
            return state
        if time.monotonic() > end:
            raise TimeoutError(text)
        time.sleep(0.05)


def timed(process, task):
    """Processor seconds of the server for a task."""
    began = processor_s(process)
    for _ in range(10):  # the counter has steps of 10 ms
        task()
    return (processor_s(process) - began) / 10


def processor_s(process):
    """Processor seconds of a process so far."""
    fields = Path(f"/proc/{process.pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / TICKS_PER_S


def memory_of(process):
    """Memory of a process in MB."""
    lines = Path(f"/proc/{process.pid}/status").read_text().splitlines()
    (size,) = (line.split()[1] for line in lines if line.startswith("VmRSS:"))
    return int(size) / 1024


if __name__ == "__main__":
    sys.exit(main())
