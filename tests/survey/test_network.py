"""The network adjustment: right answers of other programs, second methods, invariances, datum."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from conftest import ROOT
from networks import INTERIOR, SCOPE, by_total_station, photographed

import tankcal.camera.imaging
import tankcal.solver.compiled
import tankcal.solver.elimination
import tankcal.survey.network.assembly
from tankcal.adjust import noncentrality
from tankcal.camera.model import CONVENTIONS, Form
from tankcal.errors import SolutionError
from tankcal.geometry.rotations import rotation_of_angles
from tankcal.solver import Group, Model, solve
from tankcal.solver.compiled import compile_functions
from tankcal.survey.network import Instrument, adjust, snoop
from tankcal.survey.network.datum import directions
from tankcal.survey.network.quality import (
    accuracy,
    compare_left_out,
    components,
    ellipsoid_factor,
    ellipsoids,
    estimate_variance_components,
    precision,
)
from tankcal.survey.network.reliability import tau_limit
from tankcal.survey.observations import ControlCoordinates, Distances, HeightDifferences, PlumbLines


def whole_matrix(adjusted):
    """All whitened rows as one dense matrix (rows, unknowns)."""
    model = adjusted.problem.model
    rows = []
    for group, jac in zip(model.groups, adjusted.solution.cofactor.jacobians, strict=True):
        n, m, _ = jac.shape
        dense = np.zeros((n, m, model.unknowns + 1))
        index = np.broadcast_to(group.columns[:, None, :], jac.shape)
        np.add.at(dense, (np.arange(n)[:, None, None], np.arange(m)[None, :, None], index), jac)
        rows.append(dense.reshape(n * m, -1)[:, :-1])
    return np.vstack(rows)


@pytest.fixture(scope="module")
def survey():
    return photographed()[0]


@pytest.fixture(scope="module")
def adjusted(survey):
    return adjust(survey)


def test_right_answer_of_three_programs(shared, tmp_path, monkeypatch):
    """Other programs (Ceres, gtsam, scipy): cost, sigma0 and trace of problem a."""
    monkeypatch.syspath_prepend(str(shared / "bench"))
    sim_tank = pytest.importorskip("sim_tank")
    monkeypatch.syspath_prepend(str(ROOT / "benchmarks" / "adjustment"))
    import problems

    found = adjust(problems.tank(sim_tank.make()))
    assert found.problem.model.unknowns == 487
    assert 0.5 * found.solution.chi2 == pytest.approx(2.0725167112e02, rel=1e-10)
    assert found.sigma0 == pytest.approx(0.96840, abs=5e-6)
    covariance = found.covariance_m2()
    assert covariance.shape == (411, 411)
    assert np.trace(covariance) == pytest.approx(6.575062e-04, rel=1e-7)


def test_cofactors_are_the_inverse_of_the_whole_normal_matrix(adjusted):
    """Second method: dense inverse of J'J, columns scaled; every block, every redundancy."""
    a = whole_matrix(adjusted)
    scale = np.linalg.norm(a, axis=0)
    basis, r = np.linalg.qr(a / scale)
    inverse = np.linalg.inv(r) / scale[:, None]
    q = inverse @ inverse.T
    n = adjusted.problem.model.unknowns
    found = adjusted.solution.cofactor.among(np.arange(n))
    size = np.sqrt(np.diag(q))
    assert np.abs((found - q) / np.outer(size, size)).max() < 1e-8
    columns = adjusted.problem.layout.points
    blocks = q[columns[:, :, None], columns[:, None, :]]
    assert adjusted.point_covariances_m2 == pytest.approx(blocks, rel=1e-7, abs=1e-14)
    some = [5, 40, 2]
    assert adjusted.covariance_m2(some) == pytest.approx(
        q[np.ix_(columns[some].ravel(), columns[some].ravel())], rel=1e-7, abs=1e-14
    )
    redundancy = np.concatenate([r.ravel() for r in adjusted.solution.cofactor.redundancy()])
    assert redundancy == pytest.approx(1 - np.sum(basis**2, axis=1), abs=1e-9)
    assert redundancy.sum() == pytest.approx(adjusted.dof, rel=1e-9)


def photographed_as_dbat():
    return photographed(form=Form("correction_added", "before_distortion"))


def not_compiled(module, names):
    """The loops as they are written, run by Python: no compiler to wait for."""
    return SimpleNamespace(**{name: vars(module)[name] for name in names})


