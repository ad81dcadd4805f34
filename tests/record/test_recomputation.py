"""A record held against another: what another machine computes otherwise, and what it must not."""

import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from tankcal.cli import verifying
from tankcal.record.covariance_factor import blocks_of
from tankcal.record.recomputation import compare_records
from tankcal.record.schema import to_plain

EXAMPLES = Path(__file__).parents[2] / "examples"
MACHINES = {"Prescott": "0", "Haswell": "1"}  # kernels of OpenBLAS; whether loops are compiled
RUN = """
import sys, tankcal
from pathlib import Path
from tankcal.record import record_of, save
save(record_of(tankcal.run(tankcal.load(sys.argv[1]))), Path(sys.argv[2]))
"""


def record(factor, volumes=(0.0, 40.0, 500.0), drawn=0.0):
    inputs = ["points 1", "points 2", "tape"]
    return {
        "tankcal": "0.1.0",
        "versions": {"python": "3", "numpy": "2", "scipy": "1"},
        "capacity": {
            "height_m": [0.0, 1.0, 2.0],
            "volume_m3": list(volumes),
            "inputs": inputs,
            "factor": to_plain(blocks_of(factor)),
        },
        "monte_carlo": {"se_value": [drawn, 0.0]},
        "budgets": [{"monte_carlo": {"d_low": drawn}}],
    }


F = np.array([[0.0, 0.0, 0.01], [0.02, 0.01, 0.02], [0.05, -0.03, 0.04]])


def turned(angle):
    c, s = np.cos(angle), np.sin(angle)
    return F @ np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


@pytest.mark.parametrize("other", [F * [-1, 1, -1], turned(0.7), F[:, [1, 0, 2]]])
def test_other_axes_of_the_same_uncertainty_are_the_same(other):
    found = compare_records(record(F), record(other))
    assert found.agrees
    assert found.different  # the numbers are told apart all the same


@pytest.mark.parametrize("kind", [0, 2])
def test_another_uncertainty_is_told_with_its_kind(kind):
    other = F.copy()
    other[:, kind] *= 1 + 1e-6
    (one,) = compare_records(record(F), record(other)).beyond
    assert one.place == f"capacity.factor_m3[2]'[2] of {('points', '', 'tape')[kind]}"
    variance = F[2, kind] ** 2 if kind else F[2, 0] ** 2 + F[2, 1] ** 2
    assert one.recorded == pytest.approx(variance)


def test_what_one_input_gains_another_cannot_lose():
    """The sum is the same, the budget is not."""
    other = F[:, [2, 1, 0]]
    assert not compare_records(record(F), record(other)).agrees


def test_no_finer_than_numbers_can_be_written():
    assert compare_records(record(F), record(F, drawn=4e-15)).agrees
    assert not compare_records(record(F), record(F, drawn=1e-9)).agrees
    assert not compare_records(record(F), record(F, volumes=(0.0, 40.0, 500.000001))).agrees


@pytest.mark.slow
@pytest.mark.parametrize("example", ["total-station", "partial", "reference-line"])
def test_another_machine_agrees(example, tmp_path):
    """Another kernel of OpenBLAS, other loops: every digit may move, nothing that matters may."""
    records = []
    for core, compiled in MACHINES.items():
        path = tmp_path / f"{core}.json"
        env = os.environ | {"OPENBLAS_CORETYPE": core, "TANKCAL_COMPILED": compiled}
        command = [sys.executable, "-c", RUN, str(EXAMPLES / example), str(path)]
        subprocess.run(command, check=True, env=env)
        records.append(json.loads(path.read_text(encoding="utf-8")))
    found = compare_records(*records)
    assert (found.beyond, found.otherwise) == ((), ())


def test_other_last_digits_are_told_as_rounding():
    """Numbers that are not the same, none of them by more than can be written."""
    found = compare_records(record(F), record(np.nextafter(F, 1.0)))
    assert found.agrees
    assert found.different
    assert found.largest is None
    (told, _) = verifying._numbers(found)
    assert told.code == "verify_rounded_numbers"
    assert f"{found.different} not identical bit for bit" in told
