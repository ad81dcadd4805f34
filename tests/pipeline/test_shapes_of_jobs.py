"""Whole jobs of every shape of end, head and gauge tube: volumes, budgets, bad sizes, coverage."""

import numpy as np
import pytest
from job_builder import write_job
from messages_told import lines as said
from scipy import stats

import tankcal
from tankcal.errors import InputError, SolutionError
from tankcal.pipeline.tanks import gross_at_top
from tankcal.tank.heads import End
from tankcal.tank.solids import LyingTank
from tankcal.tank.tips import tip_of

COARSE = {"table.step_m": 0.1}
RADIUS, HEIGHT = 6.5, 9.5
PLAN = np.pi * RADIUS**2


def result_of(folder, settings, uncertainty=(), **more):
    settings = COARSE | settings
    return tankcal.run(
        tankcal.load(write_job(folder, settings=settings, uncertainty=uncertainty, **more))
    )


def upright(folder, settings, uncertainty=(), **more):
    """A tank without plates: the surveyed radius is the inside one."""
    settings = {"survey.side": "inside"} | settings
    return result_of(folder, settings, uncertainty, **more)


def lying(folder, settings, uncertainty=()):
    return result_of(folder, settings, uncertainty, kind="horizontal")


ENDS = {
    "guppy": ({"depth_m": 0.6}, End("guppy", 0.6), ["end_depth"]),
    "by depth and dish": (
        {"depth_m": 0.46, "dish_radius_m": 2.4},
        End("torispherical", 0.46, dish_radius_m=2.4),
        ["end_depth", "dish"],
    ),
    "by depth and knuckle": (
        {"depth_m": 0.46, "knuckle_radius_m": 0.24},
        End("torispherical", 0.46, knuckle_radius_m=0.24),
        ["end_depth", "knuckle"],
    ),
    "by a standard": (
        {"standard": "din_28011"},
        End("torispherical", 0.0, 2.4, 0.24),
        ["end_depth", "dish", "knuckle"],
    ),
    "of a standard, by depth": (
        {"standard": "asme", "depth_m": 0.44},
        End("torispherical", 0.44, None, 0.06 * 2.4),
        ["end_depth", "knuckle"],
    ),
}


@pytest.mark.slow(after=1)
@pytest.mark.parametrize("name", ENDS)
def test_lying_tanks_with_ends_run_to_the_table(tmp_path, name):
    sizes, end, inputs = ENDS[name]
    form = "guppy" if name == "guppy" else "torispherical"
    settings = {f"horizontal.end_{e}": form for e in "ab"}
    settings |= {f"horizontal.end_{e}_{key}": one for e in "ab" for key, one in sizes.items()}
    found = lying(tmp_path / "job", settings, [(one, 3.0, "mm") for one in inputs])
    tank = LyingTank(2.4, 2.4, 10.0, end, end, dip_from_a_m=5.0)
    table = found.table
    assert table.volume_m3 == pytest.approx(tank.volume_m3(table.height_m), abs=1e-12)
    by = tank.derivatives(table.height_m)
    lines = {one.kind: one.columns_m3[:, 0] for one in table.sources}
    assert set(inputs) <= set(lines)
    for one in inputs:
        assert lines[one] == pytest.approx(0.003 * by[one], abs=1e-12)


def test_a_rolled_tube_runs_to_the_table(tmp_path):
    settings = {"horizontal.tube_angle_deg": 5.0, "horizontal.tube_offset_m": 0.1}
    rows = [("tube_angle", 0.3, "deg"), ("tube_offset", 5.0, "mm")]
    found = lying(tmp_path / "job", settings, rows)
    angle, dips = np.radians(5), found.table.height_m
    depth = 1.2 + (dips - np.sqrt(1.44 - 0.01)) * np.cos(angle) - 0.1 * np.sin(angle)
    expected = LyingTank(2.4, 2.4, 10.0).volume_m3(np.minimum(depth, 2.4))
    assert found.table.volume_m3[:-1] == pytest.approx(expected[:-1], abs=1e-12)
    lines = {one.kind: one.columns_m3[:, 0] for one in found.table.sources}
    surface = found.table.area_m2 / np.cos(angle)
    by_angle = -(dips - np.sqrt(1.43)) * np.sin(angle) - 0.1 * np.cos(angle)
    assert lines["tube_angle"][:-1] == pytest.approx(
        (np.radians(0.3) * by_angle * surface)[:-1], rel=1e-9, abs=1e-12
    )