@pytest.mark.slow
@pytest.mark.parametrize(
    "compiler", [not_compiled, pytest.param(compile_functions, marks=pytest.mark.slow)]
)
@pytest.mark.parametrize("make", [photographed, photographed_as_dbat, by_total_station])
def test_loops_and_arrays_agree(make, compiler, monkeypatch):
    survey = make()[0]
    found = []
    for choice in (True, False):
        solver = tankcal.solver
        for room in (solver.elimination, solver.cofactors, tankcal.camera.imaging):
            monkeypatch.setattr(room, "is_worth_compiling", lambda rows=0, choice=choice: choice)
        for room in (solver.elimination, solver.propagate, tankcal.camera.imaging):
            monkeypatch.setattr(room, "compile_functions", compiler)
        found.append(adjust(survey, datum="inner"))
        assert found[-1].residuals  # leverages too
        assert found[-1].point_covariances_m2.any()
    first, second = found
    assert second.solution.chi2 == pytest.approx(first.solution.chi2, rel=1e-10)
    assert second.xyz_m == pytest.approx(first.xyz_m, abs=1e-9)
    assert second.covariance_m2() == pytest.approx(first.covariance_m2(), rel=1e-6, abs=1e-13)
    assert second.point_covariances_m2 == pytest.approx(
        first.point_covariances_m2, rel=1e-6, abs=1e-13
    )
    for one, other in zip(first.residuals, second.residuals, strict=True):
        assert other.w == pytest.approx(one.w, abs=1e-5)


@pytest.mark.parametrize("start_m", [0.0, 0.9])
def test_rows_count_that_say_something_at_the_minimum(start_m):
    """Two slopes of 10 m in plan do not feel a height of 0 at the start, but where it ends."""
    height_m = np.sqrt(10.05**2 - 10**2)

    def slopes(z, w, jac):
        slope = np.hypot(10.0, z[0])
        w[:] = (slope - 10.05) / 0.001
        jac[:] = z[0] / slope / 0.001

    def level(z, w, jac):
        w[:] = (z[0] - height_m) / 0.01
        jac[:] = 1 / 0.01

    groups = Group(np.zeros((2, 1), int), 1, slopes), Group(np.zeros((1, 1), int), 1, level)
    found = solve(Model(1, 0, groups, np.add), np.array([start_m]))
    assert (found.rows, found.dof) == (3, 2)
    assert found.unknowns == pytest.approx(height_m, abs=1e-9)


def test_rows_in_parts_give_what_all_of_them_give(survey, adjusted, monkeypatch):
    """Second method: the derivatives of a group at once; here a dozen image points at a time."""
    for room in (tankcal.solver.elimination, tankcal.survey.network.assembly):
        monkeypatch.setattr(room, "PART", 12)
    found = adjust(survey)
    parts = [part.jac for part in found.solution.cofactor.rows.parts if len(part.w) == 12]
    assert len(parts) > 5
    assert np.shares_memory(parts[0], parts[-1])
    assert found.solution.chi2 == pytest.approx(adjusted.solution.chi2, rel=1e-12)
    assert found.solution.rows == adjusted.solution.rows
    assert found.xyz_m == pytest.approx(adjusted.xyz_m, abs=1e-10)
    assert found.point_covariances_m2 == pytest.approx(adjusted.point_covariances_m2, rel=1e-9)
    leverage = found.solution.cofactor.redundancy()[-1]
    rows_of, before = (one.problem.rows_of[-1] for one in (found, adjusted))
    expected = adjusted.solution.cofactor.redundancy()[-1][np.argsort(before)]
    assert leverage[np.argsort(rows_of)] == pytest.approx(expected, abs=1e-9)


def test_small_jobs_do_not_wait_for_a_compiler(monkeypatch):
    """The size of a problem decides, for each part of it; never what was done before."""
    room = tankcal.solver.compiled
    monkeypatch.setattr(room, "available", lambda: True)
    monkeypatch.setattr(room, "_requested_mode", lambda: "patient")
    monkeypatch.setattr(room, "are_kept", lambda: False)
    assert not any(room.is_worth_compiling(room.AT_ONCE - 1) for _ in range(1000))
    assert room.is_worth_compiling(room.AT_ONCE)
    assert not room.is_worth_compiling()
    with room.problem_of(room.AT_ONCE):
        assert room.is_worth_compiling()
        assert room.is_worth_compiling(10)
    assert not room.is_worth_compiling()


