"""Records of every kind of job, small, and those of released versions that are kept.

Keep a record of each kind, and list their keys, when a version is released:

    PYTHONPATH=tests/support:tests/report:tests/job python tests/kept_records.py
"""

import gzip
import json
import sys
import tempfile
from pathlib import Path

from job_builder import write_job
from schemas import keys_in
from test_adjustment_outputs import write_station
from test_jobs_of_film import film_job
from workbook_records import read_records, write_records_of_every_kind

import tankcal
from tankcal.record import VERSION, record_of, record_of_adjustment

KEPT = Path(__file__).with_name("records")
FREE = (  # dicts whose keys a user or a message gives
    "job.certificate", "job.tank.details", "warnings[].values", "corrections[].formula_values",
    "adjustment.datum.words_values", "adjustment.left_out[].values",
    "adjustment.instruments[].details",
)  # fmt: skip
FOCUS = """focus_m = 11.0
lens_focal_length_mm = 99.0

[cameras.UMK.focus_calibrations]
distance_m = [5.0, 25.0]
K1_mm-2 = [1e-10, 2e-10]
"""


def kept_files(version=None):
    """Paths of the kept records of a version, of all of them when None."""
    return sorted(KEPT.glob(f"{version or '*'}/*.json.gz"))


def write_film(folder):
    """Photographs read on a comparator, with points and marks that were read twice or badly.

    Distortion is known at two focus distances, control is in two systems and holds one height,
    and a point was seen once.
    """
    film_job(folder, readings=2)
    (heading, *control) = _lines(folder / "control.csv")
    control[0] = control[0].removesuffix(",2.0,2.0,2.0") + ",2.0,2.0,0"
    moved = [f"{name},{float(x) + 100:.4f},{rest}" for name, x, rest in _cells(control, 2)]
    rows = [f"{heading},system", *(f"{row}," for row in control), *(f"{row},B" for row in moved)]
    _write_lines(folder / "control.csv", rows)
    for name, move_mm in (("image_points.csv", 0.05), ("fiducials.csv", 0.2)):
        lines = _lines(folder / name)
        ((photo, thing, x, rest), *_) = _cells(lines[1:], 3)
        bad = f"{photo},{thing},{float(x) + move_mm:.6f},{rest}"
        good = lines[-1]
        _write_lines(folder / name, [*lines, bad, good])
    (photo, _, x, rest), *_ = _cells(_lines(folder / "image_points.csv")[1:], 3)
    once = f"{photo},seen once,{x},{rest}"
    _write_lines(folder / "image_points.csv", [*_lines(folder / "image_points.csv"), once])
    (before, marks) = (folder / "cameras.toml").read_text("utf-8").split("\n[cameras.UMK.marks]")
    text = f"{before}{FOCUS}\n[cameras.UMK.marks]{marks}"
    (folder / "cameras.toml").write_text(text, encoding="utf-8")
    job = (folder / "job.toml").read_text(encoding="utf-8")
    settings = "[adjustment]\ndepth_of_field = true\nreading_limit_um = 8.0\n"
    (folder / "job.toml").write_text(job.replace("[adjustment]\n", settings), encoding="utf-8")
    return folder


def _lines(path):
    return path.read_text(encoding="utf-8").splitlines()


def _write_lines(path, lines):
    path.write_text("\n".join([*lines, ""]), encoding="utf-8")


def _cells(lines, count):
    """The first cells of each row, the others as one."""
    return [row.split(",", count) for row in lines]


def records_with_every_key(folder, records=None):
    """{kind: record} of jobs that together have something of everything; written into `folder`."""
    if records is None:
        write_records_of_every_kind(folder)
        records = read_records(folder)
    found = dict(records)
    clutter = {"settings": {"table.step_m": 0.01}, "extra_points": [("stair", 7.4, 0.0, 3.0)]}
    job = tankcal.load(write_job(folder / "cluttered", **clutter))
    found["cluttered"] = record_of(tankcal.run(job))
    for kind, write in (("film", write_film), ("station", write_station)):
        job = tankcal.load(write(folder / kind), only="adjustment")
        found[kind] = record_of_adjustment(job, tankcal.adjust_job(job))
    return found


def layout_made(records):
    """Sorted paths of all keys of records."""
    return sorted(set().union(*(keys_in(record, FREE) for record in records.values())))


def _main():
    place = KEPT / str(VERSION)
    if (place / "keys.txt").exists():
        sys.exit(f"version {VERSION} has kept records: it is released; VERSION has to count up")
    with tempfile.TemporaryDirectory() as folder:
        records = records_with_every_key(Path(folder))
    place.mkdir(parents=True, exist_ok=True)
    (place / "keys.txt").write_text("\n".join(layout_made(records)) + "\n", encoding="utf-8")
    for kind, record in records.items():
        text = json.dumps(record, ensure_ascii=False, separators=(",", ":"))
        (place / f"{kind}.json.gz").write_bytes(gzip.compress(text.encode("utf-8"), mtime=0))


if __name__ == "__main__":
    _main()