def test_an_error_of_the_angle_is_one_error_of_all_rows(tmp_path):
    """Two dips on both sides of the middle: their errors have other signs, so a delivery between
    them is less sure than if they were independent.
    """
    settings = {"horizontal.tube_angle_deg": 8.0}
    table = lying(tmp_path / "job", settings, [("tube_angle", 0.5, "deg")]).table
    low, high = table.at(0.5).u_m3, table.at(1.9).u_m3
    assert table.delivery(0.5, 1.9).u_m3 == pytest.approx(low + high, rel=1e-9)


BOTTOMS = {
    "cone": ({"centre_z_m": -9.0}, (9.0,), ["bottom_depth"]),
    "dish": ({"centre_z_m": -1.2}, (1.2,), ["bottom_depth"]),
    "ellipsoidal": ({"centre_z_m": -3.25}, (3.25,), ["bottom_depth"]),
    "torispherical": ({"standard": "din_28011"}, (0.0, 13.0, 1.3), ["dish", "knuckle"]),
}
TOPS = {
    "cone": ({"depth_m": 3.0}, (3.0,), ["top_depth"]),
    "dish": ({"depth_m": 1.2}, (1.2,), ["top_depth"]),
    "ellipsoidal": ({"depth_m": 3.25}, (3.25,), ["top_depth"]),
    "torispherical": (
        {"depth_m": 2.5, "knuckle_radius_m": 1.3},
        (2.5, None, 1.3),
        ["top_depth", "knuckle"],
    ),
}


@pytest.mark.slow
@pytest.mark.parametrize("form", BOTTOMS)
def test_upright_tanks_on_heads_run_to_the_table(tmp_path, form):
    """Closed forms of `tips`, proved there; the dip plate at the lowest point."""
    sizes, given, inputs = BOTTOMS[form]
    tip = tip_of(form, PLAN, *given)
    settings = {f"bottom.{key}": one for key, one in sizes.items()}
    settings |= {"bottom.form": form, "datum.dip_plate_z_m": -tip.depth_m}
    found = upright(tmp_path / "job", settings, [(one, 4.0, "mm") for one in inputs])
    whole = PLAN * HEIGHT + tip.beyond_m3(0.0)
    assert found.table.volume_m3[0] == pytest.approx(0.0, abs=1e-6)
    assert found.body.volume_m3([HEIGHT])[0] == pytest.approx(whole, rel=1e-6)
    half = float(tip.beyond_m3(tip.depth_m / 2))
    assert found.body.volume_m3([-tip.depth_m / 2])[0] == pytest.approx(half, rel=1e-6)
    assert set(inputs) <= {one.kind for one in found.table.sources}


@pytest.mark.slow
@pytest.mark.parametrize("form", TOPS)
def test_upright_tanks_with_heads_on_top_run_to_the_table(tmp_path, form):
    sizes, given, inputs = TOPS[form]
    tip = tip_of(form, PLAN, *given)
    settings = {f"top.{key}": one for key, one in sizes.items()} | {"top.form": form}
    found = upright(tmp_path / "job", settings, [(one, 4.0, "mm") for one in inputs])
    table = found.table
    assert table.height_m[-1] == pytest.approx(HEIGHT + tip.depth_m, abs=1e-3)
    assert table.volume_m3[-1] == pytest.approx(PLAN * HEIGHT + tip.beyond_m3(0.0), rel=1e-6)
    assert np.all(np.diff(table.volume_m3) > 0)
    (correction,) = [one for one in found.corrections if one.code == "top"]
    assert correction.size_m3 == pytest.approx(tip.beyond_m3(0.0), rel=1e-6)
    lines = {one.kind: one.columns_m3[:, 0] for one in table.sources}
    by = tip.derivatives(0.0)
    names = {"top_depth": "depth"}
    for one in inputs:
        expected = 0.004 * by[names.get(one, one)]
        assert lines[one][-1] == pytest.approx(expected, rel=1e-6)
        assert not np.any(lines[one][table.height_m < HEIGHT])