@pytest.mark.parametrize("affinity", ["b1_b2", "before_distortion"])
@pytest.mark.parametrize("convention", CONVENTIONS)
def test_finds_the_truth_without_noise(convention, affinity):
    """Property: observations without error give the truth back, in every convention."""
    survey, truth = photographed(form=Form(convention, affinity), noise=0.0)
    found = adjust(survey)
    assert 0.5 * found.solution.chi2 < 1e-12
    assert found.xyz_m == pytest.approx(truth.xyz_m, abs=1e-7)
    values = np.array(list(found.camera()[0].values()))
    sds = np.sqrt(np.diag(found.camera()[2]))
    off = (values - INTERIOR)[np.array(SCOPE) != "off"] / sds
    assert np.abs(off).max() < 1e-4


def moved(survey, rotation, shift, order=None):
    """The survey in a frame that is turned and shifted, its rows in another order."""
    control, distances = survey.observations
    xyz = control.value.reshape(-1, 3) @ rotation.T + shift
    control = replace(control, value=xyz.ravel())
    photos = replace(
        survey.photos,
        xyz_m=survey.photos.xyz_m @ rotation.T + shift,
        rotation=survey.photos.rotation @ rotation.T,
    )
    images = survey.image_points
    if order is not None:
        images = replace(
            images,
            point=images.point[order],
            photo=images.photo[order],
            value=images.value[order],
            sd=images.sd[order],
        )
    return replace(
        survey,
        xyz_m=survey.xyz_m @ rotation.T + shift,
        photos=photos,
        observations=(distances, control) if order is not None else (control, distances),
        image_points=images,
    )


def test_large_coordinates_and_a_turned_frame_change_nothing(survey, adjusted, figure):
    """Property: UTM-sized shift, any rotation (one photo then looks along x), any order of rows."""
    r0 = adjusted.solution.unknowns.rotation[0]
    along_x = np.array([[0.0, 0, 1], [0, 1, 0], [-1, 0, 0]]) @ r0  # that photo gets phi = 90 deg
    shift = np.array([5.0e5, 7.5e6, 800.0])
    order = np.random.default_rng(3).permutation(len(survey.image_points.point))
    for rotation in (np.eye(3), rotation_of_angles(0.4, -1.1, 2.0), along_x):
        found = adjust(moved(survey, rotation, shift, order))
        assert found.solution.iterations == adjusted.solution.iterations
        back = (found.xyz_m - shift) @ rotation
        worst = np.abs(back - adjusted.xyz_m).max()
        figure("largest change of a coordinate in a frame 7.5e6 m away", f"{worst:.1e} m")
        assert worst < 1e-8
        q = np.einsum("ij,njk,lk->nil", rotation.T, found.point_covariances_m2, rotation.T)
        assert q == pytest.approx(adjusted.point_covariances_m2, rel=1e-6, abs=1e-14)
    assert abs(found.photos[1][0, 1]) == pytest.approx(np.pi / 2, abs=0.02)


def circle(xyz):
    """Radius of the circle through points (n, 3) in their own plane, and its derivatives (3 n,)."""

    def radius(flat):
        away = flat.reshape(-1, 3) - flat.reshape(-1, 3).mean(axis=0)
        return np.sqrt(np.mean(np.sum(away**2, axis=1)))

    flat = xyz.ravel()
    step = 1e-4 * np.eye(len(flat))
    return radius(flat), np.array([(radius(flat + s) - radius(flat - s)) / 2e-4 for s in step])


