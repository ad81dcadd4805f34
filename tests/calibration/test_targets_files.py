"""Photographs in, image_points.csv out: names, files that cannot be read, all or nothing."""

import csv
import struct
import sys

import numpy as np
import pytest
from rendering import disc_value, eight_bit, flat, rendered, tilted_square
from test_targets import ARUCO, DISC, one_scene

from tankcal.calibration.targets import TargetSettings, read_coded, read_photographs
from tankcal.errors import InputError

cv2 = pytest.importorskip("cv2", reason="no OpenCV here: pip install 'tankcal[images]'")

WANTED = TargetSettings(dictionary=ARUCO)


def rows_of(path):
    with open(path, newline="", encoding="utf-8") as stream:
        return list(csv.DictReader(stream))


@pytest.fixture
def photos(tmp_path):
    """Two photos with the targets 7 and 9."""
    image = np.hstack([one_scene(7), one_scene(9)])
    paths = [tmp_path / "left.png", tmp_path / "right.png"]
    for path in paths:
        cv2.imwrite(str(path), image)
    return paths


def told(paths, out, wanted=None, **more):
    with pytest.raises(InputError) as raised:
        read_photographs(paths, out, wanted, **more)
    return [str(problem) for problem in raised.value.problems]


@pytest.mark.slow
def test_corners_get_their_names(photos, tmp_path):
    names = tmp_path / "names.csv"
    names.write_text("id,point\n7,T7\n9,tank 9\n12,T12\n")
    steps = []
    out = tmp_path / "image_points.csv"
    reading = read_photographs(
        photos,
        out,
        TargetSettings(names=names, dictionary=ARUCO),
        progress=lambda *a: steps.append(a),
    )
    rows = rows_of(out)
    assert [row["point"] for row in rows[:8]] == [
        *("T7-1", "T7-2", "T7-3", "T7-4", "tank 9-1", "tank 9-2", "tank 9-3", "tank 9-4")
    ]
    assert [row["photo"] for row in rows] == ["left"] * 8 + ["right"] * 8
    (marker, _) = read_coded(cv2.imread(str(photos[0]), 0)).targets
    written = [[float(row["column_px"]), float(row["line_px"])] for row in rows[:4]]
    assert np.abs(np.array(written) - marker.corners_px).max() < 1e-4
    assert [float(row["s_px"]) for row in rows[:4]] == pytest.approx(marker.sd_px, abs=1e-4)
    assert steps == [("left", 0, 2), ("right", 1, 2), ("done", 2, 2)]
    assert (reading.targets, reading.points, reading.refused) == (4, 16, {})
    assert any("listed, but found in no photo: 1: 'T12'" in str(one) for one in reading.warnings)
    assert rows_of(reading.refused_path) == []


@pytest.mark.slow
def test_centres_have_the_plain_name(photos, tmp_path):
    reading = read_photographs(
        photos[:1], tmp_path / "o.csv", TargetSettings(what="centres", dictionary=ARUCO)
    )
    assert [row["point"] for row in rows_of(reading.path)] == ["7", "9"]
    assert any("give the list of the ids" in str(one) for one in reading.warnings)


@pytest.mark.slow
def test_refused_targets_are_listed(photos, tmp_path):
    names = tmp_path / "names.csv"
    names.write_text("id,point\n9,T9\n")
    reading = read_photographs(
        photos[:1], tmp_path / "o.csv", TargetSettings(names=names, dictionary=ARUCO)
    )
    (row,) = rows_of(reading.refused_path)
    assert (row["photo"], row["code"], row["id"]) == ("left", "not_listed", "7")
    assert reading.refused == {"not_listed": 1}


@pytest.mark.slow
def test_existing_file_is_not_overwritten(photos, tmp_path):
    out = tmp_path / "image_points.csv"
    out.write_text("mine")
    assert told(photos, out) == [
        "image_points.csv: already exists; expected another name, or the choice to replace it"
    ]
    assert out.read_text() == "mine"
    assert read_photographs(photos, out, WANTED, replace=True).points == 16


