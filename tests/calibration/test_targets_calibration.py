"""A target field photographed, read and adjusted: the camera comes back to its standard deviation.

Truth: simulation. The photos are rendered through tankcal's camera model, lens distortion and all.
"""

import numpy as np
import pytest
from rendering import Pattern, code_value, eight_bit, rendered

import tankcal
from tankcal.calibration.targets import TargetSettings, read_photographs
from tankcal.camera.model import Form, correct_image_points, distort_image_points
from tankcal.geometry.rotations import rotation_of_view

cv2 = pytest.importorskip("cv2", reason="no OpenCV here: pip install 'tankcal[images]'")
from tankcal.calibration.targets.results import load_dictionary  # noqa: E402

SIZE, PIXEL_MM, SIDE_M = np.array([1000, 800]), 0.005, 0.3
INTERIOR = np.array([5.02, 0.03, -0.02, -2.5e-3, 4e-5, 0, 0, 2e-4, -1e-4, 0, 0, 0, 0])
FORM = Form()
SQUARE = np.array([[0, 0], [1, 0], [1, 1], [0, 1]])


def field():
    """[(corner top left (3,), right (3,), down (3,))] of nine targets on folded walls, m."""
    targets = []
    for row, z in enumerate((0.4, 1.2, 2.0)):
        for column, x in enumerate((-1.0, 0.05, 1.1)):
            turn = np.radians((-30, 10, 35)[column])
            right = SIDE_M * np.array([np.cos(turn), np.sin(turn), 0])
            lean = 0.2 * (row - 1)
            away = np.array([-np.sin(turn), np.cos(turn), 0])
            down = SIDE_M * (lean * away - np.sqrt(1 - lean**2) * np.array([0, 0, 1]))
            middle = np.array([x, 0.5 * abs(x) + 0.15 * row, z])
            targets.append((middle - (right + down) / 2, right, down))
    return targets


def stations():
    """Places (n, 3) and rotations (n, 3, 3) of the photos."""
    across = np.array([-2.0, 0.0, 2.0, -1.6, 1.8, 0.2])
    places = np.column_stack([across, np.full(6, -3.4), [1.2, 0.3, 1.4, 2.3, 0.4, 2.2]])
    aim = np.array([0, 0.5, 1.2]) - places
    tilt = np.arctan2(aim[:, 2], np.hypot(aim[:, 0], aim[:, 1]))
    roll = np.radians([0, 90, 5, -90, 180, 92])
    return places, rotation_of_view(np.arctan2(aim[:, 0], aim[:, 1]), tilt, roll)


def pixels_of(xyz, place, rotation):
    """Pixels (n, 2) of points (n, 3)."""
    u, v, w = rotation @ (xyz - place).T
    xy = distort_image_points(INTERIOR[0] * np.column_stack([-u / w, -v / w]), INTERIOR, FORM)
    return xy / PIXEL_MM * [1, -1] + (SIZE - 1) / 2


def seen(target, number, place, rotation):
    """Pattern of one target in one photo."""
    origin, right, down = target
    normal = np.cross(right, down)
    corners = pixels_of(origin + SQUARE @ np.array([right, down]), place, rotation)

    def plane_of(pixels):
        ideal = correct_image_points((pixels - (SIZE - 1) / 2) * PIXEL_MM * [1, -1], INTERIOR, FORM)
        ray = np.column_stack([ideal, np.full(len(ideal), -INTERIOR[0])]) @ rotation
        on_plane = place + ray * (((origin - place) @ normal) / (ray @ normal))[:, None] - origin
        return np.column_stack([on_plane @ right, on_plane @ down]) / SIDE_M**2

    (c0, l0), (c1, l1) = corners.min(axis=0) - 18, corners.max(axis=0) + 18
    cells = load_dictionary("DICT_5X5_50").cells[number]
    return Pattern(plane_of, code_value(cells), (c0, c1, l0, l1)), corners


