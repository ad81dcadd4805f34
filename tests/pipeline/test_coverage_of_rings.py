"""Do 95 % intervals of lying tanks by straps hold on rings that are no model of the package?

The tanks of `generated_rings` taper, bulge, are drawn in at their welds, oval and dented, and stand
off the common axis; the truth is the sum of polygons of their sections. The crew declares the size
of the shape, off by some 30 %, and reads the dip to half a millimetre.
"""

import numpy as np
import pytest
from draws import draws
from generated_rings import U, make_tank, strapped_job
from job_builder import write_folder
from page_figures import figures_of
from ringed_jobs import ringed_parts

import tankcal
from tankcal.methods.rings.wall import find_ringed_wall
from tankcal.pipeline.tanks import body_of
from tankcal.uncertainty import combine

SHARES = (0.1, 0.3, 0.5, 0.7, 0.9)  # of the highest dip; then the full tank
NOT_SEEN = {"tilt": "mm/m", "dip_position": "mm", "datum": "mm", "ring_axes": "mm",
            "ring_lengths": "mm"}  # fmt: skip


@pytest.fixture(scope="module")
def base_job(tmp_path_factory):
    parts = ringed_parts(shell__shape_sd_mm=1.0)
    rows = [[name, 1000 * U[name], unit] for name, unit in NOT_SEEN.items()]
    parts.tables["uncertainty"] = [["input", "u", "unit"], *rows]
    return tankcal.load(write_folder(tmp_path_factory.mktemp("rings"), parts))


def errors_of(seed, base, shares):
    """(rows,) errors of volumes over their u, and u over the volume of the full tank."""
    rng = np.random.default_rng(seed)
    tank = make_tank(rng)
    job = strapped_job(rng, tank, base, shares)
    body = body_of(job, find_ringed_wall(job, lambda text: None))
    part = body.parts[0]
    dips = np.array(SHARES) * part.top_m
    error = U["datum"] * rng.normal()
    true = tank.volumes([*(dips + error), 10.0])
    full = part.solid._highest_m
    levels = np.append(dips, full)
    u = combine(body.sources(levels), len(levels)).u
    return (part.volume_m3(levels) - true) / u, u / true[-1]


def study(count, base, figure, shares=(0.2, 0.8)):
    found = [errors_of(seed, base, shares) for seed in range(count)]
    z, u = (np.array(one) for one in zip(*found, strict=True))
    held = np.mean(np.abs(z) < 1.96, axis=0)
    rms = np.sqrt(np.mean(z**2, axis=0))
    for row, name in enumerate((*(f"at {100 * s:.0f} % of the height" for s in SHARES), "full")):
        figure(
            f"{len(shares)} straps, {name}: intervals that hold; error over u, rms; u of the whole",
            f"{100 * held[row]:.1f} %; {rms[row]:.2f}; {100 * np.median(u[:, row]):.3f} %",
        )
    return held, rms


@pytest.mark.slow
@pytest.mark.twentieth
def test_intervals_hold_on_rings_that_are_not_the_model(base_job, figure):
    held, _ = study(25, base_job, figure)
    assert held.min() > 0.94 - 3 * np.sqrt(0.95 * 0.05 / 25)


@pytest.mark.study
def test_intervals_hold_on_rings_that_are_not_the_model_study(base_job, figure):
    (least,) = figures_of(
        "docs/studies/rings.md", "intervals held at least () of the volumes, within"
    )
    assert float(least) == 0.94
    count = draws(250, 1000)  # fewer have too large a chance to exceed the limit of rms
    for shares in ((0.2, 0.8), (0.1, 0.5, 0.9)):
        held, rms = study(count, base_job, figure, shares)
        assert held.min() > 0.94 - 3 * np.sqrt(0.95 * 0.05 / count)
        assert rms.max() < 1.15