@pytest.mark.slow
def test_a_head_that_is_switched_off_is_told_and_not_taken(tmp_path):
    settings = {"top.form": "dish", "top.depth_m": 1.0, "corrections.top": False}
    found = upright(tmp_path / "job", settings)
    assert found.table.height_m[-1] == pytest.approx(HEIGHT)
    (correction,) = [one for one in found.corrections if one.code == "top"]
    assert not correction.applied
    assert correction.size_m3 > 0


@pytest.mark.slow
def test_a_head_with_liquid_temperature_and_everything(tmp_path):
    """Parts add up: gross and corrections are the last row."""
    settings = {
        "top.form": "torispherical",
        "top.standard": "din_28013",
        "bottom.form": "torispherical",
        "bottom.standard": "din_28011",
        "table.liquid_density_kg_m3": 850.0,
        "survey.shell_temperature_c": 30.0,
        "table.height_expansion": True,
    }
    found = result_of(tmp_path / "job", settings, deadwood=[("coil", 9.6, 10.2, -0.5)])
    made = sum(one.size_m3 for one in found.corrections if one.applied and one.code != "tilt")
    over_m = found.zero_m + found.table.height_m[-1] - found.body.highest_m
    gross = gross_at_top(found.job, found.wall, over_m)
    assert gross + made == pytest.approx(found.table.volume_m3[-1], rel=1e-9)


BAD = [
    ("horizontal", {"end_a": "guppy"}, "horizontal.end_a_depth_m", "missing"),
    ("horizontal", {"end_a": "torispherical", "end_a_depth_m": 0.5},
     "horizontal.end_a_standard", "beside the depth"),
    ("horizontal", {"end_a": "torispherical", "end_a_depth_m": 0.5, "end_a_dish_radius_m": 2.4,
                    "end_a_knuckle_radius_m": 0.24}, "horizontal.end_a_depth_m", "two of these"),
    ("horizontal", {"end_a": "torispherical", "end_a_depth_m": 0.2, "end_a_dish_radius_m": 2.4},
     "horizontal.end_a_depth_m", "more than 0.3215"),
    ("horizontal", {"end_a": "torispherical", "end_a_depth_m": 1.2, "end_a_standard": "asme"},
     "horizontal.end_a_depth_m", "less than 1.2"),
    ("horizontal", {"end_a": "torispherical", "end_a_dish_radius_m": 2.4,
                    "end_a_standard": "asme"}, "horizontal.end_a_dish_radius_m", "only one"),
    ("horizontal", {"end_a_standard": "asme"}, "horizontal.end_a_standard", "only for a tori"),
    ("horizontal", {"end_a": "torispherical", "end_a_standard": "din"},
     "horizontal.end_a_standard", "asme"),
    ("horizontal", {"tube_offset_m": 1.2}, "horizontal.tube_offset_m", "half the diameter"),
    ("horizontal", {"tube_angle_deg": 5, "tilt_mm_per_m": 8, "dip_from_a_m": 4.0},
     "horizontal.dip_direction", "expected square"),
    ("horizontal", {"diameter_m": None, "width_m": 2.4, "height_m": 2.0, "tube_angle_deg": 5},
     "horizontal.tube_angle_deg", "round"),
    ("horizontal", {"tube_angle_deg": 85}, "horizontal.tube_angle_deg", "60"),
    ("bottom", {"form": "ellipsoidal"}, "bottom.centre_z_m", "missing"),
    ("bottom", {"form": "torispherical"}, "bottom.standard", "din_28011"),
    ("bottom", {"form": "torispherical", "dish_radius_m": 6.0, "knuckle_radius_m": 1.0},
     "bottom.dish_radius_m", "more than half"),
    ("bottom", {"form": "cone", "centre_z_m": -70.0}, "bottom.centre_z_m", "65 m below"),
    ("bottom", {"form": "cone", "centre_z_m": -1.0, "dish_radius_m": 13.0},
     "bottom.dish_radius_m", "only for a tori"),
    ("top", {"depth_m": 1.0}, "top.form", "together with depth_m"),
    ("top", {"form": "dish"}, "top.depth_m", "missing"),
    ("top", {"form": "dish", "depth_m": 6.6}, "top.depth_m", "at most 6.5"),
    ("top", {"form": "onion", "depth_m": 1.0}, "top.form", "cone"),
    ("top", {"form": "torispherical", "depth_m": 7.0, "standard": "asme"}, "top.depth_m",
     "less than 6.5"),
]  # fmt: skip


