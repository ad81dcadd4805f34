"""Are planted faults of a calibration by liquid named? Simulated jobs, filled by mass.

Kind of truth: simulation, the truth physical. Where a fault shows (the largest |w| over 4) the
right cause is among those named in 80 % or more; causes that look alike are named together.
"""

from dataclasses import replace

import numpy as np
import pytest
from metered_runs import Fault, fill, metered_job
from page_figures import figures_of, shares_agree, value_of

from tankcal.job.model import DeclaredInput
from tankcal.pipeline.liquid import Geometry, find_nominal_wall, geometry_alone
from tankcal.pipeline.liquid.adjustment import adjust_liquid
from tankcal.pipeline.liquid.measuring import alternatives_of, is_steady_leak
from tankcal.tank.liquid import name_causes
from tankcal.tank.solids import LyingTank

U = {"diameter": 0.0002, "length": 0.001, "tilt": 0.0002, "datum": 0.0003}
RADIUS_MM = 0.2
METER = {"u_factor_ppm": 120.0, "k": None, "repeatability_ppm": 100.0, "fixed_l": 0.5}
LIQUID = {
    "liquid__run_ppm": 20.0,
    "liquid__u_dip_zero_mm": 0.1,
    "liquid__s_dip_mm": 0.3,
    "liquid__u_temperature_c": 0.05,
}
UPRIGHT = [None, *np.round(np.arange(0.3, 4.0, 0.2), 2).tolist()]
LYING = np.round(np.arange(0.1, 2.0, 0.2), 2).tolist()
FAULTS = {
    "meter": (Fault("meter", 0.001), 2.1e-4),
    "radii": (Fault("radii", 0.002), 2.1e-4),
    "dip": (Fault("dip", 0.010, 5), 2.1e-4),
    "dip_zero": (Fault("dip_zero", 0.002), 2.1e-4),
    "batch": (Fault("batch", 0.0, 6), 2.1e-4),
    "leak": (Fault("leak", 0.1), 2.1e-4),
    "fahrenheit": (Fault("fahrenheit"), 8e-4),  # oil: of water they hardly matter
    "swapped": (Fault("swapped"), 8e-4),
}


ROWS = {  # of upright tanks, then of lying tanks: named, right, number of kinds
    "meter": ("docs/studies/liquid.md", "| meter 0.1 % | (), right () (()) | (), right () (()) |"),
    "radii": ("docs/studies/liquid.md", "| radii 2 mm | (), right () (()) | (), right () (()) |"),
    "dip": ("docs/studies/liquid.md", "| one dip 10 mm | (), right () (()) | (), right () (()) |"),
    "dip_zero": ("docs/studies/liquid.md", "| zero of all dips 2 mm | () | (), right () (()) |"),
    "batch": (
        "docs/studies/liquid.md",
        "| a batch missing | (), right () (()) | (), right () (()) |",
    ),
    "leak": (
        "docs/studies/liquid.md",
        "| a valve that passes, 0.1 m³/h | (), right () (()) | (), right () (()) |",
    ),
    "fahrenheit": (
        "docs/studies/liquid.md",
        "| temperatures in Fahrenheit | (), right () (()) | (), right () (()) |",
    ),
    "swapped": (
        "docs/studies/liquid.md",
        "| temperatures of meter and tank exchanged | (), right () (()) | (), right () (()) |",
    ),
}


def lying_job(folder, expansion):
    job = metered_job(
        "horizontal",
        folder,
        dips=LYING,
        registers=METER,
        horizontal__dip_from_a_m=1.5,
        liquid__expansion_per_k=expansion,
        **LIQUID,
    )
    inputs = tuple(DeclaredInput(name, u, "mm", 1000 * u) for name, u in U.items())
    return replace(job, inputs=inputs)


def lying_truth(rng):
    d, length, tilt, zero = (u * rng.normal() for u in U.values())
    tank = LyingTank(2.4 + d, 2.4 + d, 9.0 + length, tilt=tilt, dip_from_a_m=1.5)
    return (lambda level: tank.volume_m3(np.clip(level + zero, 0, tank.top_m))), 2.395


def upright_job(folder, expansion):
    return metered_job(
        "vertical",
        folder,
        dips=UPRIGHT,
        registers=METER,
        liquid__u_radius_mm=RADIUS_MM,
        liquid__expansion_per_k=expansion,
        **LIQUID,
    )


def upright_truth(rng):
    own, common = np.sqrt(0.2), np.sqrt(0.8)
    sd = RADIUS_MM / 1000
    radii = 6.5 + sd * (own * rng.normal(size=5) + common * rng.normal())
    bottom = 0.5 * rng.normal()

    def volume_below(level):
        level = np.asarray(level, dtype=float)
        wet = np.clip(level[:, None] - 1.9 * np.arange(5), 0, 1.9)
        shell = np.pi * (wet * radii**2).sum(axis=1)
        return np.maximum(shell + bottom * np.clip(level / 0.3, 0, 1), 1e-6 * level)

    return volume_below, 9.5


