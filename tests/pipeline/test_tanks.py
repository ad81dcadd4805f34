"""Jobs of every kind and part with known capacities, and what each correction is worth."""

import io
from dataclasses import replace

import numpy as np
import pytest
from job_builder import write_job

import tankcal
from tankcal.errors import HeightError, InputError
from tankcal.geometry.circles import fit_circle
from tankcal.job import DeclaredInput
from tankcal.pipeline.chain import run
from tankcal.record import record_of
from tankcal.tank.solids import End, LyingTank

RADIUS, HEIGHT = 6.5, 9.5
PLAN = np.pi * RADIUS**2
INSIDE = {"survey.side": "inside"}


def result_of(folder, **changes):
    changes["settings"] = changes.get("settings", {})
    return run(tankcal.load(write_job(folder, **changes)))


def inside_cylinder(folder, settings=None, **changes):
    """A cylinder of 6.5 x 9.5 m, surveyed inside, with plates of 8 mm for the head."""
    return result_of(folder, settings=INSIDE | (settings or {}), **changes)


def sizes(result):
    return {one.code: one.size_m3 for one in result.corrections}


# ---- head


@pytest.mark.slow
def test_liquid_head_is_that_of_the_published_example(tmp_path):
    """Closed form: 0.46334 m3 first order, 0.46340 m3 with the square of the widening."""
    found = inside_cylinder(tmp_path / "job", {"table.liquid_density_kg_m3": 1000.0})
    assert sizes(found)["head"] == pytest.approx(0.46340, abs=2e-5)
    assert found.table.volume_m3[-1] == pytest.approx(PLAN * HEIGHT + 0.46340, abs=1e-3)


@pytest.mark.slow
def test_survey_of_full_tank_needs_no_head_for_same_liquid(tmp_path):
    settings = {
        "survey.liquid_level_m": HEIGHT,
        "survey.liquid_density_kg_m3": 850.0,
        "table.liquid_density_kg_m3": 850.0,
    }
    found = inside_cylinder(tmp_path / "job", settings)
    assert sizes(found)["head"] == pytest.approx(0.0, abs=1e-9)
    half = found.at(HEIGHT / 2).value_m3
    assert half < PLAN * HEIGHT / 2 - 0.05  # half full it is narrower than on the survey day


@pytest.mark.slow
def test_table_of_other_density_equals_its_own_job(tmp_path):
    both = inside_cylinder(
        tmp_path / "a",
        {"table.liquid_density_kg_m3": 700.0, "table.other_densities_kg_m3": [1000.0]},
    )
    alone = inside_cylinder(tmp_path / "b", {"table.liquid_density_kg_m3": 1000.0})
    assert both.by_density[1000.0] == pytest.approx(alone.table.volume_m3, rel=1e-14)


@pytest.mark.slow
def test_a_floating_roof_floats_in_the_liquid_of_each_table(tmp_path):
    """In the other liquid it takes M/rho of that liquid, as in a job of that density."""
    roof = {"mass_kg": 9000.0, "reference_density_kg_m3": 700.0}
    both = inside_cylinder(
        tmp_path / "a",
        {"table.liquid_density_kg_m3": 700.0, "table.other_densities_kg_m3": [1000.0]},
        roof=roof,
    )
    alone = inside_cylinder(
        tmp_path / "b",
        {"table.liquid_density_kg_m3": 1000.0},
        roof=roof | {"reference_density_kg_m3": 1000.0},
    )
    assert both.by_density[1000.0] == pytest.approx(alone.table.volume_m3, rel=1e-14)


# ---- bottom, deadwood, roof


@pytest.mark.slow
@pytest.mark.parametrize(
    ("form", "centre", "volume"),
    [
        ("cone", -0.15, 6.6366),  # published: r 6.5, H 0.15
        ("cone", 0.15, -6.6366),
        ("dish", -0.15, 9.9567),
        ("dish", 0.15, -9.9567),
    ],
)
def test_a_shaped_bottom_adds_its_volume(tmp_path, form, centre, volume):
    settings = {"bottom.form": form, "bottom.centre_z_m": centre}
    found = inside_cylinder(tmp_path / "job", settings)
    assert sizes(found)["bottom"] == pytest.approx(volume, abs=1e-4)
    assert found.table.volume_m3[-1] == pytest.approx(PLAN * HEIGHT + volume, abs=1e-3)


