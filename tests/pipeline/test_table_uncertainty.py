"""Volume and u of a whole table from 130 correlated inputs: second method, and another program."""

import sys
from pathlib import Path

import numpy as np
import pytest

sys.path.append(str(Path(__file__).resolve().parents[2] / "benchmarks"))

from uncertainty import (
    SHARED,
    Peer,
    body_of,
    case_of,
    dense,
    table_of,
    with_gtc,
    with_uncertainties,
)


@pytest.fixture(scope="module")
def case():
    return case_of(475)


def test_every_row_is_j_c_j_of_the_plain_tank(case, figure):
    """The tank in plain arithmetic, its whole Jacobian by imaginary steps."""
    volume, u, dof, k, expanded = table_of(body_of(case), case.heights_m)
    plain, of_plain = dense(case)
    figure("u of a table by its few columns and by J C J', ppt", f"{1e12 * worst(u, of_plain):.4f}")
    assert volume == pytest.approx(plain, rel=1e-12)
    assert u == pytest.approx(of_plain, rel=1e-12)
    least = min(dof for *_, dof in SHARED.values())
    assert np.all((dof >= least) & (k > 1.96))
    assert np.array_equal(expanded, k * u)


@pytest.mark.parametrize(
    ("name", "make"), [("GTC", with_gtc), ("uncertainties", with_uncertainties)]
)
def test_another_program_finds_the_same(case, name, make):
    peer = Peer(make, pytest.importorskip(name), case)
    peer.table_s(0.5)
    rows = list(peer.found)
    volume, u, *_ = table_of(body_of(case), case.heights_m)
    assert len(rows) > 10
    assert np.transpose(list(peer.found.values())) == pytest.approx(
        np.array([volume[rows], u[rows]]), rel=1e-12
    )


def worst(values, truth):
    return np.max(np.abs(values / truth - 1))
