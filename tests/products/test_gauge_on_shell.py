"""A gauge carried by the shell, simulated from the job's plates and read through its files.

The simulator knows nothing of tankcal: it integrates the strain of a thin shell by small slices.
"""

import csv

import numpy as np
import pytest
from conftest import EXAMPLE
from page_figures import agree, figures_of
from test_gauge import computed, record_folder, write

from tankcal.cli import main

__all__ = ["record_folder"]
DENSITY, GRAVITY, POISSON, E_PA = 1000.0, 9.80665, 0.3, 206e9
RADIUS_M, TOP_M, SLICE_M = 6.47, 9.5, 1e-3


def plates():
    """(height, thickness) of each course, m, read from the table of the job."""
    lines = (EXAMPLE / "courses.csv").read_text(encoding="utf-8").splitlines()
    rows = csv.DictReader(line for line in lines if not line.startswith("#"))
    return [(float(row["height_m"]), float(row["thickness_mm"]) / 1000) for row in rows]


def drop_of_the_top(level, radius=RADIUS_M):
    """Movement of the top of the shell at a level, m: hoop stress times Poisson's ratio, summed."""
    z = np.arange(SLICE_M / 2, TOP_M, SLICE_M)
    tops = np.cumsum([height for height, _ in plates()])
    thickness = np.array([t for _, t in plates()])[np.minimum(np.searchsorted(tops, z),
                                                              len(tops) - 1)]  # fmt: skip
    pressure = DENSITY * GRAVITY * np.maximum(np.asarray(level, float)[..., None] - z, 0)
    strain = POISSON * pressure * radius / thickness / E_PA
    return strain.sum(axis=-1) * SLICE_M


def settings(record, **more):
    gauge = {"supported_by": "shell", "record": str(record), "lowest_m": 0.5, "highest_m": 9.0,
             "tank": "SILVA-1995", "resolution_mm": 0.1}  # fmt: skip
    return {"gauge": gauge, "liquid": {"density_kg_m3": DENSITY}, **more}


@pytest.mark.slow
def test_corrections_of_a_perfect_gauge_are_the_movement_of_the_top(tmp_path, record_folder):
    levels = np.array([1.0, 2.5, 4.0, 6.0, 7.5, 9.0])
    rows = [(n, level, level + drop_of_the_top(level)) for n, level in enumerate(levels)]
    gauge = computed(write(tmp_path / "g", rows, **settings(record_folder / "r")))
    moved = [row["movement_mm"] for row in gauge["levels"]]
    # The radius of the survey differs from the drawing by 0.1 %, and so does the movement.
    assert moved == pytest.approx(1000 * drop_of_the_top(levels), rel=3e-3)
    for row in gauge["corrections"]:
        drop_mm = 1000 * drop_of_the_top(row["gauge_m"])
        assert row["correction_mm"] == pytest.approx(-drop_mm, abs=2e-3 + 2e-3 * drop_mm)
    # The two parameters of HyTD: straight above L_0, with its error in the export's report.
    head = gauge["head"]
    line = -head["factor_mm_per_m"] * np.maximum(levels - head["start_m"], 0)
    assert np.abs(line + 1000 * drop_of_the_top(levels)).max() <= head["off_mm"] * 1.01 + 2e-3


def simulated(rng, *, dip_mm, gauge_mm):
    """Readings of a gauge on the shell, and its mean indication at a true level."""
    zero, scale = rng.normal(0, 2e-3), rng.normal(0, 1e-4)
    share = 1 + 0.2 * 3**0.5 * rng.uniform(-1, 1)  # plates, modulus and restraint of the bottom
    tape_zero, tape_scale, tape_k = rng.normal(0, 1e-4), rng.normal(0, 2e-5), rng.normal(0, 0.5)

    def indicated(level):
        reference = TOP_M + 0.3 - share * drop_of_the_top(level)
        return TOP_M + 0.3 + zero - (1 + scale) * (reference - level)

    rows = []
    for name, nominal in enumerate(np.linspace(1.0, 9.0, 6)):
        level = nominal + rng.uniform(-0.2, 0.2) if nominal < 9 else nominal
        friction = gauge_mm / 1000 * 3**0.5 * rng.uniform(-1, 1)  # equal for all repeats
        for _ in range(2):
            length = (level - tape_zero) / ((1 + tape_scale) * (1 + 1.15e-5 * tape_k))
            dip = length + dip_mm / 1000 * 3**0.5 * rng.uniform(-1, 1)
            rows.append((name, round(dip, 6), round(indicated(level) + friction, 4), 20))
    return rows, indicated


@pytest.mark.study
@pytest.mark.parametrize(("dip_mm", "gauge_mm"), [(1.0, 0.5), (0.1, 0.1)])
def test_coverage_of_the_corrections_of_a_gauge_on_the_shell(
    tmp_path, record_folder, figure, dip_mm, gauge_mm
):
    """300 comparisons through files; the corrected indication at levels that were not compared."""
    rng, inside, draws = np.random.default_rng(5), [], 300
    declared = {"u_dip_mm": dip_mm, "u_gauge_mm": gauge_mm, "u_tape_zero_mm": 0.1,
                "u_tape_ppm": 20, "u_tape_temperature_k": 0.5}  # fmt: skip
    more = settings(record_folder / "r", uncertainty=declared)
    for number in range(draws):
        rows, indicated = simulated(rng, dip_mm=dip_mm, gauge_mm=gauge_mm)
        gauge = computed(write(tmp_path / str(number % 2), rows, "level,dip_m,gauge_m,tape_c",
                               **more))  # fmt: skip
        corrections = [row for row in gauge["corrections"] if not row["is_outside"]]
        level = np.array([row["gauge_m"] + row["correction_mm"] / 1000 for row in corrections])
        seen = np.array([row["gauge_m"] for row in corrections])
        U = np.array([row["U_mm"] for row in corrections])
        off_mm = 1000 * (indicated(level) - seen)
        inside.append((np.abs(off_mm) <= U)[[0, len(U) // 2, -1]])
    share = np.mean(inside, axis=0)
    figure(f"coverage of a gauge on the shell, dips {dip_mm} mm", share.round(3).tolist())
    stated = {
        0.1: figures_of("docs/studies/gauge.md", "| 0.1 mm | () | () | () |"),
        1.0: figures_of("docs/studies/gauge.md", "| 1 mm | () | () | () |"),
    }
    assert agree(share, stated[dip_mm])
    assert share.min() >= 0.92  # 300 draws: 0.95 less 2.4 standard errors


@pytest.mark.slow
def test_the_certificate_of_a_gauge_on_the_shell_is_verified(tmp_path, record_folder, capsys):
    rows, _ = simulated(np.random.default_rng(1), dip_mm=0.5, gauge_mm=0.5)
    folder = write(tmp_path / "g", rows, "level,dip_m,gauge_m,tape_c",
                   **settings(record_folder / "r"))  # fmt: skip
    assert main(["gauge", str(folder), "--out", str(tmp_path / "out"), "--quiet"]) == 0
    assert main(["verify", str(tmp_path / "out"), "--job", str(folder), "--quiet"]) == 0
    assert "all equal" in capsys.readouterr().out