@pytest.mark.slow
def test_dips_from_plate_in_cone_begin_with_empty_tank(tmp_path):
    settings = {
        "bottom.form": "cone",
        "bottom.centre_z_m": -0.15,
        "datum.dip_plate_z_m": -0.15,
    }
    found = inside_cylinder(tmp_path / "job", settings)
    assert found.table.volume_m3[0] == 0.0
    assert found.at(0.08).value_m3 == pytest.approx(6.6366 * (8 / 15) ** 3, abs=1e-3)  # similar
    assert found.at(0.15).value_m3 == pytest.approx(6.6366, abs=1e-3)
    assert found.table.height_m[-1] == pytest.approx(HEIGHT + 0.15)


@pytest.mark.slow
def test_a_bottom_measured_by_liquid_carries_the_shell_above_it(tmp_path):
    volumes = [(0.0, 0.0, 0.0), (0.1, 10.0, 0.0), (0.2, 23.0, 0.05)]
    found = inside_cylinder(tmp_path / "job", bottom_volumes=volumes)
    assert found.at(0.1).value_m3 == pytest.approx(10.0, abs=1e-9)
    assert found.at(0.2).value_m3 == pytest.approx(23.0, abs=1e-9)
    assert found.at(5.0).value_m3 == pytest.approx(23.0 + PLAN * 4.8, abs=1e-3)
    assert found.body.shell is not None  # courses are reported as ever
    delivered = found.delivery(1.0, 5.0)
    assert delivered.value_m3 == pytest.approx(PLAN * 4.0, abs=1e-3)
    metered = next(one for one in found.table.sources if one.kind == "bottom_liquid")
    rows = np.searchsorted(found.table.height_m, [1.0, 5.0])
    low, high = metered.columns_m3[rows]
    assert high == pytest.approx(low, abs=1e-12)  # the metered volume is common to both dips
    assert np.linalg.norm(high) == pytest.approx(0.05, rel=1e-6)
    assert delivered.u_m3 < found.at(5.0).u_m3


@pytest.mark.slow
def test_a_leaning_bottom_moves_the_zero_with_the_dip_point(tmp_path):
    """The bottom square to an axis that leans 2 % to +x lies 60 mm lower 3 m to that side."""
    settings = {
        "bottom.form": "leaning",
        "datum.dip_x_m": 3.0,
        "datum.dip_y_m": 0.0,
    }
    leaning = {"tilt": (0.02, 0.0), "radius": _leaning_cut(0.02)}
    found = inside_cylinder(tmp_path / "a", settings, **leaning)
    assert found.zero_m == pytest.approx(-0.06, abs=2e-5)
    level = inside_cylinder(tmp_path / "b", **leaning)
    # above its highest edge a bottom through the axis holds what a level one holds
    assert found.at(2.06).value_m3 == pytest.approx(level.at(2.0).value_m3, abs=2e-3)
    assert found.table.volume_m3[0] > 0.5  # what lies lower than the dip point


def _leaning_cut(slope):
    longer = np.hypot(1, slope)
    return lambda theta, z: RADIUS * longer / np.hypot(np.sin(theta), longer * np.cos(theta))


@pytest.mark.slow
def test_deadwood_counts_between_its_bottom_and_its_top(tmp_path):
    plate = {"datum.dip_plate_z_m": 0.1}
    items = [("coil", 0.5, 1.0, -0.4, 0.01), ("manhole", 0.8, 1.4, 0.3)]
    found = inside_cylinder(tmp_path / "a", plate, deadwood=items)
    bare = inside_cylinder(tmp_path / "b", plate)
    change = found.table.volume_m3 - bare.table.volume_m3
    at = {round(height, 3): row for row, height in enumerate(found.table.height_m)}
    for height, expected in ((0.5, 0.0), (0.75, -0.2), (1.0, -0.3), (1.4, -0.1), (9.4, -0.1)):
        assert change[at[height]] == pytest.approx(expected, abs=1e-9)  # dips, not heights of z
    assert sizes(found)["deadwood"] == pytest.approx(-0.1)


