"""Poses of scans from targets.

Truth: a dense least squares of another library with numerical derivatives, simulation, and what a
blunder of a known size does.
"""

from dataclasses import replace

import numpy as np
import pytest
import scipy.optimize
from scipy.spatial.transform import Rotation

from tankcal.errors import SolutionError
from tankcal.survey.registration import KnownTargets, ScanSetup, ScanTarget, fit_motion, register
from tankcal.survey.wall_hits import RangingInstrument

TOOLS = {"S": RangingInstrument("S", u_scale=2e-5, u_offset_m=1e-3)}
PLACES = np.array(
    [[5.0, 1.0, 0.4], [-4.0, 3.5, 2.9], [-2.5, -5.5, 0.8], [4.4, -3.9, 4.1], [0.5, 5.8, 1.6]]
)
NAMES = tuple(f"T{i}" for i in range(1, 6))
SD_M, KNOWN_M = 1e-3, 5e-4


def surveyed(rng, scans=2, noise=1.0, turn=1.5):
    """Scans, their targets, what is known of these, and the true places and rotations."""
    setups, targets, truth = [], [], []
    for i in range(scans):
        rotation = Rotation.from_rotvec(turn * rng.uniform(-1, 1, 3)).as_matrix()
        place = rng.uniform(-1, 1, 3)
        setups.append(ScanSetup(f"A{i}", "S"))
        truth.append((place, rotation))
        for row, (name, xyz) in enumerate(zip(NAMES, PLACES, strict=True), 2):
            own = (xyz - place) @ rotation + noise * SD_M * rng.normal(size=3)
            targets.append(ScanTarget(f"A{i}", name, own, SD_M, row))
    known = PLACES + noise * KNOWN_M * rng.normal(size=PLACES.shape)
    shared = KNOWN_M**2 * (0.5 * np.eye(15) + 0.5 * np.tile(np.eye(3), (5, 5)))
    return setups, targets, KnownTargets(NAMES, known, shared), truth


def by_another_way(setups, targets, known, found):
    """State and covariance by numbers alone: poses, scale, offset on targets, places of targets."""
    scan = np.array([int(one.scan[1:]) for one in targets])
    target = np.array([NAMES.index(one.target) for one in targets])
    own = np.array([one.xyz_m for one in targets])
    half = np.linalg.inv(np.linalg.cholesky(known.covariance_m2))
    s = len(setups)

    def misfit(state):
        pose = state[: 6 * s].reshape(s, 6)
        scale, offset = state[6 * s : 6 * s + 2]
        at = state[6 * s + 2 :].reshape(-1, 3)
        turned = Rotation.from_rotvec(pose[:, 3:]).as_matrix() @ found.rotation
        distance = np.linalg.norm(own, axis=1)
        beam = own * ((distance - offset) / (1 + scale) / distance)[:, None]
        there = pose[scan, :3] + np.einsum("nij,nj->ni", turned[scan], beam)
        return np.concatenate(
            [
                ((there - at[target]) / SD_M).ravel(),
                half @ (at - known.xyz_m).ravel(),
                [scale / TOOLS["S"].u_scale, offset / TOOLS["S"].u_offset_m],
            ]
        )

    start = np.zeros(6 * s + 2 + 15)
    start[: 6 * s].reshape(s, 6)[:, :3] = found.place_m
    start[6 * s + 2 :] = known.xyz_m.ravel()
    size = np.full(len(start), 1e-3)
    done = scipy.optimize.least_squares(misfit, start, jac="3-point", x_scale=size, xtol=1e-15)
    return done.x, np.linalg.inv(done.jac.T @ done.jac), 2 * done.cost


def test_poses_are_those_of_a_dense_adjustment():
    """Second method."""
    setups, targets, known, _ = surveyed(np.random.default_rng(5))
    found = register(setups, TOOLS, targets, known)
    state, covariance, chi2 = by_another_way(setups, targets, known, found)
    assert found.ties == ("network", "network")
    np.testing.assert_allclose(found.place_m, state[:12].reshape(2, 6)[:, :3], atol=1e-7)
    np.testing.assert_allclose(state[:12].reshape(2, 6)[:, 3:], 0, atol=1e-8)
    np.testing.assert_allclose(found.scale, state[12], atol=1e-9)
    assert found.chi2 == pytest.approx(chi2, rel=1e-6)
    assert found.dof == 2 * 15 - 12
    scale = np.sqrt(np.outer(*[found.covariance.diagonal()] * 2))
    np.testing.assert_allclose(found.covariance / scale, covariance[:13, :13] / scale, atol=2e-4)


@pytest.mark.slow
def test_covariance_holds_for_drawn_surveys():
    """Simulation: errors of poses against their joint covariance, 12 values each."""
    rng, statistics = np.random.default_rng(11), []
    for _ in range(150):
        setups, targets, known, truth = surveyed(rng)
        drawn = np.linalg.cholesky(known.covariance_m2) @ rng.normal(size=15)
        known = replace(known, xyz_m=PLACES + drawn.reshape(5, 3))
        found = register(setups, TOOLS, targets, known)
        errors = []
        for i, (place, rotation) in enumerate(truth):
            turn = Rotation.from_matrix(found.rotation[i] @ rotation.T).as_rotvec()
            errors += [*(found.place_m[i] - place), *turn]
        own = found.covariance[:12, :12]
        statistics.append(np.array(errors) @ np.linalg.solve(own, errors))
    assert np.mean(statistics) == pytest.approx(12, rel=0.1)


