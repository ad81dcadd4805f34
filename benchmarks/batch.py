"""Many jobs: what a batch costs, step by step, and how many bytes a job takes in its memory.

    python benchmarks/batch.py [JOBS] [--workers N] [--papers] [--keep DIR]
    python benchmarks/batch.py [JOBS] --settled
    python benchmarks/batch.py [JOBS] --sleep SECONDS [--workers N]

JOBS tanks (1000) are made of the shipped examples of strapping and of points, in turn: their
readings are scaled by a few parts in 10 000 and get noise of 0.3 mm, so that no two are alike. They
are run by N workers (2), with papers where asked. Seconds of processor of each step are those that
the workers note in the journal; of the rest of their processes (imports, dask) and of the process
that hands the jobs out, what the system counts. Then the batch is run once more, where all is
settled already.

--settled: two jobs are computed, and linked JOBS times; a batch of them is run that has nothing to
compute: search, digests, outcomes and summary alone.

--sleep: workers sleep instead of computing; processor and memory of scheduler and loop are printed.
"""

import argparse
import csv
import json
import os
import shutil
import subprocess
import sys
import tempfile
import threading
import time
from collections import Counter
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parent.parent
EXAMPLES = ROOT / "examples"
NOISE_MM, SCALE_SD = 0.3, 3e-4
WANTED = {  # of each example: the table that is varied, its columns of metres
    "strapping": ("circumferences.csv", ("reading_m",)),
    "silva-1995": ("points.csv", ("x_m", "y_m")),
}


def write_jobs(folder, count, seed=1):
    """Folders of so many jobs, T-0000 and so on, each of another tank."""
    rng, kinds = np.random.default_rng(seed), list(WANTED)
    for number in range(count):
        kind = kinds[number % len(kinds)]
        job = folder / f"T-{number:04d}"
        shutil.copytree(
            EXAMPLES / kind, job, ignore=shutil.ignore_patterns("*.py", "*.md", "publ*")
        )
        settings = (job / "job.toml").read_text(encoding="utf-8")
        lines = [f'id = "T-{number:04d}"' if one.startswith("id =") else one
                 for one in settings.splitlines()]  # fmt: skip
        (job / "job.toml").write_text("\n".join(lines) + "\n", encoding="utf-8")
        vary(job / WANTED[kind][0], WANTED[kind][1], rng)


def vary(path, columns, rng):
    """Scale the columns of a CSV file about their means, and add noise."""
    lines = path.read_text(encoding="utf-8").splitlines()
    lines = [one for one in lines if one and not one.startswith("#")]
    rows = list(csv.DictReader(lines))
    scale = 1 + rng.normal(0, SCALE_SD)
    for column in columns:
        values = np.array([float(row[column]) for row in rows])
        centre = 0.0 if column == "reading_m" else values.mean()
        values = centre + scale * (values - centre) + rng.normal(0, NOISE_MM / 1000, len(values))
        for row, value in zip(rows, values, strict=True):
            row[column] = f"{value:.5f}"
    with path.open("w", encoding="utf-8", newline="") as file:
        writer = csv.DictWriter(file, rows[0])
        writer.writeheader()
        writer.writerows(rows)


def run(jobs, out, workers, papers):
    """Seconds by the clock, of this process and its children, and the largest of them in MB."""
    command = [sys.executable, "-m", "tankcal", "batch", str(jobs), "--out", str(out),
               "--workers", str(workers), "--quiet"]  # fmt: skip
    start = time.perf_counter()
    child = subprocess.Popen([*command, *([] if papers else ["--no-papers"])],
                             stdout=subprocess.DEVNULL)  # fmt: skip
    own = [0.0]
    done = threading.Event()

    def look():
        while not done.wait(1.0):
            own.append(max(own[-1], megabytes(child.pid)))

    watch = threading.Thread(target=look)
    watch.start()
    _, status, usage = os.wait4(child.pid, 0)
    done.set()
    watch.join()
    if status:
        sys.exit(1)
    return time.perf_counter() - start, usage.ru_utime + usage.ru_stime, own[-1]


def megabytes(pid):
    """What a process holds."""
    try:
        rows = Path(f"/proc/{pid}/status").read_text().splitlines()
    except OSError:
        return 0.0
    return sum(int(row.split()[1]) for row in rows if row.startswith("VmRSS:")) / 1024


def steps_of(out):
    """{step: seconds of processor of all jobs}, by the journal."""
    total = Counter()
    for line in (out / "journal.jsonl").read_text().splitlines():
        total.update(json.loads(line).get("cpu_s", {}))
    return total


