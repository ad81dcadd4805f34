"""A plugin: results of each kind of the camera's analyses, with names to be shown literally."""

import json
from dataclasses import replace

import numpy as np
import pytest
from camera_sets import HOSTILE, SMALL, sets
from networks import CONTROL_SD_M, photographed, tank_points
from photographed_jobs import by_tape, control_of, measurements, tank_job

from tankcal.calibration.influence.runs import influence
from tankcal.calibration.parameters.analysis import analyse_job
from tankcal.calibration.product import check_product, shipped_limits
from tankcal.calibration.stability.comparison import compare
from tankcal.record import camera as influence_json
from tankcal.record import camera as parameters_json
from tankcal.record import camera as product_json
from tankcal.record import camera as stability_json
from tankcal.survey.measurements import AdjustmentSettings, Instrument

CONTROL = tuple(f"P{i}" for i in range(1, 48, 6))


def compare_sets():
    return stability_json.plain_stability(compare(sets(HOSTILE), "spr", grid=SMALL))


def photographed_tank(folder):
    """A small tank photographed from all around, its points measured by tape, too."""
    survey = photographed(3)[0]
    control = control_of(survey, CONTROL, tank_points(), CONTROL_SD_M)
    made = measurements(
        survey, by_tape(survey, "tape 1"), control=control,
        settings=AdjustmentSettings(snooping=False),
        instruments=(Instrument("tape 1", "tape", u_scale=1e-4),),
    )  # fmt: skip
    return replace(tank_job(folder), measurements=made)


def analyse_parameters(job):
    return parameters_json.plain_parameters(analyse_job(job)[0])


def analyse_influence(job):
    own = job.measurements.cameras[0]
    other = replace(own, camera=replace(own.camera, name="=cmd", sd=np.full(13, np.nan)))
    return influence_json.plain_influence(influence(job, (other,), ("fixed", "weighted")))


def check_differences():
    rng = np.random.default_rng(3)
    names = [f"<i>{number}</i>" for number in range(25)]
    differences = rng.normal([0.2, 0.0, 0.0], 0.15, (25, 3))
    return product_json.plain_product(
        check_product(differences, names=names, limits=shipped_limits(), expected_sd_m=(0.1,) * 3)
    )


@pytest.fixture(scope="session")
def results(made_once):
    """{kind: result}; nobody changes them."""

    def make(folder):
        job = photographed_tank(folder)
        found = (
            compare_sets(),
            analyse_parameters(job),
            analyse_influence(job),
            check_differences(),
        )
        text = json.dumps({one["kind"]: one for one in found})
        (folder / "results.json").write_text(text, encoding="utf-8")

    return json.loads((made_once("camera", make) / "results.json").read_text(encoding="utf-8"))


@pytest.fixture(scope="session")
def stability(results):
    return results["stability"]


@pytest.fixture(scope="session")
def parameters(results):
    return results["parameters"]


@pytest.fixture(scope="session")
def run(results):
    return results["influence"]


@pytest.fixture(scope="session")
def product(results):
    return results["product"]