@pytest.mark.slow
def test_a_floating_roof_is_deducted_above_its_critical_zone(tmp_path):
    found = inside_cylinder(tmp_path / "a", roof={})
    bare = inside_cylinder(tmp_path / "b")
    change = found.table.volume_m3 - bare.table.volume_m3
    weighed = 9000 * (1 - 1.2 / 8000) / (850 - 1.2)  # closed form
    assert sizes(found)["roof"] == pytest.approx(-weighed)
    assert change[100] == pytest.approx(0.0, abs=1e-9)
    assert change[130] == pytest.approx(-weighed)
    assert found.table.critical_m == (1.0, 1.3)
    datum = DeclaredInput("datum", 0.002, "mm", 2.0)
    moved = run(replace(found.job, inputs=(datum,))).table
    by_zero = next(source for source in moved.sources if source.kind == "datum").columns_m3[:, 0]
    assert by_zero[1:-1] == pytest.approx(0.002 * PLAN, rel=1e-4)  # its heights move with the zero
    assert not found.at(1.15).for_use
    vacuum = inside_cylinder(tmp_path / "c", roof={"weighing": "vacuum"})
    assert sizes(vacuum)["roof"] == pytest.approx(-9000 / 850)


@pytest.mark.slow
def test_roof_on_high_legs_floats_off_later(tmp_path):
    """Closed forms: the whole displacement between the zones, none below, and equal above."""
    legs = {"weighing": "vacuum", "high_critical_bottom_m": 1.62, "high_critical_top_m": 2.0}
    found = inside_cylinder(tmp_path / "a", roof=legs)
    record = record_of(found)
    rows = {round(row["height_m"], 6): row for row in record["on_high_legs"]}
    usual = dict(zip(found.table.height_m.round(6).tolist(), found.table.volume_m3, strict=True))
    displaced = 9000 / 850
    assert min(rows) == 1.0
    assert max(rows) == 2.0
    for height, part in ((1.0, 0.0), (1.15, 0.5), (1.3, 1.0), (1.6, 1.0), (1.81, 0.5), (2.0, 0.0)):
        row = rows[height]
        assert row["volume_m3"] - usual[height] == pytest.approx(part * displaced, abs=1e-9)
    assert [height for height in (1.15, 1.6, 1.62, 1.7, 2.0) if not rows[height]["for_use"]] == [
        1.7
    ]
    alone = {"weighing": "vacuum", "critical_bottom_m": 1.62, "critical_top_m": 2.0}
    other = inside_cylinder(tmp_path / "b", roof=alone).table
    at = int(np.searchsorted(other.height_m, 1.7 - 1e-9))
    assert rows[1.7]["U_m3"] == pytest.approx(other.U_m3[at], rel=1e-12)
    corrections = {row["density_kg_m3"]: row["correction_m3"] for row in record["roof_corrections"]}
    assert corrections[740.0] == pytest.approx(9000 / 850 - 9000 / 740)
    assert min(corrections) == 740.0  # 0.85 * 850 = 722.5, in steps of 20
    assert max(corrections) == 960.0


@pytest.mark.parametrize(
    ("legs", "expected"),
    [
        ({"high_critical_bottom_m": 1.6}, "high_critical_top_m: missing"),
        ({"high_critical_bottom_m": 1.9, "high_critical_top_m": 1.8}, "expected above"),
        ({"high_critical_bottom_m": 0.9, "high_critical_top_m": 1.8}, "usual position"),
    ],
)
def test_high_legs_that_contradict_the_usual_position(legs, expected, tmp_path):
    with pytest.raises(InputError, match=expected) as refused:
        inside_cylinder(tmp_path, roof=legs)
    assert len(str(refused.value).splitlines()) == 1


