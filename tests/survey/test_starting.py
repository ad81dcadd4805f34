"""Approximate values: from nothing but image points and a few known points, blunders included."""

from dataclasses import replace

import numpy as np
import pytest
from networks import photographed

from tankcal.errors import SolutionError
from tankcal.survey.network import adjust
from tankcal.survey.start.photographs import bearings, image_errors, three_point_poses
from tankcal.survey.start_values import approximate, nominal_places


def unknown_photos(survey):
    """The survey without any exterior orientation."""
    photos = survey.photos
    nothing = replace(
        photos,
        xyz_m=np.full_like(photos.xyz_m, np.nan),
        rotation=np.full_like(photos.rotation, np.nan),
    )
    return replace(survey, photos=nothing)


def test_three_points_give_the_true_pose_among_at_most_four():
    """Property: of the poses that fit three points one is the true one; all of them fit."""
    survey, truth = photographed(noise=0.0)
    rng = np.random.default_rng(1)
    for photo in range(len(truth.rotation)):
        seen = survey.image_points.point[survey.image_points.photo == photo]
        three = truth.xyz_m[rng.choice(seen, 3, replace=False)]
        p = (three - truth.photo_xyz_m[photo]) @ truth.rotation[photo].T
        ideal = -p[:, :2] / p[:, 2:]
        centres, rotations = three_point_poses(three[None], bearings(ideal)[None])
        assert 1 <= len(centres) <= 4
        assert image_errors(three, ideal, centres, rotations).max() < 1e-6
        away = np.linalg.norm(centres - truth.photo_xyz_m[photo], axis=1)
        assert away.min() < 1e-4
        assert rotations[away.argmin()] == pytest.approx(truth.rotation[photo], abs=1e-5)


@pytest.mark.slow
@pytest.mark.parametrize("blunders", [0, 0.1])
def test_nominal_geometry_alone_leads_to_the_same_answer(blunders):
    """Property: same adjusted points as from good start values, with 10 % of wild image points."""
    survey, _ = photographed()
    wild = survey.image_points
    n, rng = len(wild.point), np.random.default_rng(2)
    bad = rng.choice(n, int(blunders * n), replace=False)
    xy = wild.value.copy()
    xy[bad] += rng.uniform(-20, 20, (len(bad), 2))
    nominal = nominal_places(
        np.tile(np.arange(12), 4) + 1, 12, np.repeat(np.linspace(0.3, 9, 4), 12), 6.5
    )
    start = replace(unknown_photos(survey), xyz_m=nominal, image_points=replace(wild, value=xy))
    found = approximate(start)
    assert np.abs(found.photos.xyz_m - survey.photos.xyz_m).max() < 1.0
    adjusted = adjust(replace(found, image_points=wild))
    assert adjusted.xyz_m == pytest.approx(adjust(survey).xyz_m, abs=1e-7)


@pytest.mark.slow
def test_control_alone_carries_from_photo_to_photo():
    """Points without any coordinates come from photos, photos without control from points."""
    survey, truth = photographed(seed=1, photos=16)
    known = np.full_like(truth.xyz_m, np.nan)
    some = [0, 1, 2, 13, 14, 24, 26, 37, 38, 3]
    known[some] = truth.xyz_m[some]
    found = approximate(replace(unknown_photos(survey), xyz_m=known))
    assert np.abs(found.xyz_m - truth.xyz_m).max() < 0.5
    assert adjust(found).xyz_m == pytest.approx(adjust(survey).xyz_m, abs=1e-7)


@pytest.mark.slow
def test_photo_of_three_known_points_is_resolved_by_ties():
    survey, truth = photographed(seed=2)
    known = np.full_like(truth.xyz_m, np.nan)
    images = survey.image_points
    seen = [set(images.point[images.photo == photo]) for photo in range(3)]
    only = sorted(seen[1] - seen[0])
    kept = sorted(seen[0] - seen[1]) + sorted(seen[0] & seen[1])[:1] + only[:2]
    known[kept] = truth.xyz_m[kept]
    two = np.isin(images.photo, [0, 1])
    use = two & np.isin(images.point, kept + sorted(seen[0] & seen[1]))
    photos = survey.photos
    start = replace(
        survey,
        xyz_m=known,
        photos=replace(
            photos,
            xyz_m=np.where(np.arange(8)[:, None] < 2, np.nan, photos.xyz_m),
            rotation=photos.rotation,
        ),
        image_points=replace(images, use=use.astype(float)),
    )
    found = approximate(start)
    assert np.abs(found.photos.xyz_m[1] - truth.photo_xyz_m[1]).max() < 0.3


def test_from_a_metre_and_twenty_degrees():
    """Property: the adjustment itself comes back from start values as bad as that."""
    from tankcal.geometry.rotations import apply_small_rotation

    survey, _ = photographed()
    rng = np.random.default_rng(4)
    photos, n = survey.photos, len(survey.photos.names)
    axis = rng.normal(size=(n, 3))
    axis /= np.linalg.norm(axis, axis=1, keepdims=True)
    bad = replace(
        photos,
        xyz_m=photos.xyz_m + rng.uniform(-1, 1, (n, 3)),
        rotation=apply_small_rotation(photos.rotation, np.deg2rad(20) * axis),
    )
    found = adjust(replace(survey, photos=bad))
    assert found.xyz_m == pytest.approx(adjust(survey).xyz_m, abs=1e-7)


def test_points_without_start_values_are_named():
    survey, truth = photographed()
    known = np.full_like(truth.xyz_m, np.nan)
    known[:2] = truth.xyz_m[:2]
    images = survey.image_points
    alone = replace(images, use=(images.photo == 0) * 1.0)
    start = replace(unknown_photos(survey), xyz_m=known, image_points=alone, observations=())
    with pytest.raises(SolutionError, match=r"no approximate values for photo S0 \(. known poi"):
        approximate(start)
