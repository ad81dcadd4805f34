"""Records that together fill every sheet of the workbook."""

import json
import shutil

from job_builder import write_job
from test_adjustment_outputs import write_photos
from uncertain_job import write_uncertain_record

import tankcal
from tankcal.pipeline.chain import adjust_job
from tankcal.record import record_of, record_of_adjustment, save

KINDS = ("furnished", "lying", "uncertain", "photographed", "survey")
FURNISHED = {
    "table.step_m": 0.5,
    "table.liquid_density_kg_m3": 850.0,
    "table.other_densities_kg_m3": [700.0],
    "datum.reference_height_m": 11.0,
    "bottom.form": "cone",
    "bottom.centre_z_m": -0.15,
}
LYING = {
    "survey.side": "inside",
    "table.step_m": None,
    "table.height_unit": "ft-in-8",
    "table.volume_unit": "bbl",
    "horizontal.end_a": "ellipsoidal",
    "horizontal.end_a_depth_m": 0.6,
}
ITEMS = [("coil #1", 0.2, 0.6, -0.35, 0.02), ("hatch", 0.5, 1.1, 0.12, 0.0)]


def write_records_of_every_kind(folder):
    """Write KIND.json for every kind of KINDS, and the jobs that they are of, into `folder`."""
    furnished = {"settings": FURNISHED, "deadwood": ITEMS, "roof": {"critical_top_m": 1.6}}
    diameter = [("diameter", 2.0, "mm")]
    jobs = {
        "furnished": write_job(folder / "furnished", **furnished),
        "lying": write_job(
            folder / "lying", kind="horizontal", settings=LYING, uncertainty=diameter
        ),
        "photographed": write_photos(folder / "photographed"),
    }
    paths = {kind: folder / f"{kind}.json" for kind in KINDS}
    for kind, job in jobs.items():
        save(record_of(tankcal.run(tankcal.load(job))), paths[kind])
    survey = tankcal.load(jobs["photographed"], only="adjustment")
    save(record_of_adjustment(survey, adjust_job(survey)), paths["survey"])
    (folder / "uncertain").mkdir()
    shutil.copyfile(write_uncertain_record(folder / "uncertain"), paths["uncertain"])


def read_records(folder):
    """{kind: record as parsed} of what `write_records_of_every_kind` wrote."""
    return {
        kind: json.loads((folder / f"{kind}.json").read_text(encoding="utf-8")) for kind in KINDS
    }