@pytest.mark.parametrize(("section", "changes", "key", "words"), BAD)
def test_a_size_that_cannot_be_is_one_line(tmp_path, section, changes, key, words):
    kind = "horizontal" if section == "horizontal" else "vertical"
    settings = {f"{section}.{name}": value for name, value in changes.items()}
    with pytest.raises(InputError) as caught:
        tankcal.load(write_job(tmp_path / "job", kind=kind, settings=settings))
    said(caught.value.problems)
    assert key in {one.column for one in caught.value.problems}
    (problem,) = [one for one in caught.value.problems if one.column == key]
    assert words in problem.expected


@pytest.mark.parametrize(
    ("kind", "row"),
    [
        ("horizontal", ("dish", 2.0, "mm")),
        ("vertical", ("bottom_depth", 2.0, "mm")),
        ("vertical", ("top_depth", 2.0, "mm")),
        ("vertical", ("knuckle", 2.0, "mm")),
        ("sphere", ("tube_angle", 0.2, "deg")),
    ],
)
def test_inputs_without_their_shape_are_refused(tmp_path, kind, row):
    with pytest.raises(InputError, match=row[0]):
        tankcal.load(write_job(tmp_path / "job", kind=kind, uncertainty=[row]))


SIZES = [None, -1.0, 0.0, 0.02, 0.13, 0.24, 0.5, 1.2, 2.4, 6.4, 13.0, 40.0]


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(4))
def test_random_sizes_make_a_table_or_plain_lines(tmp_path, seed):
    """Property: any sizes are computed, or refused in words."""
    rng = np.random.default_rng(seed)
    computed = 0
    for number in range(30):
        kind, settings = random_settings(rng)
        folder = write_job(tmp_path / str(number), kind=kind, settings=COARSE | settings,
                           rings=1, points_per_ring=12, courses=2)  # fmt: skip
        table = table_or_lines(folder)
        if table is None:
            continue
        computed += 1
        assert np.all(np.isfinite(table.volume_m3))
        assert np.diff(table.volume_m3).min() > -1e-9
    assert computed


def table_or_lines(folder):
    """The table; None when it is refused in plain lines. Anything else is raised."""
    try:
        return tankcal.run(tankcal.load(folder)).table
    except (InputError, SolutionError) as error:
        text = str(error)
    assert all(line.strip() for line in text.split("\n"))
    return None


def random_settings(rng):
    """(kind, settings): sizes that go together in number, of sizes that may not."""

    def some(*choices):
        return choices[rng.integers(len(choices))]

    def sized(prefix, form, depth):
        given = {"depth": (depth,), "none": ()}.get("none" if form in (None, "flat") else "depth")
        if form == "torispherical":
            given = some((depth, "standard"), ("standard",), (depth, "dish_radius_m"),
                         (depth, "knuckle_radius_m"), ("dish_radius_m", "knuckle_radius_m"),
                         (depth,), ("dish_radius_m", "standard"))  # fmt: skip
        found = {f"{prefix}{name}": some(*SIZES) for name in given}
        if "standard" in given:
            found[f"{prefix}standard"] = some("asme", "din_28011", "din_28013")
        return found

    if rng.random() < 0.5:
        settings = {}
        for end in "ab":
            form = some("torispherical", "guppy", "flat", "spherical")
            settings |= {f"horizontal.end_{end}": form}
            settings |= sized(f"horizontal.end_{end}_", form, "depth_m")
        settings["horizontal.tube_angle_deg"] = some(None, 0.0, -3.0, 59.0, 61.0)
        settings["horizontal.tube_offset_m"] = some(None, 0.0, -0.3, 1.19, 1.3)
        settings["horizontal.roll_deg"] = some(None, None, 7.0, -90.0)
        return "horizontal", settings
    settings = {}
    for part, depth in (("bottom", "centre_z_m"), ("top", "depth_m")):
        form = some("cone", "dish", "ellipsoidal", "torispherical", None)
        settings |= {f"{part}.form": form} | sized(f"{part}.", form, depth)
    if settings.get("bottom.centre_z_m"):
        settings["bottom.centre_z_m"] *= some(1, -1)
    return "vertical", settings


