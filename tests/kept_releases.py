"""What a release keeps of itself: small jobs of every kind with their records, and saved files.

python tests/kept_releases.py   keeps them of the version that is being made; once it is released
                                (CHANGELOG.md has its day) they stay as they are
"""

import lzma
import re
import shutil
import sys
import tempfile
from pathlib import Path

import tankcal
from tankcal.planning import load_plan, predict
from tankcal.products.inspection.inspecting import Asked as ToInspect
from tankcal.products.inspection.inspecting import inspect_files
from tankcal.products.recalibration.comparison import Asked, compare_files
from tankcal.products.recalibration.history import history_of_files
from tankcal.record import record_of, record_of_adjustment, save
from tankcal.record.inspection import INSPECTION
from tankcal.record.plan import WALL_PLAN, plain_of_wall
from tankcal.record.recalibration import COMPARISON, HISTORY
from tankcal.record.schema import to_plain

ROOT = Path(__file__).resolve().parent.parent
KEPT = Path(__file__).with_name("releases")
JOBS = {  # example: what of it is computed, and the step of its table
    "strapping": (None, "0.2"),
    "partial": (None, "0.2"),
    "rings": (None, "0.1"),
    "sphere-straps": (None, "0.5"),
    "ship": (None, "0.5"),
    "total-station": ("adjustment", "0.2"),
}
SAVED = (COMPARISON, INSPECTION, HISTORY, WALL_PLAN)
_HEADING = re.compile(r"^## (\S+) \((.+)\)$", re.MULTILINE)


def versions():
    """{version: day of its release, or "unreleased"} by CHANGELOG.md."""
    text = (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
    return dict(_HEADING.findall(text))


def kept_records():
    """Paths of the kept records of all versions; the job lies beside each."""
    return sorted(KEPT.glob("*/*/record.json.xz"))


def kept_saved():
    """Paths of kept files that are no records."""
    return sorted(KEPT.glob("*/saved/*.json.xz"))


def unpack(path, folder):
    """The file that a kept one holds, in a folder."""
    to = Path(folder) / path.name.removesuffix(".xz")
    to.write_bytes(lzma.decompress(path.read_bytes()))
    return to


def compute(job, only):
    """The record of a job, as it is saved."""
    if only == "adjustment":
        read = tankcal.load(job, only="adjustment")
        return record_of_adjustment(read, tankcal.adjust_job(read))
    return record_of(tankcal.run(tankcal.load(job), simulated=False))


def _keep_job(name, only, step, place):
    """A small job of an example, only the files that count, and its record."""
    with tempfile.TemporaryDirectory() as folder:
        job = shutil.copytree(ROOT / "examples" / name, Path(folder) / name)
        settings = (job / "job.toml").read_text(encoding="utf-8")
        settings = re.sub(r"(?m)^step_m = .*$", f"step_m = {step}", settings)
        settings = re.sub(r"(?m)^fine_step_m = .*$", f"fine_step_m = {float(step) / 2}", settings)
        (job / "job.toml").write_text(settings, encoding="utf-8")
        record = compute(job, only)
        (place / "job").mkdir(parents=True)
        for one in record["files"]:
            shutil.copyfile(job / one["file"], place / "job" / one["file"])
        _pack(record, place / "record.json.xz")


def _pack(saved, path):
    path.parent.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory() as folder:
        save(saved, Path(folder) / "x.json")
        path.write_bytes(lzma.compress((Path(folder) / "x.json").read_bytes(), preset=9))


def _keep_saved(place):
    """A comparison, an inspection and a history of the records that were kept."""
    with tempfile.TemporaryDirectory() as folder:
        tables = []
        for name in ("strapping", "partial"):
            (Path(folder) / name).mkdir()
            tables.append(unpack(place / name / "record.json.xz", Path(folder) / name))
        found = [
            (COMPARISON.file, to_plain(compare_files(Asked(*tables)))),
            (HISTORY.file, to_plain(history_of_files([folder]))),
            (INSPECTION.file, to_plain(inspect_files(_inspected()))),
        ]
    plan = predict(load_plan(ROOT / "examples" / "plan-tangents"))
    for file, saved in (*found, (WALL_PLAN.file, plain_of_wall(plan))):
        _pack(saved, place / "saved" / f"{file}.xz")


def _inspected():
    """The inspection of the examples: wall, settlement, edges."""
    examples = ROOT / "examples"
    settlement, edges = (
        examples / "inspection" / name for name in ("settlement.csv", "edge_profiles.csv")
    )
    return ToInspect(examples / "silva-1995", settlement=settlement, edges=edges)


def _main():
    version = next((one for one, day in versions().items() if day == "unreleased"), None)
    if version is None:
        sys.exit("CHANGELOG.md has no unreleased version: what is kept of others stays")
    place = KEPT / version
    shutil.rmtree(place, ignore_errors=True)
    for name, (only, step) in JOBS.items():
        _keep_job(name, only, step, place / name)
    _keep_saved(place)


if __name__ == "__main__":
    _main()
