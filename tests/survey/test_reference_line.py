"""Offsets from reference lines: the page's worked numbers, both faces, levels and the lean."""

import numpy as np
import pytest
from job_builder import LEVELS_B

from tankcal.survey.reference_line import (
    Line,
    Offset,
    Plummet,
    ReferenceLines,
    collimation_by_faces,
    lean_of,
    level_names,
    levels_of,
)
from tankcal.units import ARCSEC

LEVELS_A = {0.4: ["151.1 148.9 150.2 150.8 149.3 150.0 150.5 149.7"],
            1.2: ["153.4 146.9 146.5 149.6 149.5 148.9 150.2 152.4"],
            4.0: ["159.1 141.9 136.1 143.9 148.0 147.1 151.5 160.1"]}  # fmt: skip


def lines_of(levels, faces=(1, 2), inside=False):
    """ReferenceLines of a dict of levels, as the pages print them; the lowest is the reference."""
    count = len(next(iter(levels.values()))[0].split())
    lines = {
        str(i): Line(str(i), 2 * np.pi * i / count, "ZL", inside) for i in range(count)
    }  # fmt: skip
    offsets = [
        Offset(str(i), str(level), level, float(text) / 1000, 5e-4, face, level == min(levels))
        for level, rows in levels.items()
        for face, row in enumerate(rows, 1)
        if face in faces
        for i, text in enumerate(row.split())
    ]
    return ReferenceLines(lines, tuple(offsets), {"ZL": Plummet("ZL")})


def test_case_a_without_collimation():
    given = lines_of(LEVELS_A)
    levels = levels_of(given, given.offsets, {})
    rho = 40.9563 / (2 * np.pi)
    assert [rho + one.rise_m for one in levels] == pytest.approx([6.518785, 6.519998], abs=5e-7)
    leans = [1000 * np.array(one.centre_m) / (one.level_m - 0.4) for one in levels]
    assert leans[0] == pytest.approx([2.12, -1.32], abs=0.005)
    assert leans[1] == pytest.approx([2.10, -1.29], abs=0.005)
    assert collimation_by_faces(given, given.offsets, "ZL") is None


def test_case_b_both_faces():
    given = lines_of(LEVELS_B)
    kappa, sd = collimation_by_faces(given, given.offsets, "ZL")
    assert kappa / ARCSEC == pytest.approx(9.03, abs=0.005)
    assert sd / ARCSEC == pytest.approx(2.62, abs=0.005)
    levels, rho = levels_of(given, given.offsets, {"ZL": kappa}), 32.8673 / (2 * np.pi)
    expected = [5.23040, 5.22959, 5.22910, 5.22879]
    assert [rho + one.rise_m for one in levels] == pytest.approx(expected, abs=5e-6)
    lean = lean_of(given, levels)
    assert 1000 * np.array([lean.x, lean.y]) == pytest.approx([-1.40, 3.20], abs=0.005)
    assert lean.sd < 1e-5


def test_case_b_one_face():
    given = lines_of(LEVELS_B, faces=(1,))
    levels = levels_of(given, given.offsets, {})
    rho = 32.8673 / (2 * np.pi)
    expected = [5.23033, 5.22945, 5.22889, 5.22850]
    assert [rho + one.rise_m for one in levels] == pytest.approx(expected, abs=6e-6)


def test_inside_both_signs_turn():
    outside, inside = lines_of(LEVELS_B), lines_of(LEVELS_B, inside=True)
    one, other = (levels_of(given, given.offsets, {}) for given in (outside, inside))
    assert [level.rise_m for level in one] == pytest.approx([-level.rise_m for level in other])
    assert one[0].centre_m == pytest.approx([-x for x in other[0].centre_m])


def test_the_lean_of_too_few_levels():
    given = lines_of(dict(list(LEVELS_A.items())[:1]))
    assert np.isnan(lean_of(given, ()).x)
    given = lines_of(dict(list(LEVELS_A.items())[:2]))
    lean = lean_of(given, levels_of(given, given.offsets, {}))
    assert 1000 * lean.x == pytest.approx(2.12, abs=0.005)
    assert np.isnan(lean.sd)


def test_levels_are_told_apart_by_course_and_height():
    heights = [("1", 0.4), ("1", 0.41), ("1", 1.2), ("2", 1.2), ("1", 0.405)]
    offsets = [Offset("L", course, level, 0.1, 1e-3) for course, level in heights]
    assert list(level_names(offsets)) == [0, 0, 1, 2, 0]