@pytest.mark.slow
@pytest.mark.parametrize("tapes_used", [8, 1])
def test_the_shape_does_not_depend_on_the_fixed_photo(survey, tapes_used, figure):
    """Property: distances, radii and their sds are the same whichever photo is held; not places.

    Published: Silva's tests 13 and 18, one photo and one distance, gave sds of 1.37 m there.
    """
    tapes = replace(survey, observations=(survey.observations[1].taken(slice(0, tapes_used)),))
    pairs = np.array([[0, 17], [3, 40], [12, 45], [7, 30]])

    def shape(found):
        xyz = found.xyz_m
        line = xyz[pairs[:, 0]] - xyz[pairs[:, 1]]
        length = np.linalg.norm(line, axis=1)
        sds = []
        for (i, j), d in zip(pairs, line / length[:, None], strict=True):
            q = found.covariance_m2([i, j])
            a = np.concatenate([d, -d])
            sds.append(np.sqrt(a @ q @ a))
        radius, of_points = circle(xyz[:12])
        sds.append(np.sqrt(of_points @ found.covariance_m2(np.arange(12)) @ of_points))
        return np.append(length, radius), np.array(sds)

    free = adjust(tapes, datum="inner")
    length, sds = shape(free)
    worst = 0.0
    for held in range(len(survey.photos.names)):
        fixed = np.zeros((len(survey.photos.names), 4), dtype=bool)
        fixed[held] = True
        found = adjust(replace(tapes, photos=replace(survey.photos, fixed=fixed)))
        other, other_sds = shape(found)
        worst = max(worst, np.abs(other / length - 1).max(), np.abs(other_sds / sds - 1).max())
        assert np.trace(found.covariance_m2()) > np.trace(free.covariance_m2())
    figure(f"shape and its sds, any photo fixed, {tapes_used} tapes, differ by", f"{worst:.1e}")
    assert worst < 1e-8


def test_inner_constraints_give_the_smallest_trace(survey):
    """Second method: pseudo-inverse with the free directions' constraint on the points."""
    found = adjust(replace(survey, observations=survey.observations[1:]), datum="inner")
    assert found.solution.rank_defect == 6
    a = whole_matrix(found)
    free = directions(found.problem.layout, found.solution.unknowns)[:, :6]
    scale = np.linalg.norm(a, axis=0)
    assert np.abs((a / scale) @ (free * scale[:, None])).max() < 1e-3 * np.linalg.norm(a)
    ties = free * found.problem.model.inner[:, None]
    n = len(scale)
    border = np.zeros((n + 6, n + 6))
    border[:n, :n] = (a / scale).T @ (a / scale)
    border[:n, n:] = ties / scale[:, None]
    border[n:, :n] = border[:n, n:].T
    q = np.linalg.inv(border)[:n, :n] / np.outer(scale, scale)
    columns = found.problem.layout.points.ravel()
    expected = q[np.ix_(columns, columns)]
    size = np.sqrt(np.diag(expected))
    assert np.abs((found.covariance_m2() - expected) / np.outer(size, size)).max() < 1e-6


DEFECTS = {
    "photos only": (photographed, [], "datum defect 7: three translations, three rotations and"),
    "photos and tapes": (photographed, [1], "datum defect 6: three translations and three rotat"),
    "total station": (
        by_total_station,
        [0, 1, 2],
        "datum defect 4: three translations and the rotation about Z are not determined by any "
        "observation; add control or choose datum = inner",
    ),
    "angles only": (by_total_station, [0, 1], "datum defect 5: three translations, the rotation "),
}


@pytest.mark.parametrize("what", DEFECTS)
def test_a_missing_datum_is_reported_in_words(what):
    make, kept, message = DEFECTS[what]
    survey = make()[0]
    survey = replace(survey, observations=tuple(survey.observations[i] for i in kept))
    with pytest.raises(SolutionError, match=message):
        adjust(survey)
    assert adjust(survey, datum="inner").solution.rank_defect == int(message[13])


def test_one_point_holds_no_datum(survey):
    """A point keeps its place whichever way the rest turns: told, not a singular matrix."""
    bare = replace(survey, observations=survey.observations[1:])
    with pytest.raises(
        SolutionError, match="the coordinates chosen to hold the datum do not fix it"
    ):
        adjust(bare, datum="inner", over=np.array([0]))


def test_plumb_lines_and_levels_give_the_vertical(survey):
    """Two of the three rotations go when something knows where the vertical is."""
    start, end = np.arange(3), np.arange(3) + 24
    tapes = survey.observations[1]
    plumb = PlumbLines(np.zeros((3, 2)), np.full((3, 2), 0.5), start, end)
    level = HeightDifferences(
        np.zeros(3), np.full(3, 0.5), np.array([0, 1, 4]), np.array([4, 5, 9])
    )
    for one in (plumb, level):
        with pytest.raises(SolutionError, match="datum defect 4: three translations and the rotat"):
            adjust(replace(survey, observations=(tapes, one)))


