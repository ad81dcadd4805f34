"""Computing against writing: a large photogrammetric block, and a small one.

    python benchmarks/writing.py [--runs N] [--no-papers] [TREE ...]

TREE is a folder that holds the package `tankcal`, this one unless said otherwise; several are
measured in turn, N times each (3), every run in a process of its own with one BLAS thread, and the
medians are printed, of the clock and of the processor, with the peak of the memory. The large block
has the size of "roma", a set that DBAT ships: 60 photos, 26 321 points and about 90 500 image
points, here simulated over hilly ground; the small one has 6 photos and 12 points. The goal:
writing takes less than computing.
"""

import argparse
import csv
import json
import os
import resource
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
from measured import ROOT, Row, tell

C_MM, HEIGHT_M, HALF_MM = 35.0, 60.0, (18.0, 12.0)
SD_UM = 2.0
SIZES = {"large": (60, 26_321), "small": (6, 12)}
RAYS, OF_POINTS = (2, 3, 4, 5, 6, 7), (0.27, 0.33, 0.20, 0.10, 0.06, 0.04)


def write_block(folder, photos, points, seed=1):
    """A job of vertical photographs over hilly ground, each point in 2 to 7 of them."""
    rng = np.random.default_rng(seed)
    columns = int(np.ceil(np.sqrt(photos)))
    spread = 12.0 * columns
    place = np.array([divmod(i, columns) for i in range(photos)]) * 12.0
    centre = np.column_stack([place, np.full(photos, HEIGHT_M)]) + rng.normal(0, 1.0, (photos, 3))
    turned = rng.normal(0, np.radians(4), (photos, 3))
    xyz = np.column_stack([rng.uniform(0, spread, (points, 2)), np.zeros(points)])
    xyz[:, 2] = 4 * np.sin(xyz[:, 0] / 9) * np.cos(xyz[:, 1] / 7)
    rotation = np.array([_rotation(*angles) for angles in turned])
    image_mm, inside = _photographed(xyz, centre, rotation)
    wanted = rng.choice(RAYS, size=points, p=OF_POINTS) if points > 100 else np.full(points, 99)
    order = np.argsort(rng.random((points, photos)) + 9 * ~inside, axis=1)
    chosen = np.zeros_like(inside)
    np.put_along_axis(chosen, order, np.arange(photos) < wanted[:, None], axis=1)
    point, photo = np.nonzero(chosen & inside)
    seen = np.bincount(point, minlength=points) > 1
    point, photo = (numbers[seen[point]] for numbers in (point, photo))
    xy = image_mm[point, photo] + rng.normal(0, SD_UM / 1000, (len(point), 2))
    folder.mkdir(parents=True)
    (folder / "job.toml").write_text(
        f'[adjustment]\ndatum = "control"\nimage_sd_um = {SD_UM}\nsnooping = true\n'
        '[adjustment.camera]\ndefault = "camera fixed"\n',
        encoding="utf-8",
    )
    (folder / "cameras.toml").write_text(
        f"[cameras.C]\nformat_mm = [{2 * HALF_MM[0]}, {2 * HALF_MM[1]}]\nc_mm = {C_MM}\n",
        encoding="utf-8",
    )
    angles = np.degrees(turned)
    start = centre + rng.normal(0, 0.05, centre.shape)
    _write(folder, "photos", "photo camera x_m y_m z_m omega_deg phi_deg kappa_deg",
           [[f"F{i}", "C", *start[i].round(4), *angles[i].round(4)]
            for i in range(photos)])  # fmt: skip
    _write(folder, "image_points", "photo point x_mm y_mm",
           [[f"F{j}", f"P{i}", *row]
            for i, j, row in zip(point, photo, xy.round(5).tolist(), strict=True)])  # fmt: skip
    known = np.flatnonzero(seen)[:: max(1, int(seen.sum()) // 12)]
    _write(folder, "control", "point x_m y_m z_m sx_mm sy_mm sz_mm",
           [[f"P{i}", *xyz[i].round(5), 5, 5, 5] for i in known])  # fmt: skip
    return {"photos": photos, "points": int(seen.sum()), "image points": len(point)}


def _rotation(omega, phi, kappa):
    """Object to photo, R(kappa) R(phi) R(omega)."""
    co, so, cp, sp, ck, sk = (f(a) for a in (omega, phi, kappa) for f in (np.cos, np.sin))
    by_omega = np.array([[1, 0, 0], [0, co, so], [0, -so, co]])
    by_phi = np.array([[cp, 0, -sp], [0, 1, 0], [sp, 0, cp]])
    return np.array([[ck, sk, 0], [-sk, ck, 0], [0, 0, 1]]) @ by_phi @ by_omega


def _photographed(xyz, centre, rotation):
    """Image coordinates (points, photos, 2), mm, and where they are within the frame."""
    away = xyz[:, None] - centre
    u = np.einsum("pij,npj->npi", rotation, away)
    image = -C_MM * u[:, :, :2] / u[:, :, 2:]
    return image, np.all(np.abs(image) < np.array(HALF_MM) - 0.05, axis=2)


def _write(folder, name, headings, rows):
    with open(folder / f"{name}.csv", "w", encoding="utf-8", newline="") as file:
        csv.writer(file).writerows([headings.split(), *rows])


def measured(tree, job, no_papers):
    """Seconds of computing and writing, of the whole command, and the sizes of what it wrote."""
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder) / "results"
        environment = {**os.environ, "PYTHONPATH": str(tree), "OPENBLAS_NUM_THREADS": "1"}
        own = [sys.executable, __file__, "--phases", str(job), str(out)]
        more = ["--no-papers"] if no_papers else []
        text = subprocess.run([*own, *more], check=True, capture_output=True, env=environment)
        found = json.loads(text.stdout.splitlines()[-1])
        found |= {name: size / 1e6 for name, size in _sizes(out).items()}
        command = [sys.executable, "-m", "tankcal", "run", str(job), "--only", "adjustment",
                   "--quiet", "--out", str(out), *more]  # fmt: skip
        begin, cpu = time.perf_counter(), _cpu()
        subprocess.run(command, check=True, stdout=subprocess.DEVNULL, env=environment,
                       stderr=subprocess.DEVNULL)  # fmt: skip
        found |= {"whole command_s": time.perf_counter() - begin}
        return found | {"whole command, processor_s": _cpu() - cpu}


def _now():
    """Seconds of the clock, and of the processor that this process and ended children took."""
    used = os.times()
    return time.perf_counter(), sum(used[:4])


def _cpu():
    """Seconds of the processor that ended child processes took."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def _peak_mb():
    """The largest memory of this process so far."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


def _sizes(folder):
    return {f"{path.name}_MB": path.stat().st_size for path in sorted(folder.iterdir())
            if path.stat().st_size > 2e5}  # fmt: skip


def phases(job, out, no_papers):
    """Print the seconds of reading and adjusting, and of writing, in this process."""
    import tankcal
    from tankcal.report import outputs

    begin = _now()
    job = tankcal.load(job, only="adjustment")
    adjustment = tankcal.adjust_job(job)
    computed, found = _now(), {"computing, peak_MB": _peak_mb()}
    more = {"papers": False} if no_papers else {}
    outputs.write_adjustment(job, adjustment, out, **more)
    written = _now()
    found["with writing, peak_MB"] = _peak_mb()
    for what, start, end in (("computing", begin, computed), ("writing", computed, written)):
        passed, worked = np.subtract(end, start).tolist()
        found |= {f"{what}_s": passed, f"{what}, processor_s": worked}
    print(json.dumps(found))


def main():
    """Measure every tree in turn, and print medians."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("trees", nargs="*", type=Path, default=[ROOT])
    parser.add_argument("--runs", type=int, default=3)
    parser.add_argument("--no-papers", action="store_true")
    parser.add_argument("--phases", nargs=2, metavar=("JOB", "OUT"), help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.phases:
        return phases(*options.phases, options.no_papers)
    with tempfile.TemporaryDirectory() as folder:
        for name, (photos, points) in SIZES.items():
            job = Path(folder) / name
            counts = write_block(job, photos, points)
            size = ", ".join(f"{count} {what}" for what, count in counts.items())
            print(f"{name}: {size}")
            runs = {tree: [] for tree in options.trees}
            for _ in range(options.runs):
                for tree in options.trees:
                    runs[tree].append(measured(tree, job, options.no_papers))
            for tree, found in runs.items():
                print(f"  {tree}")
                for key in found[0]:
                    median = statistics.median(one[key] for one in found)
                    what, unit = key.rsplit("_", 1)
                    print(f"    {what}: {median:.1f} {unit}")
            for what in ("computing", "writing", "whole command"):
                seconds = tuple(one[f"{what}, processor_s"] for one in runs[options.trees[0]])
                papers = "no papers" if options.no_papers else "all papers"
                tell(Row(f"a block, {what}", f"{size}, {papers}", seconds))
    return None


if __name__ == "__main__":
    main()
