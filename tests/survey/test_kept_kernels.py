"""Compiled loops made at installation: used where nothing may be written, and by all alike."""

import gc
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

import tankcal
from tankcal.cli.kernels import small_survey
from tankcal.solver import compiled
from tankcal.survey.network import adjust

PACKAGE = Path(tankcal.__file__).parent
READ_ONLY = """
import numba.core.caching

class Refusing:
    @staticmethod
    def TemporaryFile(dir):
        raise OSError(30, "Read-only file system")

numba.core.caching.tempfile = Refusing
import tankcal.camera.imaging, tankcal.solver.loops, tankcal.solver.propagate, tankcal.solver.series
from networks import by_total_station, photographed
from tankcal.solver.compiled import compile_functions
from tankcal.survey.network import adjust

for make in (photographed, by_total_station):
    adjusted = adjust(make()[0], datum="inner")
    assert adjusted.residuals and adjusted.point_covariances_m2.any()
    assert adjusted.covariance_m2().any()
rooms = {
    tankcal.solver.loops: "COMPILED",
    tankcal.solver.propagate: "COMPILED",
    tankcal.solver.series: "COMPILED",
    tankcal.camera.imaging: "_COMPILED",
}
loops = [vars(compile_functions(room, vars(room)[names])) for room, names in rooms.items()]
stats = [one.stats for room in loops for one in room.values()]
print(sum(len(one.cache_hits) for one in stats), sum(len(one.cache_misses) for one in stats))
"""


@pytest.mark.slow
def test_an_installation_that_may_not_be_written_to_compiles_nothing(tmp_path):
    copy = tmp_path / "tankcal"
    shutil.copytree(PACKAGE, copy, ignore=shutil.ignore_patterns("__pycache__"))
    tests = Path(__file__).parents[1]
    paths = os.pathsep.join(map(str, (tmp_path, tests, tests / "support")))
    env = os.environ | {"PYTHONPATH": paths, "TANKCAL_COMPILED": "1"}
    env.pop("NUMBA_CACHE_DIR", None)
    subprocess.run([sys.executable, "-m", "tankcal.cli.kernels"], env=env, cwd=tmp_path, check=True)
    before = sorted(copy.glob("**/*.nb?"))
    run = subprocess.run(
        [sys.executable, "-c", READ_ONLY], env=env, cwd=tmp_path, capture_output=True, text=True
    )
    assert run.stderr == ""
    hits, misses = map(int, run.stdout.split())
    assert hits >= 7
    assert misses == 0
    assert sorted(copy.glob("**/*.nb?")) == before


def test_what_is_compiled_for_all_is_a_sound_survey():
    """Closed form: its readings are those of its points, so nothing moves."""
    survey = small_survey()
    found = adjust(survey)
    assert found.solution.chi2 < 1e-12
    assert found.xyz_m == pytest.approx(survey.xyz_m, abs=1e-9)


def test_less_work_is_enough_where_loops_are_kept(monkeypatch):
    monkeypatch.setattr(compiled, "available", lambda: True)
    monkeypatch.setattr(compiled, "_requested_mode", lambda: "patient")
    for kept, rows in ((False, compiled.AT_ONCE), (True, compiled.LOADING * compiled.AT_ONCE)):
        monkeypatch.setattr(compiled, "are_kept", lambda kept=kept: kept)
        assert not compiled.is_worth_compiling(rows - 1)
        assert compiled.is_worth_compiling(rows)


def test_what_a_large_job_left_behind_does_not_count(tmp_path, monkeypatch):
    """Only an installation says so, and of these very sources."""
    mark, are_kept = tmp_path / "kernels.txt", compiled.are_kept.__wrapped__
    monkeypatch.setattr(compiled, "_MARK", mark)
    (tmp_path / "loops._eliminate-1.py311.nbi").touch()
    assert not are_kept()
    assert compiled.mark_as_kept()
    assert are_kept()
    monkeypatch.setattr(compiled, "_SOURCES", compiled._SOURCES[:1])
    assert not are_kept()
    mark.write_bytes(b"\xff")
    assert not are_kept()


def test_the_garbage_collector_rests_while_loops_are_loaded():
    """All that numba loads is kept: walking it again and again took a fifth of the first use."""
    resting = []

    class Beside:
        cache_path = ""

        def load_overload(self, signature, target):
            resting.append(not gc.isenabled())
            return "loop"

    assert compiled._FunctionCache(Beside(), None).load_overload("signature", "target") == "loop"
    assert resting == [True]
    assert gc.isenabled()