def test_all_bad_files_are_reported_in_one_run(photos, tmp_path):
    bad = {
        "empty.png": b"",
        "text.jpg": b"this is no picture, whatever its name says",
        "cut.png": photos[0].read_bytes()[:2000],
        "bomb.png": b"\x89PNG\r\n\x1a\n\0\0\0\rIHDR" + struct.pack(">II", 60000, 60000) + bytes(20),
        "=cmd.png": photos[0].read_bytes(),
        "left.bmp": photos[0].read_bytes(),
    }
    for name, data in bad.items():
        (tmp_path / name).write_bytes(data)
    out = tmp_path / "o.csv"
    paths = [*photos, *(tmp_path / name for name in bad), tmp_path / "absent.jpg"]
    lines = told(paths, out)
    assert {line.partition(":")[0] for line in lines} == {*bad, "absent.jpg"}
    assert not out.exists()
    assert any(line.startswith("bomb.png: 60000 x 60000 pixels") for line in lines)


def test_names_are_checked(photos, tmp_path):
    names = tmp_path / "names.csv"
    names.write_text("id,point\n7,=1+1\n9,T9\n9,T10\n3,T9\n99,T99\n1.5,T1\nx,T2\n")
    lines = told(photos, tmp_path / "o.csv", TargetSettings(names=names, dictionary=ARUCO))
    assert [line.partition(", ")[2].partition(":")[0] for line in lines] == [
        *("id", "row 2, point", "row 4, id", "row 5, point", "row 7, id", "row 8, id")
    ]


def test_settings_are_checked(photos, tmp_path):
    lines = told(
        photos, tmp_path / "o.csv", TargetSettings(what="squares", encoding="jpeg", reach_px=-1.0)
    )
    assert [line.partition(":")[0] for line in lines] == ["what", "encoding", "reach_px"]
    (line,) = told(photos, tmp_path / "o.csv", TargetSettings(dictionary="4X4_51"))
    assert "expected one of DICT_4X4_100" in line


def test_orientation_is_reported_and_not_applied(tmp_path):
    """Truth: the same pixels without the tag."""
    image = np.hstack([one_scene(7), one_scene(9)])
    _, plain = cv2.imencode(".jpg", image, [cv2.IMWRITE_JPEG_QUALITY, 100])
    plain = plain.tobytes()
    tags = struct.pack("<2sHIHHHIHHI", b"II", 42, 8, 1, 274, 3, 1, 6, 0, 0)
    exif = b"Exif\0\0" + tags
    turned = plain[:2] + b"\xff\xe1" + struct.pack(">H", len(exif) + 2) + exif + plain[2:]
    for name, data in (("a.jpg", plain), ("b.jpg", turned)):
        (tmp_path / name).write_bytes(data)
    reading = read_photographs([tmp_path / "a.jpg", tmp_path / "b.jpg"], tmp_path / "o.csv")
    first, second = reading.photos
    assert second.orientation == 6
    assert first.size_px == second.size_px == (400, 200)
    for one, other in zip(first.points, second.points, strict=True):
        assert one.place_px == pytest.approx(other.place_px)
    assert any("orientation 6" in str(one) for one in reading.warnings)


@pytest.mark.slow
def test_sixteen_bits_and_sizes(photos, tmp_path):
    """Second method: the same photo in eight bits."""
    image = cv2.imread(str(photos[0]), 0)
    deep = tmp_path / "deep.tif"
    cv2.imwrite(str(deep), image[:, :390].astype(np.uint16) * 16)
    reading = read_photographs([photos[0], deep], tmp_path / "o.csv", WANTED)
    one, other = (np.array([p.place_px for p in photo.points]) for photo in reading.photos)
    assert np.abs(one - other).max() < 0.01
    assert any("of several sizes" in str(one) for one in reading.warnings)


@pytest.fixture
def circles(tmp_path):
    """A photo of three circles, and where they are."""
    middles = np.array([[60.2, 50.7], [160.4, 90.1], [90.9, 150.3]])
    squares = [tilted_square(middle, 18, 20, 0, 40, distance=200) for middle in middles]
    patterns = [flat(disc_value(), square, DISC, reach=0.6) for square in squares]
    path = tmp_path / "discs.png"
    cv2.imwrite(str(path), eight_bit(rendered((220, 200), patterns, 1.0, 2.0)))
    return path, middles