@pytest.mark.slow
def test_a_correction_that_is_switched_off_is_shown_and_not_made(tmp_path):
    settings = {
        "bottom.form": "cone",
        "bottom.centre_z_m": -0.15,
        "table.liquid_density_kg_m3": 850.0,
        "survey.shell_temperature_c": 30.0,
    }
    on = result_of(tmp_path / "a", settings=settings, roof={}, paint_mm=0.3)
    codes = ("plate", "paint", "temperature", "head", "bottom", "roof")
    off = settings | {f"corrections.{code}": False for code in codes}
    bare = result_of(tmp_path / "b", settings=off, roof={}, paint_mm=0.3)
    assert bare.table.volume_m3[-1] == pytest.approx(
        bare.gross.volume_m3([bare.gross.height_m])[0], rel=1e-12
    )
    assert [one.code for one in bare.corrections if one.applied] == ["tilt"]
    made = sum(one.size_m3 for one in on.corrections if one.code in codes)
    assert on.table.volume_m3[-1] - bare.table.volume_m3[-1] == pytest.approx(made, rel=1e-9)
    for one, other in zip(on.corrections, bare.corrections, strict=True):
        assert other.size_m3 == pytest.approx(one.size_m3, rel=5e-3, abs=1e-6)


# ---- tilt


@pytest.mark.slow
@pytest.mark.parametrize("slope", [0.03, 1 / 70])
def test_square_sections_times_tilt_factor_give_same_table(tmp_path, slope):
    """Both routes of methods for a leaning shell: cut level, or square to the axis and stretched.

    Second method: points turned upright, one circle a course, areas times sqrt(1 + m^2), course
    heights times cos.
    """
    found = inside_cylinder(tmp_path / "job", tilt=(slope, 0.0), radius=_leaning_cut(slope))
    job, wall = found.job, found.wall
    cos, sin = 1 / np.hypot(1, slope), slope / np.hypot(1, slope)
    square = []
    for section in wall.sections:
        xyz = job.points.xyz_m[wall.accepted[section.group.members]]
        across = np.column_stack([cos * xyz[:, 0] - sin * xyz[:, 2], xyz[:, 1]])
        radius = fit_circle(across, np.full(2 * len(across), 1e-6)).radius_m
        square.append(np.pi * radius**2 * np.hypot(1, slope))
    tops = np.cumsum([0.0] + [course.height_m * cos for course in job.courses])
    assert found.table.height_m[-1] == pytest.approx(tops[-1], abs=5e-4)
    tops[-1] = found.table.height_m[-1]  # a whole millimetre, the shell as wide as below it
    below = np.clip(found.table.height_m[:, None] - tops[:-1], 0, np.diff(tops))
    assert found.table.volume_m3 == pytest.approx(below @ square, rel=1e-6)
    percent = 100 * (1 - cos)
    assert {c.code: c.size_percent for c in found.corrections}["tilt"] == pytest.approx(
        percent, rel=1e-3
    )
    if slope == 1 / 70:
        assert percent == pytest.approx(0.0102, abs=5e-5)  # published


@pytest.mark.slow
def test_without_the_tilt_heights_are_along_the_axis(tmp_path):
    options = {"tilt": (0.03, 0.0), "radius": _leaning_cut(0.03)}
    found = inside_cylinder(tmp_path / "job", {"corrections.tilt": False}, **options)
    assert found.table.height_m[-1] == pytest.approx(HEIGHT, abs=1e-9)
    assert found.table.volume_m3[-1] == pytest.approx(PLAN * HEIGHT, rel=1e-6)
    assert found.at(2.0).value_m3 == pytest.approx(PLAN * 2.0, rel=1e-6)


@pytest.mark.slow
def test_heights_expand_only_on_request(tmp_path):
    warm = {"survey.shell_temperature_c": -80.0 + 40.0, "table.height_expansion": True}
    found = inside_cylinder(tmp_path / "job", warm)
    stretch = 1 + 1.1e-5 * 60
    assert found.table.height_m[-1] == 9.506  # of 9.50627: whole millimetres
    assert found.table.volume_m3[-1] == pytest.approx(PLAN * 9.506 * stretch**2, rel=1e-6)
    assert found.body.highest_m == pytest.approx(HEIGHT * stretch, rel=1e-12)
    assert found.body.volume_m3([found.body.highest_m]) == pytest.approx(
        PLAN * HEIGHT * stretch**3, rel=1e-6
    )


# ---- the table


