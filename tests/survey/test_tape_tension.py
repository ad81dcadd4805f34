"""A tape that hangs free: worked numbers, the catenary, derivatives by differences."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.optimize import brentq

from tankcal.survey.strapping import (
    RECTANGULAR,
    WEIGHT_SHARE,
    Obstruction,
    Strap,
    Strapping,
    Tape,
    mean_tension_n,
    reduce_strap,
    sag_excess_m,
    sag_of,
)

ROUND = Strapping((), ())
TAPE = Tape("T", tension_n=50.0, stiffness_n=5e5, weight_n_per_m=0.2)
RUBBING = replace(TAPE, friction=0.2)
STRAP = Strap("1a", "1", 0.4, 41.0, 0.0005, "T")
SPANS = (Obstruction("sag", 2, span_m=10.0), Obstruction("sag", span_m=5.0))


def reduced(tape=TAPE, obstructions=SPANS, strap=STRAP):
    return reduce_strap(strap, tape, obstructions, None, ROUND, 13.0)


def catenary_m(span_m, weight_n_per_m, horizontal_n):
    """Second method: the exact length between ends that are level."""
    depth = horizontal_n / weight_n_per_m
    return 2 * depth * np.sinh(span_m / (2 * depth))


@pytest.mark.parametrize(("span_m", "sag_mm"), [(5, 0.083), (10, 0.667), (20, 5.33)])
def test_worked_numbers(span_m, sag_mm):
    one = reduced(obstructions=[Obstruction("sag", span_m=span_m)])
    assert -1000 * one.steps_m["sag"] == pytest.approx(sag_mm, abs=0.5 * (1e-3, 1e-2)[span_m > 10])
    assert one.circumference_m == pytest.approx(41.0 + one.steps_m["sag"], abs=1e-12)
    assert one.steps_m["rise"] == 0


@pytest.mark.parametrize("span_m", [20.0, 60.0, 125.0])
def test_the_catenary_is_longer_by_the_next_order_alone(span_m, figure):
    """Exact form: L (sinh x / x - 1), x = w L / (2 F); what is left out is x^2 / 20 of it."""
    x = 0.2 * span_m / (2 * 50)
    exact = catenary_m(span_m, 0.2, 50.0) - span_m
    left_out = exact / sag_excess_m(span_m, 0.2, 50.0) - 1
    figure(f"sag of a span of {span_m:g} m: catenary over formula, less 1", f"{left_out:.2e}")
    assert left_out == pytest.approx(x**2 / 20, rel=0.03)
    assert left_out < 0.0032  # the longest that a job may have: w L = F / 2


def test_the_tension_at_the_ends_is_that_along_the_span():
    """Exact form: ends pulled with F, whose horizontal part is less; 1.2e-3 of the sag at 20 m."""
    horizontal = brentq(lambda h: h * np.cosh(0.2 * 20 / (2 * h)) - 50, 10, 50)
    exact = catenary_m(20.0, 0.2, horizontal) - 20
    assert exact == pytest.approx(sag_excess_m(20.0, 0.2, 50.0), rel=2e-3)


@pytest.mark.parametrize("pulls", [1, 4])
def test_friction_leaves_a_span_the_tension_of_its_place(pulls):
    """Second method: quadrature of the formula over all places of a span in its pull."""
    strap = replace(STRAP, pulls=pulls)

    def moment(order):
        def sag_m(place):
            return sag_excess_m(10.0, 0.2, 50 * np.exp(-0.2 * np.pi / pulls * place)) ** order

        return quad(sag_m, 0, 1)[0]

    found = sag_of(strap, RUBBING, [Obstruction("sag", span_m=10.0)])
    assert found.excess_m == pytest.approx(moment(1), rel=1e-9)
    assert found.place_share == pytest.approx(np.sqrt(moment(2) / moment(1) ** 2 - 1), rel=1e-6)
    at_mean = sag_excess_m(10.0, 0.2, mean_tension_n(50.0, 0.2, pulls))
    assert found.excess_m > at_mean


@pytest.mark.parametrize("tape", [TAPE, RUBBING, replace(TAPE, stiffness_n=np.inf)])
def test_effects_are_what_another_input_does(tape):
    """Second method: differences of the reduction itself."""
    base = reduced(tape)
    effects = {one.kind: one.by_m for one in base.effects}
    step = 1e-4

    def by(key, value):
        up, down = (reduced(replace(tape, **{key: value * (1 + sign * step)})) for sign in (1, -1))
        return (up.circumference_m - down.circumference_m) / (2 * step)

    def pulled(sign):
        strap = replace(STRAP, tension_n=50 * (1 + sign * step))
        return reduced(tape, strap=strap).circumference_m

    by_pull = (pulled(1) - pulled(-1)) / (2 * step)
    assert effects["tape_tension"] == pytest.approx(by_pull * 0.1 / RECTANGULAR, rel=1e-5)
    by_weight = by("weight_n_per_m", 0.2)
    assert by_weight < 0
    assert effects["tape_weight"] == pytest.approx(by_weight * WEIGHT_SHARE / RECTANGULAR, rel=1e-5)
    if tape.friction:
        by_friction = by("friction", 0.2)
        assert effects["tape_friction"] == pytest.approx(by_friction * 0.5 / RECTANGULAR, rel=1e-5)
        share = sag_of(STRAP, tape, SPANS).place_share
        assert effects["tape_sag"] == pytest.approx(base.steps_m["sag"] * share)
    else:
        assert not effects.keys() & {"tape_friction", "tape_sag"}


def test_little_friction_is_none_in_the_limit():
    """Closed form against its series: no jump where one takes the other's place."""
    small, none = (sag_of(STRAP, replace(TAPE, friction=mu), SPANS) for mu in (1e-9, 0.0))
    assert small.excess_m == pytest.approx(none.excess_m, rel=1e-8)
    below, above = (sag_of(STRAP, replace(TAPE, friction=mu / 2 / np.pi), SPANS).by_friction_m / mu
                    for mu in (0.999e-3, 1.001e-3))  # fmt: skip
    assert below == pytest.approx(above, rel=1e-4)


def test_a_span_needs_a_pull():
    with pytest.raises(ValueError, match="pull"):
        reduced(replace(TAPE, tension_n=None))
    assert reduced(replace(TAPE, tension_n=None), ()).steps_m["sag"] == 0
