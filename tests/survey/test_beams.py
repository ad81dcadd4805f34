"""Means of clouds as points: what they share.

Truth: closed form of independent shifts, finite differences, simulation of rigid motions.
"""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tankcal.geometry.circles import taubin_circle
from tankcal.survey.beams import points_of_beams, semidefinite_cholesky
from tankcal.survey.registration import ScanSetup, register
from tankcal.survey.wall_hits import RangingInstrument

RADIUS_M, AWAY_M, SD_M = 6.5, 12.0, 0.002
CLOSED_FORM = {3: 0.477, 4: 0.450, 6: 0.390, 8: 0.345}
EXACT = RangingInstrument("S", u_offset_m=0.0)


def ring(scans, per=60, z=3.0):
    """Places of a ring, the scan of each, normals, azimuths: scans of 360/n degrees each."""
    azimuth = 2 * np.pi * (np.arange(scans * per) + 0.5) / (scans * per)
    normal = np.column_stack([np.sin(azimuth), np.cos(azimuth), np.zeros_like(azimuth)])
    return RADIUS_M * normal + [0, 0, z], np.repeat(np.arange(scans), per), normal


def outside(scans, tool=EXACT, **declared):
    """`Registration` of scans round the tank, declared."""
    setups = []
    for i in range(scans):
        turn, pose = 2 * np.pi * (i + 0.5) / scans, np.eye(4)
        pose[:3, 3] = AWAY_M * np.sin(turn), AWAY_M * np.cos(turn), 1.5
        setups.append(ScanSetup(f"A{i}", "S", pose=pose, **declared))
    return register(setups, {"S": tool})


def mean_radius(normal):
    """(3n,) derivative of the radius of the fitted circle by all coordinates."""
    design = np.column_stack([normal[:, :2], np.ones(len(normal))])
    return (np.linalg.pinv(design)[2][:, None] * normal).ravel()


@pytest.mark.slow(after=6)
@pytest.mark.parametrize("scans", CLOSED_FORM)
@pytest.mark.parametrize("per", [60, 120])
def test_radius_of_independent_shifts(scans, per):
    """Closed form: sigma sin(w) / (w sqrt n), w = 180 deg / n, whatever the number of points."""
    xyz, scan, normal = ring(scans, per)
    registration = outside(scans, s_translation_m=SD_M, s_rotation_rad=0.0)
    found = points_of_beams(
        xyz, np.full(len(xyz), 1e-9), scan, normal, registration, {"S": (EXACT, False, False)}
    )
    by = mean_radius(normal)
    u = np.sqrt(by @ (found.points.covariance_m2 @ by))
    w = np.pi / scans
    assert u / SD_M == pytest.approx(np.sin(w) / (w * np.sqrt(scans)), rel=1e-3)
    assert u / SD_M == pytest.approx(CLOSED_FORM[scans], abs=6e-4)


@pytest.mark.study
@pytest.mark.parametrize("scans", CLOSED_FORM)
def test_scatter_of_simulated_scans(scans):
    """Simulation: rigid motions of whole scans, radius by an algebraic circle; 1000 each."""
    rng, radii = np.random.default_rng(scans), []
    xyz, scan, normal = ring(scans)
    turns = 1e-4
    registration = outside(scans, s_translation_m=SD_M, s_rotation_rad=turns)
    for _ in range(1000):
        shift = SD_M * rng.normal(size=(scans, 3))
        turn = Rotation.from_rotvec(turns * rng.normal(size=(scans, 3))).as_matrix()
        beam = xyz - registration.place_m[scan]
        moved = np.einsum("nij,nj->ni", turn[scan], beam) + registration.place_m[scan]
        radii.append(taubin_circle((moved + shift[scan])[:, :2])[2])
    found = points_of_beams(
        xyz, np.full(len(xyz), 1e-9), scan, normal, registration, {"S": (EXACT, False, False)}
    )
    by = mean_radius(normal)
    u = np.sqrt(by @ (found.points.covariance_m2 @ by))
    assert u == pytest.approx(np.std(radii), rel=0.05)
    if scans == 4:
        assert u == pytest.approx(9.0e-4, rel=0.02)


def test_columns_are_what_motions_and_a_scanner_do():
    """Finite differences: each column against places moved by hand."""
    tool = RangingInstrument("S", u_scale=1e-5, u_offset_m=1e-3, u_incidence_m=5e-4)
    xyz, scan, normal = ring(2, 7)
    registration = outside(2, tool, s_translation_m=SD_M, s_rotation_rad=1e-4)
    given = {"S": (tool, False, True)}
    found = points_of_beams(xyz, np.full(14, 1e-3), scan, normal, registration, given)
    beam = xyz - registration.place_m[scan]
    ray = beam / np.linalg.norm(beam, axis=1)[:, None]
    columns = {}
    for one in found.points.causes:
        columns.setdefault((one.what, one.name), []).append(one.column_m.reshape(14, 3))
    np.testing.assert_allclose(columns["instrument_offset", "S"][0], -1e-3 * ray, atol=1e-15)
    np.testing.assert_allclose(columns["instrument_scale", "S"][0], -1e-5 * beam, atol=1e-15)
    cosine = np.abs(np.sum(ray * normal, axis=1))
    bias = -5e-4 * (1 / cosine - 1)[:, None] * ray
    np.testing.assert_allclose(columns["incidence", "S"][0], bias, atol=1e-12)
    of_scan = columns["registration", "A1"]
    assert len(of_scan) == 6
    for axis in range(3):
        vector = np.zeros(3)
        vector[axis] = 1e-4
        turned = beam @ Rotation.from_rotvec(vector).as_matrix().T - beam
        turned[scan == 0] = 0
        np.testing.assert_allclose(of_scan[3 + axis], turned, atol=1e-7)
        np.testing.assert_allclose(of_scan[axis][:, axis], np.where(scan == 1, SD_M, 0))
    whole = sum(np.outer(one.column_m, one.column_m) for one in found.points.causes)
    np.testing.assert_allclose(
        found.points.covariance_m2.dense(), whole + 1e-6 * np.eye(42), atol=1e-18
    )
    assert [one.is_assumed for one in found.points.causes if one.what == "instrument_scale"] == [
        True
    ]


def test_a_free_offset_is_unbound_and_what_is_told_is_taken_off():
    tool = RangingInstrument("S", u_offset_m=np.nan)
    xyz, scan, normal = ring(2, 7)
    registration = outside(2, tool, s_translation_m=0.0, s_rotation_rad=0.0)
    given = {"S": (tool, False, False)}
    plain = points_of_beams(xyz, np.full(14, 1e-3), scan, normal, registration, given)
    assert [one.what for one in plain.points.unbound] == ["instrument_offset"]
    told = points_of_beams(
        xyz, np.full(14, 1e-3), scan, normal, registration, given, estimated_m={"S": 0.004}
    )
    moved = told.points.xyz_m - plain.points.xyz_m
    np.testing.assert_allclose(moved.ravel(), 0.004 * plain.points.unbound[0].column_m, atol=1e-12)


def test_factor_of_a_singular_covariance():
    rng = np.random.default_rng(0)
    half = rng.normal(size=(6, 3)) * [1, 1e-3, 1e-6]
    lower = semidefinite_cholesky(half @ half.T)
    np.testing.assert_allclose(lower @ lower.T, half @ half.T, atol=1e-15)
