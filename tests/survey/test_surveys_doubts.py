"""Mistakes that only the adjustment can tell: each one made on purpose, and named."""

from dataclasses import replace

import numpy as np
import pytest
from surveyed import by_instruments, by_photographs, changed, told

from tankcal.geometry.rotations import rotation_of_angles
from tankcal.survey import adjust_survey
from tankcal.survey.diagnosis.diagnoses import normalize_name
from tankcal.survey.measurements import AdjustmentSettings
from tankcal.survey.start.pieces import similarity
from tankcal.survey.start_values import plan_fit


@pytest.fixture(scope="module")
def photos():
    return by_photographs()[0]


@pytest.fixture(scope="module")
def stations():
    return by_instruments()[0]


@pytest.mark.slow
@pytest.mark.parametrize("make", [by_photographs, by_instruments])
@pytest.mark.parametrize("seed", [1, 2])
def test_a_sound_survey_is_not_doubted(make, seed):
    """Nothing is said of a survey without mistakes (the global test fails in 5 of 100)."""
    text = told(make(seed)[0])
    assert text == "" or text.startswith("job.toml, adjustment: the global test fails")


@pytest.mark.slow
@pytest.mark.parametrize("sd", [0.002, pytest.param(0.0, marks=pytest.mark.study)])
def test_swapped_x_and_y_of_a_control_point(photos, sd):
    xyz = photos.control.xyz_m.copy()
    xyz[2] = xyz[2, [1, 0, 2]]
    control = replace(photos.control, xyz_m=xyz, sd_m=np.full_like(xyz, sd))
    text = told(replace(photos, control=control))
    assert f"control.csv, row 4, x_m: point {photos.control.point[2]} lies" in text
    assert "x and y seem to be swapped" in text


@pytest.mark.slow
def test_distances_in_other_units(photos):
    value = photos.readings[0].value * [1, 1, 1, 1000, 1, 1 / 0.3048, 0.1, 1]
    text = told(changed(photos, "distances", value=value))
    for row, ids, what in (
        (5, "P3-P39", "millimetres given as metres"),
        (7, "P5-P41", "feet given as metres"),
        (8, "P6-P42", "a misplaced decimal point"),
    ):
        line = next(one for one in text.splitlines() if f"row {row}: distance {ids} is" in one)
        assert line.startswith("distances.csv, ")
        assert line.endswith(f"was expected: it looks like {what}")


@pytest.mark.slow
def test_gon_read_as_degrees_from_one_station(stations):
    table = stations.readings[0]
    mine = np.array([name == "set-up 1" for name in table.setup])
    value = np.where(mine, table.value / 0.9, table.value)
    text = told(changed(stations, "directions", value=value))
    assert "the angles from set-up 1 fit if they are gon read as degrees" in text


@pytest.mark.slow
@pytest.mark.parametrize("how", ["swapped", "x turned", "y turned"])
def test_a_mirrored_photo(photos, how):
    images = photos.image_points
    mine = np.array([name == "S2" for name in images.photo])[:, None]
    other = {
        "swapped": images.xy_mm[:, ::-1],
        "x turned": images.xy_mm * [-1, 1],
        "y turned": images.xy_mm * [1, -1],
    }[how]
    text = told(
        replace(photos, image_points=replace(images, xy_mm=np.where(mine, other, images.xy_mm)))
    )
    assert "image_points.csv: photo S2: its image points fit if the image is mirrored" in text


@pytest.mark.slow
def test_a_photo_upside_down_is_a_photo_like_any_other(photos):
    """Property: turned by half a turn it is only another kappa; the answer is the same."""
    images = photos.image_points
    mine = np.array([name == "S2" for name in images.photo])[:, None]
    turned = replace(images, xy_mm=np.where(mine, -images.xy_mm, images.xy_mm))
    camera = photos.cameras[0]
    plain = replace(camera, camera=replace(camera.camera, scope=("block",) + ("off",) * 12))
    one = adjust_survey(replace(photos, image_points=turned, cameras=(plain,)))
    two = adjust_survey(replace(photos, cameras=(plain,)))
    assert one.sigma0 == pytest.approx(two.sigma0, rel=1e-6)
    assert one.xyz_m == pytest.approx(two.xyz_m, abs=1e-7)


@pytest.mark.slow
def test_one_point_under_two_names(photos):
    """A point of four rays, two of them under another name: two points at the same place."""
    measurements, _ = by_photographs(photos=16)
    images = measurements.image_points
    mine = [i for i, name in enumerate(images.point) if name == "P26"]
    names = list(images.point)
    for i in mine[1::2]:
        names[i] = "X26"
    text = told(replace(measurements, image_points=replace(images, point=tuple(names))))
    assert "one point under two names?" in text
    assert "P26" in text
    assert "X26" in text


@pytest.mark.slow
def test_a_name_spelt_in_another_way(photos):
    images = photos.image_points
    first = images.point.index("P26")
    names = list(images.point)
    names[first] = "p-26"
    text = told(replace(photos, image_points=replace(images, point=tuple(names))))
    row = images.rows[first]
    assert f"image_points.csv, row {row}: point p-26 has only one ray" in text
    assert "image_points.csv: point p-26 could not be adjusted: is it P26?" in text
    assert normalize_name("P-007") == normalize_name("p7") == "p7"
    assert normalize_name("lO1") == normalize_name("101")
    assert normalize_name("70") != normalize_name("7")


@pytest.mark.slow
def test_a_failed_global_test_names_the_group(photos):
    images = photos.image_points
    kept = replace(photos, settings=AdjustmentSettings(snooping=False))
    text = told(replace(kept, image_points=replace(images, sd_mm=images.sd_mm / 5)))
    assert "the global test fails: sigma0 = " in text
    assert "standard deviations declared too small: image coordinate camera (" in text
    text = told(replace(photos, image_points=replace(images, sd_mm=images.sd_mm * 5)))
    assert "declared too large: image coordinate camera (0.24 times)" in text


def test_frames_are_brought_together():
    """Property: a turned, shifted, and a mirrored copy come back."""
    rng = np.random.default_rng(0)
    xyz = rng.uniform(-5, 5, (6, 3))
    turn = rotation_of_angles(0, 0, 0.7)
    moved, worst = plan_fit(xyz, xyz[:3], xyz[:3] @ turn.T + [10, 20, 3])
    assert worst < 1e-12
    assert moved == pytest.approx(xyz @ turn.T + [10, 20, 3])
    mirrored, worst = plan_fit(xyz, xyz[:4], (xyz[:4] * [-1, 1, 1]) @ turn.T)
    assert worst < 1e-12
    assert mirrored == pytest.approx((xyz * [-1, 1, 1]) @ turn.T)
    motion = similarity(xyz, 2 * xyz @ rotation_of_angles(0.3, 1, 2).T + 5)
    assert motion.rotation == pytest.approx(rotation_of_angles(0.3, 1, 2))
    assert motion.scale == pytest.approx(2)