@pytest.mark.slow
@pytest.mark.parametrize("shape", ["tube", "torispherical", "guppy"])
def test_intervals_hold_the_truth(tmp_path, shape, figure):
    """Simulation: sizes as measured scatter about those of the true tank, whose volumes are those
    of `LyingTank`; the 95 % intervals of a few rows, by the chain with its Monte Carlo.
    """
    settings, u, truth = COVERED[shape]
    rng, held, count = np.random.default_rng(11), 0, 200
    rows = [(name, one, unit) for name, (one, unit, _) in u.items()]
    tank = truth({})
    job = tankcal.load(write_job(tmp_path / "job", kind="horizontal", settings={
        "table.step_m": 0.4, "table.monte_carlo": True, **settings}, uncertainty=rows))  # fmt: skip
    found = tankcal.run(job)
    interval = np.maximum(found.table.U_m3, 1e-12)
    dips = found.table.height_m[1:-1]
    by = tank.derivatives(dips)
    for _ in range(count):
        errors = {name: si * rng.normal() for name, (_, _, si) in u.items()}
        true = truth({name: -one for name, one in errors.items()})
        true = true.volume_m3(np.minimum(dips, true.top_m))  # no dip is above the full tank
        held += np.abs(found.table.volume_m3[1:-1] - true) <= interval[1:-1]
    shares = held / count
    figure(f"{shape}: coverage of rows, %", ", ".join(f"{100 * one:.0f}" for one in shares))
    least, most = stats.binom.ppf([0.0005, 0.9995], count, 0.95) / count
    assert set(u) <= set(by)
    assert np.all((shares >= least) & (shares <= most))


def _tube(errors):
    return LyingTank(2.4, 2.4, 10.0, tube_angle_rad=np.radians(6) + errors.get("tube_angle", 0),
                     tube_offset_m=0.2 + errors.get("tube_offset", 0))  # fmt: skip


def _torispherical(errors):
    end = End("torispherical", 0.46 + errors.get("end_depth", 0), None,
              0.24 + errors.get("knuckle", 0))  # fmt: skip
    return LyingTank(2.4, 2.4, 10.0, end, end)


def _guppy(errors):
    end = End("guppy", 0.6 + errors.get("end_depth", 0))
    across = 2.4 + errors.get("diameter", 0)
    return LyingTank(across, across, 10.0, end, end)


DEG = np.pi / 180
COVERED = {
    "tube": (
        {"horizontal.tube_angle_deg": 6.0, "horizontal.tube_offset_m": 0.2},
        {"tube_angle": (1.0, "deg", DEG), "tube_offset": (10.0, "mm", 0.01)},
        _tube,
    ),
    "torispherical": (
        {f"horizontal.end_{e}{key}": value for e in "ab" for key, value in
         (("", "torispherical"), ("_depth_m", 0.46), ("_knuckle_radius_m", 0.24))},
        {"end_depth": (8.0, "mm", 0.008), "knuckle": (8.0, "mm", 0.008)},
        _torispherical,
    ),
    "guppy": (
        {f"horizontal.end_{e}{key}": value for e in "ab" for key, value in
         (("", "guppy"), ("_depth_m", 0.6))},
        {"end_depth": (20.0, "mm", 0.02), "diameter": (5.0, "mm", 0.005)},
        _guppy,
    ),
}  # fmt: skip
