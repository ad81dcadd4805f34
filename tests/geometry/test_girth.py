"""What a tape measures more than the area needs: closed forms, quadrature, the worked numbers."""

import numpy as np
import pytest

from tankcal.geometry.girth import _excess_of, perimeter_excess

TURN = 2 * np.pi * np.arange(20_000) / 20_000


@pytest.mark.parametrize(("orders", "percent"), [(6, 0.0020), (10, 0.0028), (16, 0.0035)])
def test_a_sum_of_waves(orders, percent):
    """Worked numbers: R = 10 + sum of 0.020 (2/k)^1.5 cos(kt - 0.7 k), k = 2 to the order."""
    radius = 10 + sum(
        0.020 * (2 / k) ** 1.5 * np.cos(k * TURN - 0.7 * k) for k in range(2, orders + 1)
    )
    assert 100 * _excess_of(radius) == pytest.approx(percent, abs=6e-5)


def test_a_tape_bridges_what_is_concave():
    """Worked number: R = 6.5 + 0.030 cos 20 t has 0.4247 %, its hull 0.4022 %."""
    assert 100 * _excess_of(6.5 + 0.030 * np.cos(20 * TURN)) == pytest.approx(0.4022, abs=1e-4)


@pytest.mark.parametrize(
    ("sd_m", "shares", "percent", "sd_percent"),
    [
        (0.020, (1, 0), 0.0140, 0.0032),
        (0.005, (0, 1), 0.0153, 0.0017),
        (0.010, (0, 1), 0.0570, None),
    ],
)  # fmt: skip
def test_random_walls(sd_m, shares, percent, sd_percent, figure):
    """Worked numbers of 2000 draws, K = 144 for seams; here 64 draws and waves down to 0.2 m."""
    mean, sd = perimeter_excess(sd_m, 6.5, shares=shares)
    figure(f"excess of the perimeter, {1000 * sd_m:.0f} mm, {shares}, %",
           f"{100 * mean:.4f} +- {100 * sd:.4f}")  # fmt: skip
    assert 100 * mean == pytest.approx(percent, rel=0.08)
    if sd_percent:
        assert 100 * sd == pytest.approx(sd_percent, rel=0.3)


def test_a_round_wall_has_none():
    assert perimeter_excess(0.0, 6.5) == (0.0, 0.0)
    assert _excess_of(np.full(2000, 6.5)) == pytest.approx(0.0, abs=1e-12)
