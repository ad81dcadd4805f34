"""How time and memory grow with a job: rows of the table, points, photographs, hits, a cloud.

    python benchmarks/growth.py [CASE ...]

Each size runs in a process of its own with one BLAS thread. The seconds are those of the processor,
the least of $ROUNDS rounds (5) in which all sizes take turns, without imports, what is made before
and compiled loops; the megabytes are the most that the process held, the interpreter with numpy,
scipy and pandas among them (100 to 300). Below three rounds the large sizes are left out, else they
run twice.

The slope is that of log time over log size between a size and the one before: 1 is twice the time
for twice the size. The goal: none above 1.2 but of what is dense by its nature (`DENSE`), and is
said to be; docs/limits.md says why that must be.
"""

import contextlib
import io
import os
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np
from measured import ROUNDS, Growth, tell

RADIUS_M, COURSES, COURSE_M = 7.5, 10, 2.5  # a tank of 25 m: a table of 25 000 rows of 1 mm
HEIGHT_M = COURSES * COURSE_M
JOB = f"""[tank]
id = "GROWTH"
kind = "vertical"
nominal_diameter_m = {2 * RADIUS_M}
nominal_height_m = {HEIGHT_M}
[survey]
side = "inside"
date = "2026-01-01"
shell_temperature_c = 25
[datum]
bottom_z_m = 0.0
[table]
step_m = {{step_m}}
reference_temperature_c = 15
liquid_density_kg_m3 = 850
"""
INSTRUMENT = """[instruments.T]
kind = "total_station"
certificate = "1"
u_offset_mm = 1
u_scale_ppm = 5
s_mm = 2
s_arcsec = 3
"""
POINTS_PER_PHOTO = 100


def write_table(folder, name, headings, rows):
    """A CSV file of rows."""
    lines = (",".join(map(str, row)) for row in rows)
    (folder / f"{name}.csv").write_text("\n".join([headings, *lines, ""]), encoding="utf-8")


def write_tank(folder, step_m=0.01):
    """Settings and courses."""
    (folder / "job.toml").write_text(JOB.format(step_m=step_m), encoding="utf-8")
    courses = [(one, COURSE_M, 8) for one in range(1, COURSES + 1)]
    write_table(folder, "courses", "course,height_m,thickness_mm", courses)


def wall_of(size):
    """(n,) azimuth, radius and height of points anywhere on an oval, bulging wall with a seam."""
    rng = np.random.default_rng(1)
    azimuth, z = rng.uniform(0, 2 * np.pi, size), rng.uniform(0.01, HEIGHT_M - 0.01, size)
    seam = np.exp(-np.abs(RADIUS_M * np.angle(np.exp(1j * (azimuth - 2)))) / 0.4)
    radius = RADIUS_M + 0.004 * np.cos(2 * azimuth) - 0.01 * seam
    radius += 0.003 * (1 - (2 * z / COURSE_M % 2 - 1) ** 2) + rng.normal(0, 0.002, size)
    return azimuth, radius, z


def write_points(folder, size, step_m=0.01):
    """A job of so many points of the wall."""
    write_tank(folder, step_m)
    azimuth, radius, z = wall_of(size)
    places = np.column_stack([radius * np.sin(azimuth), radius * np.cos(azimuth), z]).round(5)
    rows = [(f"P{i}", *place) for i, place in enumerate(places.tolist())]
    write_table(folder, "points", "point,x_m,y_m,z_m", rows)


def write_hits(folder, size):
    """A job of so many hits of the wall from one set-up in its middle, five metres up."""
    write_tank(folder)
    azimuth, radius, z = wall_of(size)
    above = z - 5.0
    zenith = np.degrees(np.arctan2(radius, above))
    columns = np.degrees(azimuth), zenith, np.hypot(radius, above)
    rows = [("A", *row) for row in np.column_stack(columns).round(6).tolist()]
    write_table(folder, "wall_hits", "setup,direction_deg,zenith_deg,distance_m", rows)
    write_table(
        folder, "setups", "setup,station,instrument,instrument_height_m", [("A", "S", "T", 0)]
    )
    write_table(folder, "control", "point,x_m,y_m,z_m,sx_mm,sy_mm,sz_mm", [("S", 0, 0, 5, 0, 0, 0)])
    instrument = '[instruments.T]\nkind = "total_station"\ncertificate = "1"\nu_offset_mm = 1\n'
    (folder / "instruments.toml").write_text(
        f"{instrument}u_scale_ppm = 5\ns_mm = 2\ns_arcsec = 3\n"
    )


def command(*arguments):
    """Run a command of tankcal in this process, its lines aside."""
    from tankcal.cli import main

    with contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(io.StringIO()):
        status = main([str(one) for one in arguments])
    if status:
        sys.exit(f"tankcal {' '.join(map(str, arguments))}: exit status {status}")


def table_of_rows(folder, size):
    """Volumes, u, degrees of freedom, k and U of a table, fifty times."""
    from tankcal.tank.capacity import Capacity

    *_, body, levels = computed(folder, size)

    def task():
        for _ in range(50):
            Capacity(levels, *body.rows(levels), 0.95).U_m3.sum()

    return task


def computed(folder, size):
    """Job, wall, body and levels of a table of so many rows, from 300 points."""
    import tankcal
    from tankcal.pipeline.tanks import body_of
    from tankcal.pipeline.wall.finding import find_wall

    write_points(folder, 300)
    job = tankcal.load(folder)
    wall = find_wall(job, lambda text: None)
    return job, wall, body_of(job, wall), np.linspace(0, HEIGHT_M, size)


