"""Do intervals by liquid hold? Simulated calibrations whose truth is a filled tank, not the model.

Kind of truth: simulation. The last rows and deliveries are of what was never filled.
"""

import numpy as np
import pytest
from metered_cylinders import Calibrator, Survey, fill_tanks, held
from page_figures import figures_of, value_of

from tankcal.tank.liquid import RunEffect

NO_RUNS = RunEffect(0.0, np.inf, 0.0)


@pytest.mark.slow
def test_intervals_hold_in_a_twentieth():
    """500 jobs: 95 % within three standard deviations of such a count."""
    survey = Survey(steps=8)
    share = held(fill_tanks(np.random.default_rng(20), 500, survey), Calibrator(survey))
    assert np.all(np.abs(share - 0.95) < 3 * np.sqrt(0.95 * 0.05 / 500))


@pytest.mark.study
@pytest.mark.parametrize("run", [200e-6, 300e-6])
def test_intervals_hold(run):
    survey = Survey(run=run)
    truth = fill_tanks(np.random.default_rng(5), 10_000, survey)
    share = held(truth, Calibrator(survey))
    count, *bounds = figures_of(
        "docs/studies/liquid.md",
        "95 % intervals of rows and deliveries, () filled tanks, three runs, run effect unknown "
        "(200 and 300 ppm; meter 300) | simulation with a physical truth | () to () % |",
    )
    least, most = (value_of(bound) / 100 for bound in bounds)
    assert value_of(count) == 10_000
    assert np.all((share > least) & (share < most)), share


@pytest.mark.study
def test_intervals_do_not_hold_of_simpler_models():
    """Runs left out: too narrow; increments as if no dip served two of them: no longer 95 %."""
    survey = Survey(meter=150e-6)
    truth = fill_tanks(np.random.default_rng(5), 3000, survey)
    count, meter, most = figures_of(
        "docs/studies/liquid.md",
        "| () with meter () ppm, the run effect left out | | as low as () % or less |",
    )
    assert (int(count), int(meter)) == (3000, 150)
    assert np.min(held(truth, Calibrator(survey, run=NO_RUNS))) < int(most) / 100
    independent = held(truth, Calibrator(survey, independent=True))
    assert np.max(np.abs(independent - 0.95)) > 0.01, independent


@pytest.mark.study
@pytest.mark.parametrize(("run", "least", "most"), [(0.0, 0.945, 0.98), (1e-3, 0.91, 0.96)])
def test_intervals_at_the_limits_of_three_runs(run, least, most):
    """Without a run effect they are wide, three runs being no proof; of a large one too narrow."""
    survey = Survey(run=run)
    share = held(fill_tanks(np.random.default_rng(5), 3000, survey), Calibrator(survey))
    large, small = (
        figures_of(
            "docs/studies/liquid.md",
            "95 % intervals cover () to () % if the run effect is far larger than all other "
            "effects (1000 ppm)",
        ),
        figures_of("docs/studies/liquid.md", "Without any run effect they cover () to () %"),
    )
    assert [100 * least, 100 * most] == pytest.approx([*map(value_of, large if run else small)])
    assert np.all((share > least) & (share < most)), share