def measure(count, workers, papers, keep):
    """Print what a batch costs."""
    with tempfile.TemporaryDirectory() as folder:
        jobs, out = Path(folder) / "jobs", Path(keep or Path(folder) / "out")
        write_jobs(jobs, count)
        clock, processor, held = run(jobs, out, workers, papers)
        print(f"{count} jobs, {workers} workers, {'with' if papers else 'without'} papers: "
              f"{clock:.0f} s by the clock, {processor:.0f} s of processor, the process that hands "
              f"out {held:.0f} MB")  # fmt: skip
        steps = steps_of(out)
        for step, seconds in steps.most_common():
            print(f"  {step}: {seconds:.1f} s, {1000 * seconds / count:.1f} ms a job")
        rest = processor - sum(steps.values())
        print(f"  all else: {rest:.1f} s, {1000 * rest / count:.1f} ms a job")
        size = sum(one.stat().st_size for one in out.rglob("*") if one.is_file())
        print(f"  on the disk: {size / count / 1e6:.2f} MB a job; of the journal "
              f"{(out / 'journal.jsonl').stat().st_size / count:.0f} bytes, of summary.json "
              f"{(out / 'summary.json').stat().st_size / count:.0f}, of summary.html "
              f"{(out / 'summary.html').stat().st_size / count:.0f}")  # fmt: skip
        clock, processor, held = run(jobs, out, workers, papers)
        print(f"  once more, all settled: {clock:.0f} s by the clock, {processor:.1f} s of "
              f"processor, {1000 * processor / count:.1f} ms a job, {held:.0f} MB")  # fmt: skip


def measure_settled(count):
    """Print what a batch costs that has nothing to compute."""
    from tankcal.products.batch.finding import BatchJob
    from tankcal.products.batch.journal import compute_keys
    from tankcal.products.batch.outcomes import Options, load_outcome, save_outcome

    with tempfile.TemporaryDirectory() as folder:
        jobs, out, links = (Path(folder) / name for name in ("jobs", "out", "links"))
        write_jobs(jobs, len(WANTED))
        run(jobs, out, 0, papers=False)
        options, known = Options(papers=False), {}
        for number in range(count):
            source = jobs / f"T-{number % len(WANTED):04d}"
            name, target = f"T-{number:06d}", links / f"T-{number:06d}"
            link(source, target)
            link(
                out / "jobs" / source.name / "results",
                Path(folder) / "done" / "jobs" / name / "results",
            )
            known.setdefault(source, load_outcome(out, source.name))
            keys = compute_keys(BatchJob(name, name, str(target), options))
            step = replace(known[source].steps["run"], key=keys["run"])
            save_outcome(Path(folder) / "done", replace(
                known[source], name=name, source=str(target), steps={"run": step}))  # fmt: skip
        (Path(folder) / "done" / "journal.jsonl").touch()
        clock, processor, held = run(links, Path(folder) / "done", 0, papers=False)
        sizes = {file.name: file.stat().st_size / 1e6
                 for file in sorted((Path(folder) / "done").glob("summary.*"))}  # fmt: skip
        print(f"{count} settled jobs: {clock:.1f} s by the clock, {processor:.1f} s of processor, "
              f"{1000 * processor / count:.1f} ms a job, {held:.0f} MB; "
              + ", ".join(f"{name} {size:.1f} MB" for name, size in sizes.items()))  # fmt: skip


def link(source, target):
    """A folder whose files are links to those of another; copies where a file has too many."""
    target.mkdir(parents=True)
    for file in source.iterdir():
        try:
            os.link(file, target / file.name)
        except OSError:
            shutil.copy(file, target / "new")
            (target / "new").replace(file)
            os.link(file, target / file.name)


def sleep(seconds, task):
    """What a simulated worker does with a task."""
    time.sleep(seconds)
    return "done", [], 0


def measure_sleeping(rows, workers, seconds):
    """Print what the loop itself costs, and how its memory grows."""
    from tankcal.methods.clouds.cluster import open_client
    from tankcal.products.batch import running
    from tankcal.products.batch.finding import BatchJob
    from tankcal.products.batch.journal import open_folder
    from tankcal.products.batch.outcomes import Options
    from tankcal.products.batch.steps import Task

    options, held = Options(), []

    def tasks():
        for number in range(rows):
            if number % (rows // 5) == 0:
                held.append(megabytes(os.getpid()))
            name = f"T-{number:06d}"
            yield Task(
                BatchJob(name, name, f"/site/{name}", options), {"run": "0" * 64}, "/out", "r"
            )

    running.do_job = partial(sleep, seconds)
    with tempfile.TemporaryDirectory() as out, open_folder(out) as journal, \
            open_client(workers) as client:  # fmt: skip
        before, start = time.process_time(), time.perf_counter()
        running._WorkerRuns(client, journal, lambda *row: None).do(tasks())
        spent, clock = time.process_time() - before, time.perf_counter() - start
    held.append(megabytes(os.getpid()))
    print(f"{rows} tasks of {seconds:g} s, {workers} workers: {clock:.1f} s by the clock, "
          f"{100 * rows * seconds / workers / clock:.0f} % of them asleep; scheduler and loop "
          f"{1000 * spent / rows:.2f} ms of processor a task; MB held: "
          + ", ".join(f"{one:.0f}" for one in held))  # fmt: skip


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("jobs", nargs="?", type=int, default=1000)
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--papers", action="store_true")
    parser.add_argument("--settled", action="store_true")
    parser.add_argument("--sleep", type=float)
    parser.add_argument("--keep", metavar="DIR")
    given = parser.parse_args()
    if given.settled:
        measure_settled(given.jobs)
    elif given.sleep is not None:
        measure_sleeping(given.jobs, given.workers, given.sleep)
    else:
        measure(given.jobs, given.workers, given.papers, given.keep)