@pytest.mark.slow
def test_rows_of_a_table_in_feet_and_inches(tmp_path):
    settings = {"table.step_m": None, "table.height_unit": "ft-in-8"}
    found = inside_cylinder(tmp_path / "job", settings)
    steps = found.table.height_m[:-1] / 0.003175
    assert steps == pytest.approx(np.arange(len(steps)), abs=1e-9)


@pytest.mark.slow
def test_the_step_is_chosen_by_the_bound_on_interpolation(tmp_path):
    settings = {"table.step_m": None, "table.max_interpolation_error_l": 1.0, **INSIDE}
    found = result_of(tmp_path / "job", kind="horizontal", settings=settings)
    assert found.straightness.largest_m3 <= 0.001
    assert len(found.table.height_m) < 800  # millimetres only near the ends


def test_a_centimetre_table_of_a_lying_tank_errs_by_three_litres(tmp_path):
    found = result_of(tmp_path / "job", kind="horizontal", settings=INSIDE)
    assert found.straightness.largest_m3 == pytest.approx(0.003, abs=5e-4)  # published: 3 L


@pytest.mark.slow
def test_proportional_parts_go_from_joint_to_joint(tmp_path):
    found = inside_cylinder(tmp_path / "job")
    assert [zone.bottom_m for zone in found.proportional_parts] == pytest.approx(
        np.arange(5) * 1.9, abs=1e-9
    )
    assert found.proportional_parts[0].part_m3[4] == pytest.approx(0.005 * PLAN, rel=1e-6)


