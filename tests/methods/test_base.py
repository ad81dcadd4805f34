"""The registry of the methods, and a method of another distribution."""

import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from job_builder import write_job

from tankcal.job.contract import COLUMNS, SURVEYS, SURVEYS_OF_KIND
from tankcal.job.tables import TABLES
from tankcal.methods.base import Method, find_method, method_of, methods, methods_for

HERE = Path(__file__).parent
RUN = """
import json, sys, tankcal
job = tankcal.load(sys.argv[1])
result = tankcal.run(job)
from tankcal.record import record_of
record = record_of(result)
print(json.dumps({
    "volume": float(result.table.volume_m3[-1]), "u": float(result.table.u_m3[-1]),
    "survey": result.surveys["calipers"].diameter_m,
    "warnings": [problem.file for problem in result.warnings],
    "budget": [line["kind"] for line in record["budget"]],
}))
"""


@pytest.mark.parametrize("method", methods(), ids=lambda method: method.name)
def test_a_method_is_complete(method):
    assert isinstance(method, Method)
    assert find_method(method.name) is method
    assert set(method.tables) == set(method.columns()) <= set(TABLES) & set(COLUMNS)
    assert set(method.shared_tables) <= set(COLUMNS)
    assert method.kinds
    assert all(method in methods_for(kind) for kind in method.kinds)
    for kind in method.kinds if method.starter else ():
        surveys = SURVEYS if kind == "vertical" else SURVEYS_OF_KIND[kind]
        assert method.starter in surveys


def test_other_surveys_have_no_method():
    assert method_of(None) is None
    assert method_of(object()) is None
    assert find_method("nothing") is None
    assert methods_for(None) == ()


@pytest.mark.slow
def test_a_method_of_another_distribution(tmp_path):
    """An entry point is sufficient for a table of a job, a survey and its uncertainty."""
    bare = {"sphere.diameter_m": None, "table.step_m": 0.5}
    write_job(tmp_path / "job", kind="sphere", settings=bare)
    (tmp_path / "job" / "points.csv").unlink(missing_ok=True)
    (tmp_path / "job" / "calipers.csv").write_text("diameter_m,s_mm\n19.998,2\n20.002,2\n")
    path = os.pathsep.join([str(HERE), *filter(None, [os.environ.get("PYTHONPATH")])])
    done = subprocess.run(
        [sys.executable, "-c", RUN, str(tmp_path / "job")],
        capture_output=True,
        text=True,
        env=os.environ | {"PYTHONPATH": path},
        cwd=HERE.parents[1],
    )
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout.splitlines()[-1])
    assert found["survey"] == 20.0
    assert found["volume"] == pytest.approx(np.pi / 6 * 20**3)
    # dV/dd = pi d^2 / 2; two readings of 2 mm have a mean of 2 / sqrt(2) mm
    assert found["u"] == pytest.approx(np.pi / 2 * 20**2 * 0.002 / np.sqrt(2), rel=0.05)
    assert "calipers" in found["budget"]
    assert "calipers.csv" not in found["warnings"]
