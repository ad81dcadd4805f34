"""Drawn walls have the covariance that the field of a wall is estimated with.

Truth: that covariance itself (`Covariances.total`), which is summed in closed form; closed forms.
"""

import numpy as np
import pytest

from tankcal.geometry.field.amplitudes import assumed_amplitudes
from tankcal.geometry.field.components import COMPONENTS, weld_columns
from tankcal.geometry.field.sites import Covariances, Sites
from tankcal.geometry.girth import SHORTEST_WAVE_M, draw_waves, modes_of, nodes_of
from tankcal.planning.wall.nominal_readings import draw_departures

NOMINAL_M, ZETA = 2.0, np.array([-0.6, 0.0, 0.6])
STEPS = (0, 1, 5, 40, 150)


def covariance_of(sizes, steps):
    """(2, 3, 2, 3, steps) between courses, heights and azimuths so many nodes apart."""
    turn = 2 * np.pi / nodes_of(NOMINAL_M)
    course, row, step = (one.ravel() for one in np.meshgrid([0, 1], range(3), steps, indexing="ij"))
    sites = Sites(course, course, ZETA[row], turn * step, np.zeros(len(step), dtype=bool))
    found = Covariances(sites, NOMINAL_M).total(sizes)
    return found.reshape(2, 3, len(steps), 2, 3, len(steps))[:, :, 0]


@pytest.mark.slow
@pytest.mark.parametrize(("shape", "draws"), [("mean", 900), ("oval", 300), ("seam", 100)])
def test_covariance_of_drawn_walls(shape, draws):
    """Simulation, pooled over all azimuths; of unit variance, known to 0.05 or so."""
    shapes = np.array([one.shape for one in COMPONENTS])
    sizes = assumed_amplitudes().likely_m2 * (shapes == shape)
    rng, found = np.random.default_rng(2), 0.0
    for _ in range(draws):
        drawn = draw_departures(rng, sizes, ZETA, [(), ()], NOMINAL_M)
        for place, step in enumerate(STEPS):
            later = np.roll(drawn, -step, axis=2)
            both = np.einsum("cka,dla->ckdl", drawn, later) / drawn.shape[2]
            found = found + np.eye(len(STEPS))[place] * both[..., None] / draws
    told = covariance_of(sizes, STEPS)
    np.testing.assert_allclose(found / sizes.sum(), told / sizes.sum(), atol=0.12)


def test_peaks_of_welds():
    """The same at all heights; one size of all, or each its own."""
    names = [one.name for one in COMPONENTS]
    sizes, welds = np.zeros(len(names)), [(0.5, 3.0), (2.0,)]
    sizes[names.index("peaking")] = 1e-6
    drawn = draw_departures(np.random.default_rng(3), sizes, ZETA, welds, NOMINAL_M)
    assert np.ptp(drawn, axis=1).max() == 0
    azimuth = 2 * np.pi * np.arange(drawn.shape[2]) / drawn.shape[2]
    of_one = [weld_columns(azimuth, np.array(one), NOMINAL_M).sum(axis=1) for one in welds]
    peak = drawn[0, 0] @ of_one[0] / (of_one[0] @ of_one[0])
    np.testing.assert_allclose(drawn[:, 0], peak * np.array(of_one), atol=1e-12)
    sizes[names.index("peaking")], sizes[names.index("own peaks")] = 0.0, 1e-6
    drawn = draw_departures(np.random.default_rng(3), sizes, ZETA, welds, NOMINAL_M)
    places = np.round(np.array([0.5, 3.0]) / (2 * np.pi) * drawn.shape[2]).astype(int)
    assert np.ptp(np.abs(drawn[0, 0, places])) > 1e-5


def test_waves_have_their_mean_squares():
    """Closed form: the sum of all is the mean square of the outline, by Parseval."""
    rng, modes = np.random.default_rng(4), len(modes_of(NOMINAL_M))
    assert 2 * np.pi * NOMINAL_M / (modes + 1) == pytest.approx(SHORTEST_WAVE_M, rel=0.05)
    variances = np.zeros(modes)
    variances[[0, 7]] = 4e-6, 1e-6
    waves = draw_waves(rng, variances, (4000,))
    assert np.mean(waves**2) == pytest.approx(5e-6, rel=0.05)
    np.testing.assert_allclose(waves.mean(axis=1), 0, atol=1e-15)
