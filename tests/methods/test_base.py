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


def run_elsewhere(program, *arguments):
    """Last line, as JSON, of a program that finds the methods of this folder."""
    path = os.pathsep.join([str(HERE), *filter(None, [os.environ.get("PYTHONPATH")])])
    done = subprocess.run(
        [sys.executable, "-c", program, *map(str, arguments)],
        capture_output=True,
        text=True,
        env=os.environ | {"PYTHONPATH": path},
        cwd=HERE.parents[1],
    )
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout.splitlines()[-1])


RUN_UPRIGHT = """
import json, sys, tankcal
result = tankcal.run(tankcal.load(sys.argv[1]))
table = result.table
tankcal.write(result, sys.argv[2], papers=False)
print(json.dumps([table.height_m[-1], table.volume_m3[-1], table.u_m3[-1]]))
"""


@pytest.mark.slow
def test_a_method_of_another_distribution_measures_an_upright_wall(tmp_path):
    """Offsets become points: V = pi r^2 h, and a common offset of all radii adds 2 pi r h u."""
    radius_m, u_m3 = 5.0, []
    for name, bracket_mm in (("exact", 0), ("bracket", 20)):
        settings = {"tank.nominal_diameter_m": 2 * radius_m, "survey.side": "inside"}
        write_job(tmp_path / name, settings=settings)
        (tmp_path / name / "points.csv").unlink()
        rows = [
            f"{azimuth},6.0,{height / 4},1000,1,{bracket_mm}\n"
            for azimuth in range(0, 360, 15)
            for height in range(1, 38)
        ]
        heading = "azimuth_deg,distance_m,height_m,offset_mm,s_mm,u_bracket_mm\n"
        (tmp_path / name / "laser_lines.csv").write_text(heading + "".join(rows))
        out = tmp_path / f"{name}-out"
        height_m, volume_m3, u = run_elsewhere(RUN_UPRIGHT, tmp_path / name, out)
        assert volume_m3 == pytest.approx(np.pi * radius_m**2 * height_m, rel=1e-6)
        assert (out / "capacity.csv").is_file()
        u_m3.append(u)
    expected = 2 * np.pi * radius_m * height_m * 0.020
    assert np.sqrt(u_m3[1] ** 2 - u_m3[0] ** 2) == pytest.approx(expected, rel=1e-3)


@pytest.mark.slow
def test_a_table_of_another_method_is_refused(tmp_path):
    """A method whose table has the name of a table of tankcal is named by the import."""
    (tmp_path / "twin.dist-info").mkdir()
    (tmp_path / "twin.dist-info" / "METADATA").write_text("Name: twin\nVersion: 1.0\n")
    entry = "[tankcal.methods]\ntwin = laser_twin:Twin\n"
    (tmp_path / "twin.dist-info" / "entry_points.txt").write_text(entry)
    (tmp_path / "laser_twin.py").write_text(
        "from tankcal.methods.base import Method\n"
        "class Twin(Method):\n    name, kinds = 'twin', ('vertical',)\n"
        "    def columns(self):\n        return {'plumb_lines': ()}\n"
    )
    program = "import tankcal.job.contract"
    done = subprocess.run(
        [sys.executable, "-c", program],
        capture_output=True,
        text=True,
        env=os.environ | {"PYTHONPATH": str(tmp_path)},
        cwd=HERE.parents[1],
    )
    assert "method twin: the table plumb_lines has other columns already" in done.stderr


@pytest.mark.slow
def test_a_method_of_another_distribution(tmp_path):
    """An entry point is sufficient for a table of a job, a survey and its uncertainty."""
    bare = {"sphere.diameter_m": None, "table.step_m": 0.5}
    write_job(tmp_path / "job", kind="sphere", settings=bare)
    (tmp_path / "job" / "points.csv").unlink(missing_ok=True)
    (tmp_path / "job" / "calipers.csv").write_text("diameter_m,s_mm\n19.998,2\n20.002,2\n")
    found = run_elsewhere(RUN, tmp_path / "job")
    assert found["survey"] == 20.0
    assert found["volume"] == pytest.approx(np.pi / 6 * 20**3)
    # dV/dd = pi d^2 / 2; two readings of 2 mm have a mean of 2 / sqrt(2) mm
    assert found["u"] == pytest.approx(np.pi / 2 * 20**2 * 0.002 / np.sqrt(2), rel=0.05)
    assert "calipers" in found["budget"]
    assert "calipers.csv" not in found["warnings"]