def write_survey(folder, names):
    """A job of the photos, whose control are the corners of the first and the last target."""
    (folder / "job.toml").write_text(
        '[adjustment]\ndatum = "control"\nsnooping = false\n'
        '[adjustment.camera]\nK3 = "off"\nb1 = "off"\nb2 = "off"\n'
    )
    (folder / "cameras.toml").write_text(
        "[cameras.K]\nformat_px = [1000, 800]\npixel_um = 5.0\nc_mm = 5.0\n"
        'convention = "distortion_of_ideal"\n'
    )
    (folder / "photos.csv").write_text("photo,camera\n" + "".join(f"{n},K\n" for n in names))
    rows = ["point,x_m,y_m,z_m,sx_mm,sy_mm,sz_mm"]
    for number in (0, 2, 4, 6, 8):
        origin, right, down = field()[number]
        for k, xyz in enumerate(origin + SQUARE @ np.array([right, down]), 1):
            rows.append(f"T{number}-{k}," + ",".join(f"{x:.6f}" for x in xyz) + ",0.05,0.05,0.05")
    (folder / "control.csv").write_text("\n".join(rows) + "\n")


@pytest.mark.slow
@pytest.mark.parametrize(
    ("photos", "oversampling"), [(4, 4), pytest.param(6, 4, marks=pytest.mark.study)]
)
def test_a_rendered_calibration(tmp_path, photos, oversampling, figure):
    """Truth: c, x0, y0, K1, K2, P1, P2 that the photos were rendered with."""
    folder = tmp_path / "job"
    folder.mkdir()
    names, paths, truth = [], [], {}
    for number, (place, rotation) in enumerate(list(zip(*stations(), strict=True))[:photos]):
        views = [seen(target, k, place, rotation) for k, target in enumerate(field())]
        image = rendered(SIZE, [p for p, _ in views], 0.9, 2.0, number, oversampling=oversampling)
        names.append(f"photo{number}")
        paths.append(tmp_path / f"photo{number}.png")
        cv2.imwrite(str(paths[-1]), eight_bit(image))
        for k, (_, corners) in enumerate(views):
            truth |= {(names[-1], f"T{k}-{i + 1}"): corners[i] for i in range(4)}
    listed = tmp_path / "names.csv"
    listed.write_text("id,point\n" + "".join(f"{k},T{k}\n" for k in range(9)))
    reading = read_photographs(
        paths, folder / "image_points.csv", TargetSettings(dictionary="DICT_5X5_50", names=listed)
    )
    errors = np.array(
        [p.place_px - truth[photo.photo, p.point] for photo in reading.photos for p in photo.points]
    )
    assert reading.targets > 8 * photos
    assert np.sqrt(np.mean(errors**2)) < 0.03
    figure("rendered calibration: corners, rms px", f"{np.sqrt(np.mean(errors**2)):.3f}")
    write_survey(folder, names)
    adjustment = tankcal.adjust_job(tankcal.load(folder, only="adjustment"))
    values, adjusted, covariance = adjustment.adjusted.camera(0)
    sd = np.sqrt(np.diag(covariance))
    true = dict(zip(tankcal.camera.model.PARAMETERS, INTERIOR, strict=True))
    off = {name: (values[name] - true[name]) / s for name, s in zip(adjusted, sd, strict=True)}
    assert set(off) == {"c", "x0", "y0", "K1", "K2", "P1", "P2"}
    assert max(abs(value) for value in off.values()) < 4
    assert sd[adjusted.index("c")] < 0.005
    figure("rendered calibration: c minus truth, mm", f"{values['c'] - true['c']:.5f}")
    figure("rendered calibration: sd of c, mm", f"{sd[adjusted.index('c')]:.5f}")
    test = adjustment.adjusted.test()
    figure(
        "rendered calibration: variance factor",
        f"{adjustment.adjusted.chi2 / adjustment.adjusted.dof:.2f}",
    )
    assert test is not None
