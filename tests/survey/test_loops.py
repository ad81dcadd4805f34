"""The loops that are compiled, run as they are written, against whole arrays: a second method."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from tankcal.camera import imaging
from tankcal.camera.model import Form
from tankcal.geometry.rotations import rotation_of_view
from tankcal.solver import Group, elimination, loops, model, propagate, series
from tankcal.solver.model import Normals

PHOTOS, POINTS, RAYS = 3, 40, 210  # more of a photo than are computed side by side


@pytest.mark.slow(after=2)
@pytest.mark.parametrize("in_ideal", [False, True])
@pytest.mark.parametrize(
    "form",
    [
        Form(),
        Form("distortion_of_ideal", radial_balance_mm=12.0),
        Form("correction_added", "before_distortion"),
        Form("correction_subtracted"),
    ],
)
def test_image_points_side_by_side_are_those_of_arrays(form, in_ideal):
    rng = np.random.default_rng(5)
    xyz_m = rng.uniform(-2, 2, (POINTS, 3))
    centres_m = np.array([[9.0, 1, 0], [0, -8, 1], [-7, 3, -1]])
    towards = -centres_m
    azimuth = np.arctan2(towards[:, 0], towards[:, 1])
    rotation = rotation_of_view(azimuth, np.zeros(3), np.array([0.0, 0.3, -0.2]))
    interior = np.tile(
        [50.0, 0.1, -0.2, 1e-5, 2e-9, 1e-12, 0, 1e-6, 2e-6, 0, 0, 1e-4, 2e-4], (3, 1)
    )
    active = np.array([0, 1, 2, 3, 4, 7, 11, 12])
    photo = np.sort(rng.integers(0, PHOTOS, RAYS))
    photo[-20:] = rng.integers(0, PHOTOS, 20)  # some in no order
    point, xy_mm = rng.integers(0, POINTS, RAYS), rng.uniform(-15, 15, (RAYS, 2))
    given = (
        xyz_m, centres_m, rotation, interior, form.numbers,
        form.convention == "distortion_of_ideal", point, photo, xy_mm,
        rng.uniform(100, 300, (RAYS, 2)), active,
    )  # fmt: skip
    found = []
    for run in (imaging._compute_rows_in_loops, imaging._compute_rows_in_arrays):
        w, jac = np.zeros((RAYS, 2)), np.zeros((RAYS, 2, 9 + len(active)))
        run(*given, w, jac, in_ideal)
        alone = np.zeros_like(w)
        run(*given, alone, jac[:0], in_ideal)
        assert (alone == w).all()
        found.append((w, jac))
    (w, jac), (of_arrays, jac_of_arrays) = found
    assert w == pytest.approx(of_arrays, rel=1e-12)
    size = np.abs(jac_of_arrays).max(axis=(0, 1))
    assert jac / size == pytest.approx(jac_of_arrays / size, abs=1e-12)


def groups_of(rng, reduced, blocks):
    """Rows of blocks with runs of columns, some of them fixed, and rows without a block."""
    first = rng.choice([0, 4, 9], 60)
    own = np.repeat(np.sort(rng.integers(0, blocks, 60)), 3).reshape(-1, 3)
    rays = np.hstack([reduced + 3 * own + np.arange(3), first[:, None] + np.arange(4)])
    rays = np.hstack([rays, np.where(rng.random((60, 1)) < 0.5, -1, reduced - 1)])
    among = np.stack([np.arange(5), np.arange(5) + 6], axis=1)
    turned = np.hstack(
        [rng.integers(0, 3, (8, 1)), reduced + 3 * np.arange(8)[:, None] + [0, 1, 2]]
    )
    every = reduced + np.arange(3 * blocks).reshape(-1, 3)
    return tuple(
        Group(columns.astype(np.int32), 1, None) for columns in (rays, among, turned, every)
    )


def test_plans_by_loops_are_those_of_arrays(monkeypatch):
    reduced, blocks = 15, 12
    groups = groups_of(np.random.default_rng(3), reduced, blocks)
    of_arrays = model.plan(reduced, blocks, groups)
    monkeypatch.setattr(model, "is_worth_compiling", lambda rows=0: True)
    plain = SimpleNamespace(**{name: vars(series)[name] for name in series.COMPILED})
    monkeypatch.setattr(model, "compile_functions", lambda module, names: plain)
    found = model.plan(reduced, blocks, groups)
    assert len(found.columns) > 3 * blocks
    for name in ("starts", "columns", "ends", "runs", "alike"):
        assert (getattr(found, name) == getattr(of_arrays, name)).all(), name
    for one, other in zip(found.batches, of_arrays.batches, strict=True):
        assert (one.first == other.first).all()
        assert (one.cuts == other.cuts).all()
        assert (one.place is None) == (other.place is None)
        assert one.place is None or (one.place == other.place).all()


def test_blocks_eliminated_together_give_what_they_give_one_by_one(monkeypatch):
    """Second method: each block with its own columns only."""
    rng, reduced, blocks = np.random.default_rng(11), 15, 12
    groups = groups_of(rng, reduced, blocks)
    rows = [rng.normal(size=(len(group.columns), 1, group.columns.shape[1])) for group in groups]
    found = []
    for join in (series._join_series, lambda together, alike, widths: alike):
        monkeypatch.setattr(series, "_join_series", join)
        plan = model.plan(reduced, blocks, groups)
        normals = zero_normals(plan)
        normals.v[:, [0, 2, 5]] = 1.0
        for batch in plan.batches:
            jac = batch.of(rows[batch.group])
            elimination.add_rows(plan, batch, jac[:, :, 0] + 0.5, jac, normals)
        assert elimination.eliminate(plan, normals, 1e-3, 1e-12) == -1
        back = elimination.back_substitute(plan, normals, np.arange(15.0))
        found.append((len(plan.alike), normals.t[:-1, :-1], normals.g[:-1], back))
    (joined, *of_joined), (alone, *of_single) = found
    assert joined < alone
    for one, other in zip(of_joined, of_single, strict=True):
        assert one == pytest.approx(other, abs=1e-11)


@pytest.mark.slow(after=4)
@pytest.mark.parametrize(
    ("panel", "wide", "side"),
    [(2, 3, 1), (2, 3, 3), (loops.PANEL, loops.WIDE, loops.SIDE)],
)
@pytest.mark.parametrize("m", [1, 2, 3, 7])
def test_rows_added_by_loops_are_those_of_arrays(m, panel, wide, side, monkeypatch):
    """Neighbours with the same columns, in series of one row and of many; runs in any order."""
    rng, reduced, blocks = np.random.default_rng(23), 15, 12
    groups = groups_of(rng, reduced, blocks)
    alike = np.repeat([[0, 1, 2, 3, 9], [4, 5, 6, 7, -1], [9, 10, 11, 2, 0]], 5, axis=0)
    groups = [replace(one, rows=m) for one in (*groups, Group(alike.astype(np.int32), m, None))]
    plan = model.plan(reduced, blocks, groups)
    rows = [rng.normal(size=(len(one.columns), m, one.columns.shape[1] + 1)) for one in groups]

    def added():
        normals = zero_normals(plan)
        for batch in plan.batches:
            both = rows[batch.group]
            w, jac = np.array(both[:, :, -1]), np.array(both[:, :, :-1])
            elimination.add_rows(plan, batch, batch.of(w), batch.of(jac), normals)
        normals.t[:-1, :-1] += np.tril(normals.t[:-1, :-1], -1).T  # arrays do so when eliminating
        upper = np.triu(normals.t[:-1, :-1])
        return upper, normals.g[:-1], normals.v, normals.b, normals.wide[:-1]

    of_arrays = added()
    monkeypatch.setattr(loops, "PANEL", panel)
    monkeypatch.setattr(loops, "WIDE", wide)
    monkeypatch.setattr(loops, "SIDE", side)
    monkeypatch.setattr(elimination, "is_worth_compiling", lambda rows=0: True)
    plain = SimpleNamespace(**{name: vars(loops)[name] for name in loops.COMPILED})
    monkeypatch.setattr(elimination, "compile_functions", lambda module, names: plain)
    of_loops = added()
    for one, other in zip(of_loops, of_arrays, strict=True):
        assert one == pytest.approx(other, abs=1e-12)


def zero_normals(plan):
    """Normals to which nothing was added yet."""
    normals = Normals.empty(plan)
    for array in vars(normals).values():
        array.fill(0.0)
    return normals


def among(plan, normals, unknowns):
    """How unknowns follow the reduced ones, and what their blocks add to their cofactors."""
    own = np.zeros((len(unknowns), len(unknowns)))
    elimination.add_own_cofactors(plan, normals, unknowns, own)
    return elimination.through_reduced(plan, normals, unknowns), own


@pytest.mark.parametrize(
    ("panel", "wide", "side"),
    [(4, 5, 1), (4, 5, 5), (loops.PANEL, loops.WIDE, loops.SIDE)],
)
def test_elimination_by_loops_is_that_of_arrays(panel, wide, side, monkeypatch):
    rng, reduced, blocks = np.random.default_rng(7), 15, 12
    plan = model.plan(reduced, blocks, groups_of(rng, reduced, blocks))
    first, second = zero_normals(plan), zero_normals(plan)
    root = np.tril(rng.uniform(1, 2, (blocks, 3, 3)))
    first.v[:] = (root @ root.transpose(0, 2, 1))[:, *np.tril_indices(3)]
    for part in (first.wide[:-1], first.b, first.t[:-1, :-1], first.g[:-1]):
        part[:] = rng.normal(size=part.shape)
    first.t[:] = np.triu(first.t)
    for name in vars(first):
        getattr(second, name)[:] = getattr(first, name)
    assert elimination.eliminate(plan, first, 1e-3, 1e-12) == -1
    step = rng.normal(size=reduced)
    blocks_of_arrays = elimination.back_substitute(plan, first, step)
    inverse = np.cov(rng.normal(size=(reduced, 2 * reduced)))
    of_arrays = elimination.block_cofactors(plan, first, inverse)
    some = rng.permutation(reduced + 3 * blocks)[:-5]
    among_of_arrays = among(plan, first, some)
    monkeypatch.setattr(loops, "PANEL", panel)
    monkeypatch.setattr(loops, "WIDE", wide)
    monkeypatch.setattr(loops, "SIDE", side)
    monkeypatch.setattr(elimination, "is_worth_compiling", lambda rows=0: True)
    plain = SimpleNamespace(**{name: vars(loops)[name] for name in loops.COMPILED})
    monkeypatch.setattr(elimination, "compile_functions", lambda module, names: plain)
    assert elimination.eliminate(plan, second, 1e-3, 1e-12) == -1
    for name in vars(first):
        assert getattr(second, name) == pytest.approx(getattr(first, name), abs=1e-12), name
    for one, other in zip(among(plan, second, some), among_of_arrays, strict=True):
        assert one == pytest.approx(other, abs=1e-11)
    found = elimination.back_substitute(plan, second, step)
    assert found == pytest.approx(blocks_of_arrays, abs=1e-12)
    for one, other in zip(
        elimination.block_cofactors(plan, second, inverse), of_arrays, strict=True
    ):
        assert one == pytest.approx(other, abs=1e-11)


@pytest.mark.parametrize("tile", [8, propagate.TILE])
@pytest.mark.parametrize(("k", "n"), [(1, 1), (2, 5), (3, 4), (19, 11), (40, 9)])
def test_a_product_with_few_numbers_is_that_of_whole_matrices(k, n, tile, monkeypatch):
    """Second method; rows in threes and numbers in fours, and what is left of them."""
    rng = np.random.default_rng(29)
    a = np.where(rng.random((k, n)) < 0.3, rng.normal(size=(k, n)), 0.0)
    root = rng.normal(size=(n, n))
    monkeypatch.setattr(propagate, "TILE", tile)
    plain = SimpleNamespace(**{name: vars(propagate)[name] for name in propagate.COMPILED})
    monkeypatch.setattr(propagate, "compile_functions", lambda module, names: plain)
    found = propagate.propagate_cofactors(a, root @ root.T)
    assert found == pytest.approx(a @ root @ root.T @ a.T, abs=1e-12)
    assert (found == found.T).all()


def test_the_wide_part_has_three_rows_a_block():
    """Closed form: number 10 c + i at column c and unknown i of a block."""
    reduced, blocks = 15, 12
    plan = model.plan(reduced, blocks, groups_of(np.random.default_rng(3), reduced, blocks))
    normals = zero_normals(plan)
    normals.wide[plan.entries[:-1]] = 10 * plan.columns[:, None] + np.arange(3)
    dense = elimination.block_rows(plan, normals.wide).toarray().reshape(blocks, 3, reduced)
    for o in range(blocks):
        columns = plan.columns[plan.starts[o] : plan.starts[o + 1]]
        expected = np.zeros((3, reduced))
        expected[:, columns] = 10 * columns + np.arange(3)[:, None]
        assert (dense[o] == expected).all()
