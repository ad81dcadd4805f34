"""Benefit of further everyday data: predicted, and by the estimation with these data.

Kind of truth: covariance with the data; published simulation of a station with another program.
"""

import json
from dataclasses import replace

import numpy as np
import pytest
from example_logs import Station, TrueTank, write_station
from test_upkeep_start import SIZES, make_stock

from tankcal import cli
from tankcal.products.upkeep.causes import PRIORS, Meter, Operation
from tankcal.products.upkeep.estimation import estimate
from tankcal.products.upkeep.planning import _run_down, predict_gains
from tankcal.products.upkeep.start import LyingStock
from tankcal.products.upkeep.steps import Marks, Steps

LEVELS_M = 0.5, 2.0
GASOLINE = 0.00095


def make_known_form(**u):
    """`LyingStock` of the station, of a known form, with the gauge 1.25 m below mid-length."""
    stock = make_stock(tilt_mm_per_m=10.0, dip_from_a_m=1.6, **u)
    stock = LyingStock(stock.drawing, GASOLINE, 15.0)
    # The published covariances are those of a known form.
    known = np.array([name not in ("section", "end_form") for name in stock.names])
    stock.linear = replace(stock.linear, factor_m3=np.where(known, stock.linear.factor_m3, 1e-12))
    return stock


def make_steps(days, order_m3=(1.9, 10.8), seed=1):
    """(stock, steps): 5 m3 a day by four nozzles, a delivery of 13.3 m3 at a random low stock."""
    rng, stock = np.random.default_rng(seed), make_known_form()
    hours = np.append(np.linspace(0.5, 5.5, 2), np.linspace(8, 22, 4))
    time = np.append(0.0, (np.arange(days)[:, None] * 24 + hours).ravel() + 1) * 3600
    seconds = np.diff(time)
    share = np.where(seconds > 4 * 3600, 0.0, seconds * (((time[1:] / 3600) % 24) > 6.6))
    share = share * rng.gamma(8, 1 / 8, size=len(share))
    split = rng.dirichlet(np.full(4, 6.0), size=len(share)) * share[:, None]
    split *= 5.0 * days / share.sum()
    content, contents, order = 14.0, [14.0], rng.uniform(*order_m3)
    delivered = np.zeros(len(share))
    for k, sold in enumerate(split.sum(axis=1)):
        content -= sold
        if content < order and seconds[k] < 4 * 3600:
            delivered[k], order = 13.3, rng.uniform(*order_m3)
            content += delivered[k]
        contents.append(content)
    grid = np.linspace(0.0, 2.5, 5001)
    count, tickets = len(share), (delivered > 0).astype(int)
    marks = Marks((1e9 * time).astype(np.int64),
                  np.interp(contents, stock.volume_m3(grid, stock.at), grid),
                  np.full(count + 1, 1e-5), np.full(count + 1, 12.0))  # fmt: skip
    return stock, Steps(marks, tuple("1234"), split, np.full((count, 4), np.nan), delivered,
                        np.where(tickets > 0, 12.0, np.nan), tickets,
                        np.zeros(count, dtype=int))  # fmt: skip


def run(stock, steps, u_meter=None, **priors):
    """(operation, estimation) without tickets, as in the published simulation."""
    priors = PRIORS["station"] | {"ticket_own_percent": 100.0, "hose_l": 0.0,
                                  "u_hose_l": 0.0} | priors  # fmt: skip
    meters = {name: Meter(name, u_factor=u_meter) for name in "1234"}
    operation = Operation(stock, meters, priors, start_ns=0)
    return operation, estimate(operation, steps, is_robust=False)


def relative_u(stock, gain):
    """u of a delivery in ppm."""
    return 1e6 * gain.u_delivery_m3 / np.diff(stock.volume_m3(np.array(LEVELS_M), stock.at))[0]


@pytest.fixture(scope="module")
def years():
    """Stock, steps, operation and estimation of two years."""
    stock, steps = make_steps(730)
    return stock, steps, *run(stock, steps)


@pytest.mark.slow
def test_published_uncertainties(years):
    """u of a delivery: two years 1374 ppm, meters proved 1146 ppm, 60 days 1807 ppm; content 42 L.

    The part of the meters is the difference of squares, which other causes do not change.
    """
    stock, _, operation, estimation = years
    now, _, prover, _ = predict_gains(operation, estimation, LEVELS_M)
    before, after = relative_u(stock, now), relative_u(stock, prover)
    few = make_steps(60)
    months = relative_u(few[0], predict_gains(*run(*few), LEVELS_M)[0])
    print("two years, proved, 60 days in ppm; content in L:", before, after, months,
          1000 * now.u_content_m3)  # fmt: skip
    assert before == pytest.approx(1374, rel=0.06)
    assert np.sqrt(before**2 - after**2) == pytest.approx(np.sqrt(1374**2 - 1146**2), rel=0.05)
    assert months == pytest.approx(1807, rel=0.06)
    assert 1000 * now.u_content_m3 == pytest.approx(42, rel=0.1)