def test_poor_points_and_photos_are_named(survey):
    images = survey.image_points
    first = np.flatnonzero(images.point == 20)
    keep = np.ones(len(images.point), dtype=bool)
    keep[first[1:]] = False
    poor = replace(survey, image_points=replace(images, use=keep.astype(float)))
    found = adjust(poor)
    assert found.problem.set_aside[20] == "point P20 has only one ray"
    assert np.isnan(found.xyz_m[20]).all()
    assert np.isfinite(np.delete(found.xyz_m, 20, axis=0)).all()
    lonely = (images.photo != 3) | (np.cumsum(images.photo == 3) < 3)
    with pytest.raises(SolutionError, match=r"at least 3 image points: S3 \(2\)"):
        adjust(replace(survey, image_points=replace(images, use=lonely.astype(float))))


def test_an_undetermined_parameter_is_named(survey):
    """P3 multiplies P1 and P2; and a tape of unknown scale without control leaves both open."""
    scope = tuple("off" if i in (7, 8) else "block" if i == 9 else s for i, s in enumerate(SCOPE))
    camera = replace(survey.cameras[0], scope=scope)
    with pytest.raises(SolutionError, match="not observed by anything: P3 of camera"):
        adjust(replace(survey, cameras=(camera,)))
    tapes = replace(survey.observations[1], instrument=np.zeros(8, dtype=int))
    tool = Instrument("tape 1", scale_sd=np.nan)
    loose = replace(survey, observations=(tapes,), instruments=(tool,))
    with pytest.raises(SolutionError, match=r"datum defect 7: .* and the scale are not determ"):
        adjust(loose)
    assert adjust(loose, datum="inner").solution.rank_defect == 7


def test_p3_and_p4_are_found_when_p1_and_p2_start_at_zero():
    """Property: without noise the truth comes back, though P3 is no unknown at the start."""
    scope = tuple("block" if i in (9, 10) else s for i, s in enumerate(SCOPE))
    interior = np.array([100, 0.1, 0.1, 0, 0, 0, 0, 3e-6, 2e-6, 2e-4, 1e-8, 0, 0])
    survey, _ = photographed(noise=0.0, interior=interior, scope=scope)
    values, _, covariance = adjust(survey).camera()
    off = (np.array(list(values.values())) - interior)[np.array(scope) != "off"]
    assert np.abs(off / np.sqrt(np.diag(covariance))).max() < 1e-3


def test_total_station_network_finds_the_truth():
    survey, truth = by_total_station(noise=0.0)
    control = ControlCoordinates(
        np.array([*truth.xyz_m[0], truth.xyz_m[3, 0]]),
        np.full(4, 1e-3),
        np.array([0, 0, 0, 3]),
        np.array([0, 1, 2, 0]),
    )
    found = adjust(replace(survey, observations=(*survey.observations, control)))
    assert found.xyz_m == pytest.approx(truth.xyz_m, abs=1e-8)
    assert found.problem.eliminated.sum() == 24  # the wall; the stations stay


def test_check_observations_are_compared_not_adjusted(survey, adjusted):
    """Second method: with the tape adjusted too, v = -(difference) sd2 / (sd2 + q), Kalman."""
    distance = Distances(
        np.array([5.0]), np.array([0.01]), np.array([3]), np.array([30]), instrument=np.array([-1])
    )
    truth = distance.computed(replace(adjusted.solution.unknowns), False)[0]
    distance = replace(distance, value=truth.ravel() + 0.004)
    found = compare_left_out(adjusted, distance)
    both = adjust(replace(survey, observations=(*survey.observations, distance)))
    table = next(t for t in both.residuals if t.source == 2)
    assert found.difference == pytest.approx(np.array([[-0.004]]), abs=1e-9)
    assert table.residual == pytest.approx(
        found.difference * 0.01**2 / found.sd**2, rel=1e-3, abs=1e-9
    )
    assert table.redundancy == pytest.approx(0.01**2 / found.sd**2, rel=1e-4)
    assert table.w == pytest.approx(found.w, rel=1e-3)


def test_published_constants():
    """Published: Baarda's 4.13 for 0.1 % and 80 %; ellipsoid factors of Silva 11-14; tau tables."""
    assert noncentrality() == pytest.approx(4.13, abs=0.005)
    factors = [ellipsoid_factor(p) ** 2 for p in (0.90, 0.95, 0.99)]
    assert factors == pytest.approx([6.25, 7.81, 11.34], abs=0.01)
    assert ellipsoid_factor(0.1987) == pytest.approx(1.0, abs=1e-3)
    assert tau_limit(0.001, 10**6) == pytest.approx(3.2905, abs=1e-3)


