"""The wall where the dip of a lying tank meets it: told when unseen, and what points there do."""

import numpy as np
import pytest
from generated_solids import LyingShell, job_of

from tankcal.pipeline.checks.size import check_scan
from tankcal.pipeline.scanned_solids import fit_scan
from tankcal.pipeline.tanks import body_of
from tankcal.tank.capacity import Capacity
from tankcal.units import FULL_TURN

RADIUS_M, LENGTH_M, DENT_M = 1.2, 8.0, 0.012


def dented():
    """A cylinder with a dent at the foot of its dip, 0.5 m wide."""
    shell = LyingShell(RADIUS_M, LENGTH_M, LENGTH_M / 2, 0.0)

    def dent(turn, along):
        arc = RADIUS_M * ((turn + np.pi) % FULL_TURN - np.pi)
        return -DENT_M * np.exp(-(arc**2 + (along - LENGTH_M / 2) ** 2) / 0.25**2)

    shell.departures.append(dent)
    return shell


def computed(shell, folder, *, at_foot):
    """Codes of the warnings, and error and U at half height, of eight rings of 24 points."""
    rng = np.random.default_rng(5)
    along = np.repeat(LENGTH_M * (np.arange(8) + 0.5) / 8, 24)
    turn = np.tile(FULL_TURN * np.arange(24) / 24, 8)
    if at_foot:
        along = np.append(along, np.full(3, LENGTH_M / 2))
        turn = np.append(turn, np.array([-0.05, 0.0, 0.05]) / RADIUS_M)
    r = shell.radius_at(turn, along)
    xyz = np.column_stack([along, r * np.sin(turn), -r * np.cos(turn)])
    job = job_of(shell, xyz + 1e-3 * rng.normal(size=xyz.shape), 1e-3, folder)
    scan = fit_scan(job)
    body, dip = body_of(job, scan), np.array([RADIUS_M])
    volumes, areas, sources = body.rows(dip)
    table = Capacity(dip, volumes, areas, sources, 0.95)
    codes = [one.expected.code for one in check_scan(job, scan, body.highest_m)]
    return codes, (volumes - shell.volume_below(dip))[0], table.U_m3[0]


@pytest.mark.slow
def test_a_foot_that_nobody_measured_is_told(tmp_path):
    codes, error, expanded = computed(dented(), tmp_path, at_foot=False)
    assert codes.count("dip_foot_unseen") == 1
    assert abs(error) > expanded  # the dent, 12 mm, is that of the zero


@pytest.mark.slow
def test_three_points_at_it_tell_the_zero(tmp_path):
    codes, error, expanded = computed(dented(), tmp_path / "dented", at_foot=True)
    assert "dip_foot_unseen" not in codes
    assert abs(error) < expanded


@pytest.mark.slow
def test_they_make_u_smaller(tmp_path):
    sound = LyingShell(RADIUS_M, LENGTH_M, LENGTH_M / 2, 0.0)
    without, having = (
        computed(sound, tmp_path / str(at_foot), at_foot=at_foot)[2] for at_foot in (False, True)
    )
    assert having < 0.7 * without
