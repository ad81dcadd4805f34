"""The factor of a table's covariance in blocks of rows: what was put in comes out again."""

import gzip
import json
import lzma

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from kept_records import kept_files
from kept_releases import kept_records

from tankcal.record import load, migrated
from tankcal.record.covariance_factor import LARGEST_ERROR, ROWS, blocks_of, factor_of
from tankcal.record.schema import to_plain


def capacity_of(factor):
    """The part `capacity` of a record that has been written and read."""
    return {
        "height_m": list(range(len(factor))),
        "inputs": list(range(factor.shape[1])),
        "factor": json.loads(json.dumps(to_plain(blocks_of(factor)))),
    }


def assert_given_back(factor):
    found = factor_of(capacity_of(factor))
    u = np.linalg.norm(factor, axis=1, keepdims=True)
    assert found.shape == factor.shape
    assert np.all(np.abs(found - factor) <= LARGEST_ERROR * u)
    return found


def smooth(rows, inputs, joints, rng):
    """A factor that is a parabola in height between joints, from nothing at the bottom."""
    height = np.linspace(0.0, 1.0, rows)
    edges = np.linspace(0.0, 1.0, joints + 2)[:-1]
    above = np.maximum(height[:, None] - edges, 0.0)
    return np.hstack([above, above**2]) @ rng.normal(size=(2 * len(edges), inputs))


@pytest.mark.slow
@settings(deadline=None, max_examples=40)
@given(
    st.integers(1, 3 * ROWS),
    st.integers(0, 60),
    st.integers(0, 4),
    st.floats(-9, 9),
    st.integers(0, 2**32 - 1),
)
def test_a_smooth_factor_is_given_back(rows, inputs, joints, digits, seed):
    """Property: to 1e-14 of each row's own u, however unlike the sizes of inputs are."""
    rng = np.random.default_rng(seed)
    sizes = 10.0 ** (digits + rng.uniform(-12, 0, inputs))
    assert_given_back(smooth(rows, inputs, joints, rng) * sizes)


@settings(deadline=None, max_examples=20)
@given(st.integers(1, ROWS + 20), st.integers(1, 30), st.integers(0, 2**32 - 1))
def test_rows_that_have_nothing_in_common_are_kept_bit_for_bit(rows, inputs, seed):
    factor = np.random.default_rng(seed).normal(size=(rows, inputs))
    factor[rows // 2] = 0.0
    found = assert_given_back(factor)
    if min(rows, ROWS) <= inputs:
        assert np.array_equal(found, factor)
        assert [one.weights for one in blocks_of(factor)[:1]] == [None]


def test_few_rows_of_a_smooth_factor_are_kept():
    factor = smooth(5 * ROWS, 100, 4, np.random.default_rng(5))
    empty, *others = blocks_of(factor)
    assert (empty.rows, empty.weights) == (1, None)  # nothing is below the first row
    held = sum(one.weights.size + one.factor_m3.size for one in others)
    assert held < 0.2 * factor.size


def test_an_input_without_effect_has_none():
    """What only a course further up has is exactly nothing below it, in blocks of any size."""
    factor = smooth(3 * ROWS, 30, 2, np.random.default_rng(3))
    begins = (1, ROWS // 2, ROWS, 2 * ROWS + 7)
    for number, row in enumerate(begins):
        factor[:row, number::7] = 0.0
    found = assert_given_back(factor)
    assert np.array_equal(found == 0.0, factor == 0.0)
    assert {0, *begins} <= {0, *np.cumsum([one.rows for one in blocks_of(factor)])}


@pytest.mark.slow
def test_the_record_of_the_example_holds_the_factor_of_its_table(example_result, example_record):
    """Second way: the factor of the table itself; what a delivery takes of it, too."""
    table, record = example_result.table, load(example_record)
    found = factor_of(record["capacity"])
    u = table.u_m3[:, None]
    assert np.all(np.abs(found - table.factor_m3) <= LARGEST_ERROR * u)
    delivered, expected = (np.linalg.norm(np.diff(one, axis=0), axis=1)
                           for one in (found, table.factor_m3))  # fmt: skip
    assert delivered == pytest.approx(expected, rel=1e-11)
    assert len(json.dumps(record["capacity"]["factor"])) < 0.3 * len(
        json.dumps(table.factor_m3.tolist())
    )


@pytest.mark.slow(after=7)
@pytest.mark.parametrize("path", [*kept_files(1), *kept_records()], ids=lambda path: path.name)
def test_kept_records_have_their_whole_factor_bit_for_bit(path):
    """Of version 1 and of drafts of version 2."""
    unpacked = {".gz": gzip, ".xz": lzma}[path.suffix].decompress(path.read_bytes())
    kept = json.loads(unpacked)
    before = json.dumps(kept)
    capacity = migrated(kept, "record.json")["capacity"]
    assert json.dumps(kept) == before
    assert (capacity is None) == (kept["capacity"] is None)
    if capacity is None or "factor" in kept["capacity"]:  # of the present form: as it was saved
        return
    found = factor_of(capacity)
    assert found.tolist() == [[*map(float, row)] for row in kept["capacity"]["factor_m3"]]


@pytest.mark.parametrize(
    "spoil",
    [
        lambda capacity: capacity["factor"].pop(),
        lambda capacity: capacity["height_m"].pop(),
        lambda capacity: capacity["inputs"].pop(),
        lambda capacity: capacity["factor"][1]["factor_m3"].pop(),
        lambda capacity: capacity["factor"][1]["factor_m3"][0].pop(),
        lambda capacity: capacity["factor"][1]["weights"].pop(),
        lambda capacity: capacity["factor"][1].update(weights=None),
    ],
)
def test_blocks_of_another_shape_are_no_factor(spoil):
    capacity = capacity_of(smooth(ROWS + 5, 20, 1, np.random.default_rng(1)))
    spoil(capacity)
    with pytest.raises(ValueError, match=r"rows|shape|inhomogeneous"):
        factor_of(capacity)