def test_scans_tie_one_another_without_a_survey():
    """Closed form: with exact pose of the first, the second is as its targets say."""
    setups, targets, _, truth = surveyed(np.random.default_rng(2), noise=0)
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = truth[0][1], truth[0][0]
    setups[0] = replace(setups[0], pose=pose, s_translation_m=0.0, s_rotation_rad=0.0)
    found = register(setups, TOOLS, targets)
    assert found.ties == ("frame", "network")
    np.testing.assert_allclose(found.place_m[1], truth[1][0], atol=1e-9)
    assert found.sd_of(0) == (0.0, 0.0)
    assert found.sd_of(1)[0] > 3e-4


def test_one_scan_alone_is_the_frame_with_its_lean():
    alone = ScanSetup("A", "S", s_translation_m=0.0, s_rotation_rad=5e-5)
    found = register([alone], TOOLS)
    np.testing.assert_allclose(
        found.covariance, np.diag([0, 0, 0, 25e-10, 25e-10, 25e-10, 4e-10]), atol=1e-20
    )


def test_exact_scans_of_an_exact_scanner_leave_nothing_to_adjust():
    scans = [ScanSetup(name, "S", s_translation_m=0.0, s_rotation_rad=0.0) for name in "AB"]
    found = register(scans, {"S": RangingInstrument("S", u_scale=0.0, u_offset_m=0.0)})
    assert found.ties == ("frame", "declared")
    assert found.sd_of(1) == (0.0, 0.0)


def test_a_declared_pose_beside_targets_is_not_used_twice():
    """Property: three targets or more tell the pose, whatever was declared."""
    setups, targets, known, _ = surveyed(np.random.default_rng(5))
    plain = register(setups, TOOLS, targets, known)
    declared = [replace(one, s_translation_m=1e-4, s_rotation_rad=1e-6) for one in setups]
    again = register(declared, TOOLS, targets, known)
    np.testing.assert_array_equal(plain.covariance, again.covariance)


def test_a_moved_target_is_set_aside_by_name():
    setups, targets, known, truth = surveyed(np.random.default_rng(7))
    targets[3] = replace(targets[3], xyz_m=targets[3].xyz_m + [0.0, 0.02, 0.0])
    found = register(setups, TOOLS, targets, known)
    assert [(one.scan, one.target) for one in found.residuals if one.removed] == [("A0", "T4")]
    np.testing.assert_allclose(found.place_m[0], truth[0][0], atol=3e-3)
    moved = next(one for one in found.residuals if one.removed)
    assert np.linalg.norm(moved.residual_m) == pytest.approx(0.02, abs=0.004)


def test_smallest_detectable_blunder_moves_w_by_its_noncentrality():
    """Definition: a blunder of that size shifts w by 4.13 along the axis that shows least."""
    setups, targets, known, truth = surveyed(np.random.default_rng(3), scans=1, noise=0)
    one = register(setups, TOOLS, targets, known).residuals[2]
    found = []
    for axis in range(3):
        shift = one.mdb_m * truth[0][1][axis]  # along an axis of the tank, in the scan's frame
        spoilt = list(targets)
        spoilt[2] = replace(targets[2], xyz_m=targets[2].xyz_m + shift)
        found.append(register(setups, TOOLS, spoilt, known).residuals[2].w)
    assert min(found) == pytest.approx(4.13, rel=1e-3)


@pytest.mark.parametrize(
    ("spoil", "said"),
    [
        (lambda xyz: xyz * [1, -1, 1], "mirror image"),
        (lambda xyz: xyz / 0.3048, "3.281 times as far apart"),
        (lambda xyz: xyz * 1000, "1000 times as far apart"),
    ],
)
def test_another_frame_and_another_unit_are_named(spoil, said):
    setups, targets, known, _ = surveyed(np.random.default_rng(4))
    spoilt = [replace(one, xyz_m=spoil(one.xyz_m)) for one in targets]
    with pytest.raises(SolutionError, match=said):
        register(setups, TOOLS, spoilt, known)


def test_exchanged_names_are_named():
    setups, targets, known, _ = surveyed(np.random.default_rng(4))
    targets[1], targets[2] = replace(targets[1], target="T3"), replace(targets[2], target="T2")
    with pytest.raises(SolutionError, match=r"'T[23]' and 'T[23]' of scan 'A0'"):
        register(setups, TOOLS, targets, known)


def test_scans_without_a_tie_and_targets_in_a_line_are_refused():
    setups, targets, known, _ = surveyed(np.random.default_rng(4))
    with pytest.raises(SolutionError, match="nothing ties scans A0, A1"):
        register(setups, TOOLS, targets[:2], known)
    line = KnownTargets(NAMES, np.outer(np.arange(5.0), [1, 2, 0]), known.covariance_m2)
    in_line = [replace(one, xyz_m=line.xyz_m[i % 5]) for i, one in enumerate(targets)]
    with pytest.raises(SolutionError, match="stand in one line"):
        register(setups, TOOLS, in_line, line)


def test_held_targets_are_no_singular_covariance():
    setups, targets, known, truth = surveyed(np.random.default_rng(6), noise=0)
    held = replace(known, covariance_m2=np.zeros((15, 15)))
    found = register(setups, TOOLS, targets, held)
    np.testing.assert_allclose(found.place_m[0], truth[0][0], atol=1e-8)


def test_a_motion_is_found_back():
    rng = np.random.default_rng(1)
    turn, shift = Rotation.random(random_state=2).as_matrix(), rng.normal(size=3)
    fit = fit_motion(PLACES, 0.3 * PLACES @ turn.T + shift, scaled=True)
    np.testing.assert_allclose(fit.rotation, turn, atol=1e-12)
    assert fit.scale == pytest.approx(0.3)
    assert fit.rms_m < 1e-12
