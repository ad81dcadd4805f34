"""The shell in service: published factor, closed forms."""

import numpy as np
import pytest

from tankcal.tank.service import MILD_STEEL_PER_K, shell_factor, shell_temperature_c

DEGREES_F_60, DEGREES_F_128 = (60 - 32) / 1.8, (128 - 32) / 1.8


def test_the_shell_factor_at_128_degrees_fahrenheit_published():
    """CTSh(128 degF) on a table for 60 degF."""
    assert round(shell_factor(DEGREES_F_128, DEGREES_F_60), 8) == 1.00084338


def test_the_shell_factor_is_the_square_of_the_stretch():
    warm = np.array([-20.0, 15.0, 90.0])
    assert shell_factor(warm) == pytest.approx((1 + MILD_STEEL_PER_K * (warm - 15)) ** 2, rel=1e-15)
    assert shell_factor(15.0) == 1


def test_the_coefficient_is_that_of_the_customary_units():
    assert pytest.approx(6.20e-6 * 1.8, rel=1e-12) == MILD_STEEL_PER_K


def test_shell_temperature_of_bare_and_insulated_tank():
    """(7 * 60 + 20) / 8 = 55, closed form."""
    assert shell_temperature_c(60.0, 20.0) == 55
    assert shell_temperature_c(60.0, insulated=True) == 60
    with pytest.raises(ValueError, match="ambient"):
        shell_temperature_c(60.0)