def monte_carlo_of_rows(folder, size):
    """Monte Carlo of a table."""
    from tankcal.pipeline.simulation import simulate_table
    from tankcal.tank.capacity import Capacity

    job, wall, body, levels = computed(folder, size)
    table = Capacity(levels, *body.rows(levels), 0.95)
    return lambda: simulate_table(job, wall, body, 0.0, table)


def run_of_rows(folder, size, *more):
    """`tankcal run` of a job with a table of so many rows."""
    write_points(folder, 300, step_m=HEIGHT_M / size)
    return lambda: command("run", folder, "--out", folder / "out", *more)


def wall_of_points(folder, size):
    """From points to the wall and the volumes."""
    import tankcal
    from tankcal.pipeline.tanks import body_of
    from tankcal.pipeline.wall.finding import find_wall

    write_points(folder, size)
    job = tankcal.load(folder)
    levels = np.linspace(0, HEIGHT_M, 2000)
    return lambda: body_of(job, find_wall(job, lambda text: None)).rows(levels)


def run_of_points(folder, size):
    """`tankcal run` of a job of so many points."""
    write_points(folder, size)
    return lambda: command("run", folder, "--out", folder / "out", "--no-papers")


def block(folder, photos):
    """A job of photographs, 100 points each."""
    from writing import write_block

    write_block(folder / "job", photos, POINTS_PER_PHOTO * photos)
    return folder / "job"


def adjustment_of_photos(folder, size):
    """The adjustment of photographs, with the covariance of each point."""
    import tankcal

    job = tankcal.load(block(folder, size), only="adjustment")
    return lambda: tankcal.adjust_job(job)


def run_of_photos(folder, size):
    """`tankcal run --only adjustment` of photographs."""
    job = block(folder, size)
    return lambda: command(
        "run", job, "--only", "adjustment", "--no-papers", "--out", folder / "out"
    )


def run_of_hits(folder, size):
    """`tankcal run` of a job of so many hits."""
    write_hits(folder, size)
    return lambda: command("run", folder, "--out", folder / "out", "--no-papers")


def cloud(folder, size):
    """The wall out of a file of so many points of a scanner."""
    import clouds

    from tankcal.clouds.wall import find_cloud_wall
    from tankcal.methods.clouds.passes import Placing, Reading, Telling, open_passes

    path = folder / "wall.las"
    clouds.write_las(path, size)

    def task():
        told = Telling(lambda text: None)
        placing = Placing.of(clouds.OneCloud(path), clouds.Posed)
        joints = np.linspace(0, clouds.HEIGHT_M, 6)
        with open_passes(placing, Reading(0), told) as passes:
            find_cloud_wall(passes, radius_m=clouds.RADIUS_M, joints_m=joints, progress=told.step)

    return task


ROWS = (1000, 5000), (25_000,)
POINTS = (1000, 4000), (12_500, 50_000)
PHOTOS = (10, 40), (100, 200)
CASES = {  # what: task, what its sizes count, sizes that always run, large ones
    "table, 50 times": (table_of_rows, "rows", *ROWS),
    "Monte Carlo": (monte_carlo_of_rows, "rows", *ROWS),
    "run of rows": (lambda *a: run_of_rows(*a, "--no-papers"), "rows", *ROWS),
    "run of rows, papers": (run_of_rows, "rows", (), (1000, 5000, 25_000)),
    "wall and volumes": (wall_of_points, "points", *POINTS),
    "run of points": (run_of_points, "points", *POINTS),
    "wall of a cloud": (cloud, "points", (50_000,), (500_000, 5_000_000)),
    "adjustment": (adjustment_of_photos, "photos", *PHOTOS),
    "run of photos": (run_of_photos, "photos", *PHOTOS),
    "run of hits": (run_of_hits, "hits", (250, 500), (1000, 2500)),
}
DENSE = ("adjustment", "run of photos")


def main(chosen):
    """A line for each case."""
    for name in chosen:
        _, unit, small, large = CASES[name]
        found = {size: [] for size in small + (large if ROUNDS > 2 else ())}
        if not found:
            continue
        for number in range(ROUNDS):
            for size, runs in found.items():
                if size in small or number < 2:
                    runs.append(in_process(name, size))
        least = [[min(one) for one in zip(*runs, strict=True)] for runs in found.values()]
        seconds, megabytes = zip(*least, strict=True)
        note = "dense by its nature: see docs/limits.md" if name in DENSE else ""
        tell(Growth(name, unit, tuple(found), seconds, megabytes, note))


def in_process(name, size):
    """Seconds and megabytes of one size in a process of its own."""
    own = [sys.executable, __file__, "--one", name, str(size)]
    out = subprocess.run(own, check=True, stdout=subprocess.PIPE, text=True).stdout
    return [float(one) for one in out.split()]


def once(name, size):
    """Print the processor's seconds and the most megabytes of one task."""
    make, _, small, large = CASES[name]
    with tempfile.TemporaryDirectory() as folder:
        warm, whole = Path(folder, "warm"), Path(folder, "whole")
        warm.mkdir()
        whole.mkdir()
        make(warm, min(small + large))()  # loops are compiled by the smallest
        task = make(whole, size)
        start = time.process_time()
        task()
        seconds = time.process_time() - start
    print(seconds, resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024)


if __name__ == "__main__":
    if sys.argv[1:2] == ["--one"]:
        once(sys.argv[2], int(sys.argv[3]))
    else:
        main(sys.argv[1:] or [*CASES])