@pytest.mark.slow
def test_parts_over_a_cone_keep_to_a_small_part_of_u(tmp_path):
    """Closed form of the cone: no mean of a zone is off by more than U / 20, or half a litre."""
    settings = {
        "bottom.form": "cone",
        "bottom.centre_z_m": -0.25,
        "datum.dip_plate_z_m": -0.25,
    }
    inputs = [("datum", 2, "mm")]
    found = inside_cylinder(tmp_path / "job", settings, uncertainty=inputs)
    zones, U = found.proportional_parts, found.intervals.U_m3
    assert [zone.bottom_m for zone in zones[-5:]] == [0.25, 2.15, 4.05, 5.95, 7.85]
    for zone in zones:
        marks = np.arange(round(1000 * zone.bottom_m), round(1000 * zone.top_m) + 1)
        part = np.insert(zone.part_m3, 0, 0.0)[marks % 10]
        depth = np.array([marks // 10 / 100, marks / 1000])
        rows, exact = PLAN * (
            np.minimum(depth, 0.25) ** 3 / (3 * 0.25**2) + np.maximum(depth - 0.25, 0)
        )
        allowed = np.maximum(0.05 * np.interp(marks / 1000, found.table.height_m, U), 5e-4)
        assert np.all(np.abs(rows + part - exact) <= allowed + 1e-4)


@pytest.mark.slow
def test_a_top_that_leans_is_the_nominal_one(tmp_path):
    """9.5 m that lean by 3 mm/m reach 9.49996 m: 9.5 m to whoever measures it.

    Closed form: the row is that of a shell that goes on as wide; the corrections lead to it.
    """
    found = inside_cylinder(tmp_path / "job", tilt=(0.003, 0.0), radius=lambda theta, z: RADIUS)
    table, cut = found.table, PLAN * np.hypot(1.0, 0.003)
    assert table.height_m[-1] == 9.5
    assert found.straightness.largest_m3 < 1e-6
    assert table.volume_m3[-1] - table.volume_m3[-2] == pytest.approx(0.01 * cut, rel=1e-4)
    record = record_of(found)
    net = record["gross"]["volume_m3"] + sum(
        one["size_m3"] for one in record["corrections"] if one["code"] != "tilt"
    )
    assert net == pytest.approx(table.volume_m3[-1], abs=1e-6)


def test_a_closed_tank_is_full_at_the_last_whole_millimetre(tmp_path):
    """Closed form: the last row of a sphere of 11.9994 m is the whole sphere, at 12 m."""
    settings = INSIDE | {"sphere.diameter_m": 11.9994}
    found = result_of(tmp_path / "job", kind="sphere", settings=settings)
    assert found.table.height_m[-1] == 12.0
    assert found.table.volume_m3[-1] == pytest.approx(np.pi / 6 * 11.9994**3, rel=1e-12)


@pytest.mark.slow
def test_a_nominal_volume_far_off_is_warned_of(tmp_path):
    found = inside_cylinder(tmp_path / "job", {"tank.nominal_volume_m3": 2000.0})
    assert any("differ by 37 %" in warning.expected for warning in found.warnings)


# ---- other kinds


@pytest.mark.slow
def test_a_lying_tank_is_its_solid(tmp_path):
    settings = {
        **INSIDE,
        "horizontal.tilt_mm_per_m": 12.0,
        "horizontal.dip_from_a_m": 2.0,
        "horizontal.end_a": "ellipsoidal",
        "horizontal.end_a_depth_m": 0.5,
    }
    found = result_of(tmp_path / "job", kind="horizontal", settings=settings)
    solid = LyingTank(2.4, 2.4, 10.0, End("ellipsoidal", 0.5), End("flat"), 0.012, 0.0, 2.0)
    assert found.table.volume_m3 == pytest.approx(solid.volume_m3(found.table.height_m), rel=1e-12)
    assert found.wall is None
    assert found.gross is None


def test_plates_are_subtracted_from_lying_tank_and_sphere(tmp_path):
    outside = {"survey.side": "outside"}
    settings = outside | {"horizontal.thickness_mm": 6.0}
    lying = result_of(tmp_path / "a", kind="horizontal", settings=settings)
    assert lying.table.volume_m3[-1] == pytest.approx(np.pi * 1.194**2 * 10, rel=1e-9)
    assert sizes(lying)["plate"] == pytest.approx(np.pi * (1.194**2 - 1.2**2) * 10, rel=1e-9)
    settings = outside | {"sphere.thickness_mm": 20.0}
    ball = result_of(tmp_path / "b", kind="sphere", settings=settings)
    assert ball.table.volume_m3[-1] == pytest.approx(np.pi * 19.96**3 / 6, rel=1e-12)


def test_a_sphere_of_the_published_example(tmp_path):
    found = result_of(tmp_path / "job", kind="sphere", settings=INSIDE)
    assert found.at(5.0).value_m3 == pytest.approx(654.498469, abs=5e-7)  # published
    assert found.table.volume_m3[-1] == pytest.approx(4188.790205, abs=5e-7)


def test_a_solid_expands_in_all_directions(tmp_path):
    settings = {**INSIDE, "survey.shell_temperature_c": 30.0}
    found = result_of(tmp_path / "job", kind="sphere", settings=settings)
    scale = 1 - 1.1e-5 * 10
    assert found.table.height_m[-1] == 19.998  # of 19.9978: whole millimetres
    assert found.table.volume_m3[-1] == pytest.approx(np.pi * (20 * scale) ** 3 / 6, rel=1e-12)


def stl(radius=2.0, height=5.0, scale=1.0, lid=True):
    trimesh = pytest.importorskip("trimesh")
    mesh = trimesh.creation.cylinder(radius=radius, height=height, sections=64)
    mesh.apply_scale(scale)
    if not lid:
        mesh.update_faces(np.arange(len(mesh.faces)) != 0)
    file = io.BytesIO()
    mesh.export(file, file_type="stl")
    return file.getvalue()


@pytest.mark.slow
def test_a_closed_mesh_is_a_tank(tmp_path):
    found = result_of(
        tmp_path / "job", kind="mesh", mesh=stl(scale=1000.0), settings={"mesh.unit": "mm"}
    )
    prism = 64 / 2 * np.sin(2 * np.pi / 64) * 4.0  # closed form: area of the 64-gon
    expected = prism * found.table.height_m
    assert found.table.volume_m3 == pytest.approx(expected, rel=1e-6)


def test_a_mesh_with_a_hole_is_refused(tmp_path):
    with pytest.raises(InputError, match=r"tank.stl: the mesh has 3 open edges"):
        result_of(tmp_path / "job", kind="mesh", mesh=stl(lid=False))


def test_undeclared_inputs_of_solid_are_named(tmp_path):
    found = result_of(
        tmp_path / "job", kind="horizontal", settings=INSIDE, uncertainty=[("diameter", 2.0, "mm")]
    )
    undeclared = found.body.undeclared()
    assert "length" in undeclared
    assert "scale" not in undeclared  # declared dimensions have no survey with a scale
    assert "diameter" not in undeclared
    assert "plate_thickness" not in undeclared  # surveyed inside


def scanned_points(diameter, tilt, rng, sd=0.002, clutter=20):
    """Points on a lying cylinder whose axis runs east, and clutter above it."""
    turn, along = rng.uniform(0, 2 * np.pi, 400), rng.uniform(0.5, 9.5, 400)
    slope = np.arctan(tilt)
    r = diameter / 2 + rng.normal(0, sd, 400)
    up, x = r * np.cos(turn), along
    xyz = np.column_stack(
        [
            x * np.cos(slope) - up * np.sin(slope),
            r * np.sin(turn),
            x * np.sin(slope) + up * np.cos(slope),
        ]
    )
    pipe = np.column_stack([rng.uniform(0, 10, clutter), np.zeros(clutter), np.full(clutter, 1.5)])
    return [(f"P{i}", *map(float, row)) for i, row in enumerate(np.vstack([xyz, pipe]))]


SCANNED = {
    **INSIDE,
    "horizontal.diameter_m": None,
    "horizontal.azimuth_deg": 90.0,
    "horizontal.dip_from_a_m": 1.0,
}


@pytest.mark.parametrize("count", [80, 700])
def test_a_second_wall_of_half_as_many_points_is_refused(tmp_path, count):
    """A third of all points 0.12 m within the shell, as many as go to means of neighbours, too."""
    rng = np.random.default_rng(5)
    turn, along = rng.uniform(0, 2 * np.pi, count), rng.uniform(0, 10, count)
    radius = 1.2 * np.where(np.arange(count) < count / 3, 0.9, 1.0) + rng.normal(0, 1e-3, count)
    xyz = np.column_stack([along, radius * np.sin(turn), radius * np.cos(turn)])
    points = [(f"P{i}", *map(float, row)) for i, row in enumerate(xyz)]
    job = write_job(tmp_path / "job", kind="horizontal", settings=SCANNED, extra_points=points)
    with pytest.raises(InputError, match="the points scatter by"):
        run(tankcal.load(job))


@pytest.mark.slow
def test_a_scan_gives_diameter_and_tilt_of_a_lying_tank(tmp_path):
    points = scanned_points(2.4, 0.01, np.random.default_rng(3))
    found = result_of(tmp_path / "job", kind="horizontal", settings=SCANNED, extra_points=points)
    solid = found.body.parts[0].solid
    sds = np.linalg.norm(found.scan.factors[0].columns, axis=1)
    assert abs(solid.width_m - 2.4) < 3 * sds[0]
    assert abs(solid.tilt - 0.01) < 3 * sds[1]
    # theory: the mean of 400 radii of 2 mm, twice; allowing for an uneven spread
    assert sds[0] == pytest.approx(2 * 0.002 / np.sqrt(400), rel=0.15)
    assert len(found.scan.accepted) >= 395
    assert set(range(400, 420)).isdisjoint(found.scan.accepted)  # the pipe
    kinds = [source.kind for source in found.table.sources]
    assert kinds[0] == "points"
    assert {"diameter", "tilt"}.isdisjoint(found.body.undeclared())


@pytest.mark.slow
def test_the_intervals_of_a_scanned_lying_tank_hold_the_truth(tmp_path, figure):
    """15 scans: at least 10 intervals of 95 % hold it (binomial, 6e-5 to be below)."""
    truth = np.pi * 1.2**2 * 10
    rng = np.random.default_rng(8)
    job = None
    inside = 0
    for _ in range(15):
        rows = scanned_points(2.4, 0.0, rng, clutter=0)
        if job is None:
            job = tankcal.load(
                write_job(tmp_path / "job", kind="horizontal", settings=SCANNED, extra_points=rows)
            )
        xyz = np.array([row[1:] for row in rows])
        found = run(replace(job, points=replace(job.points, xyz_m=xyz)))
        top = found.at(found.table.height_m[-1])
        inside += abs(top.value_m3 - truth) < top.U_m3
    figure("95 % intervals of 15 scanned lying tanks that hold the truth", inside)
    assert inside >= 10


@pytest.mark.slow
def test_ullage_volume_to_dip_and_the_shell_in_service(tmp_path):
    found = inside_cylinder(tmp_path / "job", {"datum.reference_height_m": 10.0}, sd_mm=2.0)
    assert found.at_ullage(3.0).value_m3 == found.at(7.0).value_m3
    dips = found.dip_of(found.at(4.321).value_m3)
    assert dips.height_m[0] == pytest.approx(4.321, abs=1e-9)
    assert dips.u_m[0] == pytest.approx(found.at(4.321).u_m3 / PLAN, rel=1e-4)
    warm = found.in_service_m3(5.0, 60.0, 20.0)  # shell at 55 degC, table at 20
    assert warm / found.at(5.0).value_m3 == pytest.approx((1 + 1.1e-5 * 35) ** 2, rel=1e-12)
    with pytest.raises(HeightError, match="no ullage; expected"):
        inside_cylinder(tmp_path / "b").at_ullage(1.0)


def test_a_tilted_elliptical_tank_is_the_published_one(tmp_path):
    """Published: volumes in litres of 1.78 x 1.20 x 2.45 m, 4.1 deg, dip square to the axis."""
    settings = {
        **INSIDE,
        "horizontal.diameter_m": None,
        "horizontal.width_m": 1.78,
        "horizontal.height_m": 1.20,
        "horizontal.length_m": 2.45,
        "horizontal.tilt_mm_per_m": float(1000 * np.tan(np.radians(4.1))),
        "horizontal.dip_from_a_m": 0.40,
        "horizontal.dip_direction": "square",
    }
    found = result_of(tmp_path / "job", kind="horizontal", settings=settings)
    litres = [1000 * found.at(dip).value_m3 for dip in (0.0, 0.5, 1.2)]
    assert litres == pytest.approx([1.6744, 1371.8812, 4012.7449], abs=1e-4)
    assert 1000 * found.body.parts[0].solid.capacity_m3 == pytest.approx(4110.1457, abs=1e-4)


def test_deadwood_and_a_dip_plate_in_a_lying_tank(tmp_path):
    bare = result_of(tmp_path / "a", kind="horizontal", settings=INSIDE)
    found = result_of(
        tmp_path / "b",
        kind="horizontal",
        settings={**INSIDE, "datum.dip_plate_z_m": 0.1},
        deadwood=[("baffle", 0.5, 1.5, -0.2)],
    )
    assert found.table.height_m[-1] == pytest.approx(2.3)
    assert found.table.volume_m3[0] == pytest.approx(bare.at(0.1).value_m3, rel=1e-12)  # the heel
    assert found.at(1.0).value_m3 == pytest.approx(bare.at(1.1).value_m3 - 0.1, rel=1e-12)
    assert sizes(found) == {"deadwood": pytest.approx(-0.2)}


# ---- no table falls


@pytest.mark.slow
def test_no_table_that_falls_leaves_the_house(tmp_path):
    """A slab of 4.1 m3 where 3 cm of the tank hold 3.98 m3, between two rows."""
    deadwood = [("pipe", 1.0, 1.0, 0.02), ("slab", 0.5, 0.53, -4.1)]
    with pytest.raises(InputError, match="falls from") as caught:
        inside_cylinder(tmp_path / "job", {"table.step_m": 0.5}, deadwood=deadwood)
    (problem,) = caught.value.problems
    assert (problem.file, problem.column) == ("deadwood.csv", "volume_m3")
    assert "deadwood slab" in problem.expected


@pytest.mark.slow
def test_no_table_of_another_density_falls(tmp_path):
    """A roof that the table's liquid carries and a lighter one does not."""
    settings = {"table.step_m": 0.1, "table.other_densities_kg_m3": [500.0]}
    roof = {"mass_kg": 8000.0, "critical_bottom_m": 1.0, "critical_top_m": 1.1}
    with pytest.raises(InputError, match="floating roof"):
        inside_cylinder(tmp_path / "job", settings, roof=roof)