def spoilt_sizes(job, size_m):
    """The job with all radii that much too large."""
    if job.horizontal is not None:
        wide = job.horizontal.width_m + 2 * size_m
        return replace(job, horizontal=replace(job.horizontal, width_m=wide, height_m=wide))
    wide = job.tank.nominal_diameter_m + 2 * size_m
    return replace(job, tank=replace(job.tank, nominal_diameter_m=wide))


def told(job, truth, fault, rng):
    """Named causes of one simulated job with a fault."""
    filled = fill(rng, job, *truth(rng), fault)
    if fault.kind == "radii":
        filled = spoilt_sizes(filled, fault.size)
    survey = find_nominal_wall(filled) if filled.horizontal is None else None
    found = adjust_liquid(Geometry(filled, survey))
    named = [one for one in name_causes_of(found) if one.is_named]
    of = int(filled.liquid.row[fault.place]) if fault.kind in ("dip", "batch") else None
    right = any(
        one.cause.kind == fault.kind and (of is None or one.cause.of == of) for one in named
    )
    return len({one.cause.kind for one in named}), right


def steady_leak(job, fault, survey):
    """(named, verdict) of a leak in all runs, of one job by liquid alone."""
    rng = np.random.default_rng(4)
    filled = fill(rng, job, *upright_truth(rng), fault)
    verdicts = name_causes_of(adjust_liquid(geometry_alone(filled, survey)))
    return any(one.is_named for one in verdicts), next(filter(is_steady_leak, verdicts))


def name_causes_of(found):
    return name_causes(found.adjusted, alternatives_of(found))


@pytest.mark.slow
def test_hours_at_rest_separate_a_leak_from_the_meter(tmp_path):
    """Simulation: 0.1 m3/h beside liquid alone, steps of one duration; 12 h at rest, twice a run.

    Without rest a leak grows with the volume, as radii and the meter do. At rest it is the fall of
    the level alone: its sd is that of the two dips, their temperatures and the hours between them.
    """
    dips = [None, *np.round(np.arange(0.3, 9.4, 0.5), 2).tolist()]
    rest = [None, 0.3, *dips[1:], dips[-1]]
    leak = Fault("leak", 0.1)
    outcomes = {}
    for name, of_run in (("moving", dips), ("rest", rest)):
        job = metered_job("vertical", tmp_path / name, dips=of_run, registers=METER, **LIQUID)
        survey = find_nominal_wall(job)
        outcomes[name] = steady_leak(job, leak, survey)
        assert not steady_leak(job, Fault(), survey)[0]
    assert not outcomes["moving"][0]
    assert outcomes["moving"][1].detectable > 1.0
    named, found = outcomes["rest"]
    assert named
    assert found.size == pytest.approx(0.1, abs=4 * found.sd)
    fall = np.sqrt(2) * np.pi * 6.5**2 * 0.0003 / 12 / np.sqrt(4)  # four rests: dips alone
    assert 0.8 * fall < found.sd < 1.5 * fall


KINDS = {"upright": (upright_job, upright_truth), "lying": (lying_job, lying_truth)}


@pytest.mark.study
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("fault", FAULTS)
def test_planted_faults_are_named(tmp_path, kind, fault):
    (make, truth), (planted, expansion) = KINDS[kind], FAULTS[fault]
    job, rng = make(tmp_path / "job", expansion), np.random.default_rng(11)
    outcomes = [told(job, truth, planted, rng) for _ in range(50)]
    shown = [right for kinds, right in outcomes if kinds]
    kinds = np.mean([kinds for kinds, _ in outcomes if kinds] or [0.0])
    print(f"{kind} {fault}: shows in {len(shown)} of 50, right in {sum(shown)}, {kinds:.1f} kinds")
    stated = figures_of(*ROWS[fault])
    upright, lying = stated[:-3], stated[-3:]
    mine = upright if kind == "upright" else lying
    assert shares_agree([len(shown) / 50], [f"{value_of(mine[0]) / 50}"], 50, 50)
    if len(mine) > 1 and shown:
        assert shares_agree([sum(shown) / 50], [f"{value_of(mine[1]) / 50}"], 50, 50)
        assert kinds == pytest.approx(value_of(mine[2]), abs=0.5)
    if len(shown) >= 10:
        assert np.mean(shown) >= 0.8


@pytest.mark.study
@pytest.mark.parametrize("kind", KINDS)
def test_sound_jobs_are_hardly_accused(tmp_path, kind):
    make, truth = KINDS[kind]
    job, rng = make(tmp_path / "job", 2.1e-4), np.random.default_rng(12)
    accused = sum(told(job, truth, Fault(), rng)[0] > 0 for _ in range(50))
    jobs, most = figures_of(
        "docs/studies/liquid.md",
        "Of () fault-free jobs of each kind, a cause is named in at most ()",
    )
    assert jobs == "50"
    assert accused <= int(most)