@pytest.mark.slow
def test_a_low_stock_is_predicted(years):
    """Run down to 0.2 m: u of the content as by the estimation of steps that contain it."""
    stock, steps, operation, estimation = years
    now, *_, low = predict_gains(operation, estimation, LEVELS_M, low_m=0.2)
    run_down = _run_down(steps, stock.table, LEVELS_M[0], 0.2)
    both = {name: np.concatenate([getattr(steps, name), getattr(run_down, name)[:0],
                                  getattr(run_down, name)])
            for name in ("sold_m3", "meter_c", "delivered_m3", "delivered_c", "tickets",
                         "reason")}  # fmt: skip
    # The step from the last mark to the first mark of the run is not used.
    both = {name: np.insert(values, len(steps), np.zeros_like(values[0]), axis=0)
            for name, values in both.items()}  # fmt: skip
    both["reason"][len(steps)] = 1
    marks = Marks(*(np.concatenate([getattr(steps.marks, name), getattr(run_down.marks, name)])
                    for name in vars(steps.marks)))  # fmt: skip
    measured = predict_gains(*run(stock, Steps(marks, steps.meters, **both)), LEVELS_M)[0]
    assert low.u_content_m3 == pytest.approx(measured.u_content_m3, rel=0.03)
    assert low.u_content_m3 < 0.8 * now.u_content_m3


@pytest.mark.slow
def test_published_low_stock(years):
    """Run down to 0.2 m: 22 L as published if the dips have a single zero; else the gauge's zero.

    A table for other instruments has the zero of the gauge, 2 mm, as a further cause.
    """
    stock, steps, operation, estimation = years
    *_, low = predict_gains(*run(stock, steps, gauge_zero_mm=0.0), LEVELS_M, low_m=0.2)
    *_, with_zero = predict_gains(operation, estimation, LEVELS_M, low_m=0.2)
    print("low stock in L, a zero and two:", 1000 * low.u_content_m3, 1000 * with_zero.u_content_m3)
    assert 1000 * low.u_content_m3 == pytest.approx(22, rel=0.05)
    area = np.diff(stock.volume_m3(np.array([0.499, 0.501]), stock.at))[0] / 0.002
    of_gauge = np.sqrt(with_zero.u_content_m3**2 - low.u_content_m3**2)
    assert 0.9 * 0.002 * area < of_gauge < 0.002 * area  # the steps determine a tenth of it
    assert 1000 * with_zero.u_content_m3 == pytest.approx(32, rel=0.01)


@pytest.mark.slow
def test_a_prover_is_a_prior(years):
    """Meters proved to 0.03 %: u is that of the estimation with 1/u^2 of prior and prover."""
    stock, steps, operation, estimation = years
    gain = predict_gains(operation, estimation, LEVELS_M)[2]
    u = (PRIORS["station"]["meter_percent"] / 100, 3e-4)
    both = predict_gains(*run(stock, steps, 1 / np.hypot(1 / u[0], 1 / u[1])), LEVELS_M)[0]
    assert relative_u(stock, gain) == pytest.approx(relative_u(stock, both), rel=2e-3)


@pytest.mark.slow
@pytest.mark.parametrize("seed", [1, 3, 4])
def test_a_further_month_is_predicted(seed):
    """180 days, and 30 more: as by the estimation of 210 days, or less where levels are new."""
    stock, steps = make_steps(210, seed=seed)
    now, month, *_ = predict_gains(*run(stock, steps.part(0, len(steps) * 180 // 210)), LEVELS_M)
    later = predict_gains(*run(stock, steps), LEVELS_M)[0]
    assert month.u_delivery_m3 == pytest.approx(later.u_delivery_m3, rel=0.02)
    assert month.u_content_m3 > 0.95 * later.u_content_m3
    assert month.u_content_m3 < now.u_content_m3


@pytest.mark.slow
@pytest.mark.parametrize(
    ("language", "texts"),
    [
        ("en", ("so far", "further month", "proved", "run down")),
        ("es", ("hasta ahora", "otro mes", "verificados", "existencias")),
        ("pt-BR", ("até agora", "mais um mês", "aferidos", "estoque")),
    ],
)
def test_command_states_four_lines(tmp_path, capsys, language, texts):
    folder = tmp_path / "station"
    write_station(folder, Station(days=25, tank=TrueTank(), period_s=600.0).run(
        np.random.default_rng(5)))  # fmt: skip
    lines = "".join(f"{key} = {json.dumps(value)}\n" for key, value in SIZES.items())
    settings = folder / "upkeep.toml"
    text = settings.read_text().replace('"record.json"', '"nothing"')
    settings.write_text(f"{text}\n[drawing]\n{lines}")
    assert cli.main(["plan", str(folder), "--language", language]) == 0
    shown = capsys.readouterr().out.splitlines()
    assert len(shown) == 4
    assert all(text in line for text, line in zip(texts, shown, strict=True))
