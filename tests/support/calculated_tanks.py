"""Tanks whose dip calculator is recalculated: results and records, as parsed."""

import json
from dataclasses import replace

from conftest import EXAMPLE
from job_builder import write_job

import tankcal
from tankcal.record import record_of, save

AFLOAT = {
    "table.step_m": 0.25,
    "table.liquid_density_kg_m3": 850.0,
    "table.other_densities_kg_m3": [700.0, 1000.0],
    "datum.reference_height_m": 10.2,
}


def example_with_rows(step_m, folder):
    """(result, record) of the shipped example with another step of its table."""
    job = tankcal.load(EXAMPLE)
    return _calculated(replace(job, table=replace(job.table, step_m=step_m)), folder)


def afloat(folder):
    """(result, record) of a tank with a floating roof, three densities and a reference height."""
    write_job(folder / "job", roof={}, settings=AFLOAT)
    return _calculated(tankcal.load(folder / "job"), folder)


def _calculated(job, folder):
    result = tankcal.run(job)
    save(record_of(result), folder / "record.json")
    return result, json.loads((folder / "record.json").read_text(encoding="utf-8"))