@pytest.mark.slow
def test_circles_are_named_by_their_places(circles, tmp_path):
    path, middles = circles
    places = tmp_path / "places.csv"
    places.write_text("photo,point,column_px,line_px\ndiscs,A,63,48\ndiscs,B,160,90\ndiscs,X,9,9\n")
    out = tmp_path / "o.csv"
    reading = read_photographs([path], out, TargetSettings(what="circles", places=places))
    assert [row["point"] for row in rows_of(out)] == ["A", "B"]
    found = np.array([point.place_px for point in reading.photos[0].points])
    assert np.abs(found - middles[:2]).max() < 0.1
    assert reading.refused["unnamed"] == 1
    assert any("no circle within 15 px of 1 places: 'X'" in str(one) for one in reading.warnings)


@pytest.mark.slow
def test_places_in_photos_that_are_not_given_are_reported(circles, tmp_path):
    places = tmp_path / "places.csv"
    rows = ("disc,C,63,48", "discs,A,63,48", "disc,D,5,5", "other,A,63,48")
    places.write_text("\n".join(["photo,point,column_px,line_px", *rows]))
    wanted = TargetSettings(what="circles", places=places)
    reading = read_photographs([circles[0]], tmp_path / "o.csv", wanted)
    assert [str(one) for one in reading.warnings if one.file == "places.csv"] == [
        "places.csv, row 2, photo: found 'disc'; expected one of the photos given"
        " (did you mean discs?); the row is not used",
        "places.csv, row 5, photo: found 'other'; expected one of the photos given; "
        "the row is not used",
    ]


def test_ambiguous_places_are_refused(circles, tmp_path):
    places = tmp_path / "places.csv"
    places.write_text("photo,point,column_px,line_px\ndiscs,A,60,50\ndiscs,B,62,52\n")
    reading = read_photographs(
        [circles[0]], tmp_path / "o.csv", TargetSettings(what="circles", places=places)
    )
    assert reading.points == 0
    assert reading.refused["ambiguous"] == 1
    assert any("no targets found" in str(one) for one in reading.warnings)


def test_circles_without_places_are_no_job(circles, tmp_path):
    (line,) = told([circles[0]], tmp_path / "o.csv", TargetSettings(what="circles"))
    assert line.startswith("places: missing")


def test_without_opencv_one_clear_line(photos, tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "cv2", None)
    (line,) = told(photos, tmp_path / "o.csv")
    assert line.startswith("OpenCV: not installed; expected: ")
    assert '-m pip install "opencv-python-headless>=' in line
    with pytest.raises(InputError):
        read_coded(np.zeros((50, 50), dtype=np.uint8), ARUCO)


def with_another_byte(path, place):
    data = bytearray(path.read_bytes())
    data[place] ^= 0xFF
    path.write_bytes(bytes(data))


@pytest.mark.parametrize("ending", ["png", "tiff"])
def test_a_picture_that_its_decoder_reports_as_damaged(tmp_path, capfd, ending):
    """The decoder may return pixels nevertheless; what it prints itself reaches nobody."""
    noise = np.random.default_rng(1).integers(0, 255, (400, 600)).astype(np.uint8)
    path = tmp_path / f"left.{ending}"
    cv2.imwrite(str(path), noise)
    with_another_byte(path, path.stat().st_size // 2)
    assert told([path], tmp_path / "image_points.csv") == [
        f"left.{ending}: damaged: the picture cannot be decoded as its header describes it"
    ]
    assert capfd.readouterr() == ("", "")


def test_a_jpeg_that_its_decoder_doubts_is_named(tmp_path, capfd):
    path = tmp_path / "left.jpg"
    noise = np.random.default_rng(1).integers(0, 255, (400, 600)).astype(np.uint8)
    cv2.imwrite(str(path), noise)
    with_another_byte(path, path.stat().st_size // 2)
    reading = read_photographs([path], tmp_path / "image_points.csv")
    assert "perhaps damaged: the JPEG decoder reports 'Corrupt" in str(reading.warnings[0])
    assert capfd.readouterr() == ("", "")