def test_a_blunder_is_found_and_a_false_alarm_comes_back(survey, adjusted):
    images = survey.image_points
    table = next(t for t in adjusted.residuals if t.source == "image points")
    i = int(np.argmax(table.redundancy.min(axis=1)))
    row = table.rows[i]
    xy = images.value.copy()
    xy[row] += [15 * images.sd[row, 0], 0]
    found = snoop(replace(survey, image_points=replace(images, value=xy)), robust=False)
    assert [(one.source, one.row) for one in found.removed] == [("image points", row)]
    out = np.zeros(len(images.point))
    out[:] = 1
    out[row] = 0
    again = snoop(replace(survey, image_points=replace(images, use=out)), robust=False)
    assert again.removed == ()
    assert again.adjusted.xyz_m == pytest.approx(adjusted.xyz_m, abs=1e-8)


@pytest.mark.slow
def test_ten_percent_of_blunders_are_survived(survey, adjusted, figure):
    """Property: with 10 % of 20-sigma blunders the points stay as good as their sds say."""
    images, rng = survey.image_points, np.random.default_rng(7)
    n = len(images.point)
    bad = rng.choice(n, n // 10, replace=False)
    angle = rng.uniform(0, 2 * np.pi, len(bad))
    xy = images.value.copy()
    xy[bad] += 20 * images.sd[bad] * np.column_stack([np.cos(angle), np.sin(angle)])
    found = snoop(replace(survey, image_points=replace(images, value=xy)))
    removed = {one.row for one in found.removed if one.source == "image points"}
    figure("blunders found of those made, and others", f"{len(removed & set(bad))} of {len(bad)}, "
           f"{len(removed - set(bad))}")  # fmt: skip
    assert found.adjusted.test().passed
    moved = (found.adjusted.xyz_m - adjusted.xyz_m) / found.adjusted.point_sd_m
    assert np.nanmedian(np.abs(moved)) < 1.0


def test_components_tell_which_group_is_worse_than_declared():
    survey, _ = photographed(seed=4)
    control, tapes = survey.observations
    hopeful = replace(survey, observations=(replace(control, sd=control.sd / 5), tapes))
    found = {c.source: c for c in components(adjust(hopeful).residuals)}
    assert found[0].factor > 2.5
    assert found["image points"].factor == pytest.approx(1, abs=0.2)


@pytest.mark.slow
def test_balanced_weights_find_the_true_sds(figure):
    """Property: the control was made with 2 mm; declared with 0.4 mm it comes out near 2 mm."""
    survey, _ = photographed(seed=4)
    control, tapes = survey.observations
    hopeful = replace(survey, observations=(replace(control, sd=control.sd / 5), tapes))
    found, factors = estimate_variance_components(hopeful, adjust)
    figure("control declared five times too good: factor found", f"{factors[0]:.2f}")
    assert factors[0] == pytest.approx(5, rel=0.35)
    assert found.sigma0 == pytest.approx(1, abs=0.03)


def test_quality_of_points(adjusted):
    """Closed form: a known covariance; and check points at the adjusted places have no error."""
    blocks = np.array([np.diag([4.0, 1.0, 9.0]), np.eye(3)])
    axes, directions_ = ellipsoids(blocks, 0.95)
    assert axes[0] == pytest.approx(np.array([3, 2, 1]) * np.sqrt(7.8147), rel=1e-4)
    assert np.abs(directions_[0][:, 0]) == pytest.approx([0, 0, 1])
    found = precision(np.array([[0.0, 0, 0], [3, 4, 0]]), blocks)
    assert found.mean_sd_m == pytest.approx(np.sqrt(17 / 6))
    assert found.spherical_sd_m == pytest.approx([2, 1])
    assert found.quadratic_sd_m == pytest.approx([14**0.5, 3**0.5])
    assert found.range_m == pytest.approx([1, 0, 2])
    assert found.proportional == pytest.approx(5 / np.sqrt(17 / 6))
    away = np.array([[0.003, 0.004, 0], [0, 0, 0.001]])
    check = accuracy(adjusted, [3, 9], adjusted.xyz_m[[3, 9]] - away, np.zeros((2, 3)))
    assert check.r_xyz_m == pytest.approx(np.sqrt((25e-6 + 1e-6) / 2))
    assert (check.largest_m, check.mean_m) == (pytest.approx(0.005), pytest.approx(0.003))
