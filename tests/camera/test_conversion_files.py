"""Files of cameras: what is written reads back, OpenCV reads it too, hostile ones are told."""

import json

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tankcal.camera.formats import reading
from tankcal.camera.formats import reading as writing
from tankcal.camera.formats.frame import frame_points, make_framed_camera, project_rays, trace_rays
from tankcal.camera.formats.reading import (
    cameras_toml_entry,
    make_sd_key,
    parse_cameras,
    read_camera,
    write_camera,
)
from tankcal.camera.formats.texts import LONGEST
from tankcal.camera.model import KEYS, PARAMETERS, Form
from tankcal.errors import InputError
from tankcal.job.calibrations import read_cameras
from tankcal.job.contract.registers import PARAMETER_KEYS, sd_key

SAME_PX = 1e-9
SIZE, PIXEL = (4000, 3000), 0.005
INTERIOR = [15.0, 0.02, -0.01, -3e-4, 1e-6, -1e-9, 0, 1e-5, -2e-5, 0, 0, 0, 0]
CAMERA = make_framed_camera(INTERIOR, Form(), PIXEL, SIZE)
METASHAPE = """<?xml version="1.0" encoding="UTF-8"?>
<calibration>
  <projection>frame</projection>
  <width>4000</width>
  <height>3000</height>
  <f>3000.5</f>
  <cx>4.25</cx>
  <cy>-2</cy>
  <k1>-0.07</k1>
  <p1>0.0001</p1>
  <date>2024-05-31T10:00:00Z</date>
</calibration>
"""
COLMAP = """# Camera list
1 PINHOLE 4000 3000 3000 3001 2000 1500
2 SIMPLE_RADIAL 4000 3000 3000 2000 1500 -0.05
"""
PIX4D = """Pix4D camera calibration file 0
#Focal Length mm assuming a sensor width of 20x15mm
F 15.0
#Principal Point mm
Px 10.02
Py 7.51
#Symmetrical Lens Distortion Coeffs
K1 -0.06
K2 0.01
K3 0
#Tangential Lens Distortion Coeffs
T1 0.001
T2 -0.0005
"""
YAML = """%YAML:1.0
---
calibration_time: "Fri 31 May 2024"
image_width: 4000
image_height: 3000
camera_matrix: !!opencv-matrix
   rows: 3
   cols: 3
   dt: d
   data: [ 3.0005e+03, 0., 2.0042e+03, 0., 3.0005e+03,
       1.4975e+03, 0., 0., 1. ]
distortion_coefficients: !!opencv-matrix
   rows: 5
   cols: 1
   dt: d
   data: [ -7.0e-02, 0., 0., 1.0e-04, 0. ]
avg_reprojection_error: 2.1e-01
"""
AICON = "Ck -15\nXh 0.02\nYh 0\nA1 -3e-4 # mm-2\nR0 6\ncolumns 4000\nlines 3000\n"
GOOD = {"opencv": YAML, "colmap": COLMAP, "metashape": METASHAPE, "pix4d": PIX4D, "aicon": AICON}


def read(text, pixel_um=5.0, size_px=SIZE, kind=None):
    return parse_cameras(text, "camera.txt", kind, pixel_um, size_px)


def problems_of(text, **arguments):
    with pytest.raises(InputError) as caught:
        read(text, **arguments)
    return caught.value.problems


@pytest.mark.parametrize("kind", writing.WRITING_KINDS[1:])
def test_written_file_is_read_back(kind, figure):
    """Property: 46 x 35 points of the frame within 1e-9 px, the kind recognised."""
    written = write_camera(kind, [("7", CAMERA)], radius_mm=6.0)
    assert written.error_px[0] < SAME_PX
    ((name, back),) = read(written.text)
    ((_, same),) = read(written.text, kind=kind)
    assert np.array_equal(same.interior, back.interior)
    assert name in ("7", "1", "camera")
    points = frame_points(SIZE)
    off = np.abs(project_rays(back, trace_rays(CAMERA, points)) - points).max()
    figure(f"written as {kind} and read back", f"{off:.1e} px")
    assert off < SAME_PX
    assert write_camera(kind, [(name, back)], radius_mm=6.0).text.split() == pytest.approx(
        written.text.split()
    ) or _same_numbers(write_camera(kind, [(name, back)], radius_mm=6.0).text, written.text)


def _same_numbers(one, other):
    first, second = (
        [word.strip("[],") for word in text.replace("<", " ").replace(">", " ").split()]
        for text in (one, other)
    )
    pairs = zip(first, second, strict=True)
    return all(a == b or float(a) == pytest.approx(float(b), rel=1e-9, abs=1e-15) for a, b in pairs)


@pytest.mark.parametrize("kind", GOOD)
def test_files_as_the_programs_write_them(kind, tmp_path):
    """Documented examples: recognised by their content, each value in its place."""
    path = tmp_path / "Front camera=1.dat"
    path.write_text("\ufeff" + GOOD[kind].replace("\n", "\r\n"), encoding="utf-8")
    found = read_camera(path, pixel_um=5.0, size_px=SIZE)
    assert [one.size_px for _, one in found] == [SIZE] * len(found)
    c, x0, y0, k1 = found[-1][1].interior[:4]
    expected = {
        "opencv": (15.0025, 0.0235, 0.01, -0.07 / 15.0025**2),
        "metashape": (15.0025, 0.02125, 0.01, -0.07 / 15.0025**2),
        "colmap": (15.0, 0.0, 0.0, -0.05 / 225),
        "pix4d": (15.0, 0.02, -0.01, -0.06 / 225),
        "aicon": (15.0, 0.02, 0.0, -3e-4),
    }[kind]
    assert (c, x0, y0, k1) == pytest.approx(expected)
    names = {"colmap": ["1", "2"], "pix4d": ["0"]}
    assert [name for name, _ in found] == names.get(kind, ["Front camera_1"])


def test_opencv_itself_reads_and_writes_the_same(tmp_path):
    """Other program: FileStorage of cv2, both ways, YAML and JSON."""
    cv2 = pytest.importorskip("cv2")
    written = tmp_path / "a.yml"
    written.write_text(write_camera("opencv", [("a", CAMERA)]).text)
    storage = cv2.FileStorage(str(written), cv2.FILE_STORAGE_READ)
    matrix = storage.getNode("camera_matrix").mat()
    k = storage.getNode("distortion_coefficients").mat()
    assert storage.getNode("image_width").real() == 4000
    storage.release()
    for ending in ("yml", "json", "xml"):
        path = tmp_path / f"of_opencv.{ending}"
        storage = cv2.FileStorage(str(path), cv2.FILE_STORAGE_WRITE)
        storage.write("image_width", 4000)
        storage.write("image_height", 3000)
        storage.write("camera_matrix", matrix)
        storage.write("distortion_coefficients", k)
        storage.release()
        ((_, back),) = read_camera(path, pixel_um=5.0)
        assert back.interior == pytest.approx(CAMERA.interior, rel=1e-12, abs=1e-15)


def test_ros_and_json_lists_are_read():
    """Documented examples: camera_info of ROS (no tag, lists over lines), JSON with K and dist."""
    ros = YAML.replace("%YAML:1.0\n---\n", "").replace(" !!opencv-matrix", "")
    ros = ros.replace("calibration_time: ", "distortion_model: plumb_bob\ncamera_name: ")
    as_json = {"K": [[3000.5, 0, 2004.2], [0, 3000.5, 1497.5], [0, 0, 1]]}
    as_json["dist"] = [[-0.07, 0, 0, 1e-4, 0]]
    expected = read(YAML)[0][1].interior
    for text in (ros, json.dumps(as_json)):
        assert read(text)[0][1].interior == pytest.approx(expected, rel=1e-14)


MATRIX = ([3000.5, 0, 2004.2], [0, 3000.5, 1497.5], [0, 0, 1])
LENS = (-0.07, 0, 0, 1e-4, 0)


def listed(rows, comma, between):
    """Numbers as a YAML list."""
    return "[" + between.join(comma.join(map(str, row)) for row in rows) + "]"


@pytest.mark.parametrize("comma", [", ", ",", " ", "  ", "\t"])
@pytest.mark.parametrize("between", ["same", "lines", "rows", "rows on lines"])
def test_lists_of_yaml_with_and_without_commas(comma, between):
    mark = comma if "," in comma else " "
    rows = {"same": mark, "lines": f"{mark}\n     ", "rows": f"]{mark}[",
            "rows on lines": f"]{mark} # row\n     ["}[between]  # fmt: skip
    matrix = listed(MATRIX, comma, rows)
    matrix = f"[{matrix}]" if "rows" in between else matrix
    text = (
        "image_width: 4000\nimage_height: 3000\ncamera_matrix:\n  rows: 3\n  cols: 3\n"
        f"  data: {matrix}  # K\ndistortion_model: plumb_bob\n"
        f"distortion_coefficients:\n  rows: 1\n  cols: 5\n  data: {listed([LENS], comma, '')}\n"
    )
    expected = read(YAML)[0][1].interior
    assert read(text)[0][1].interior == pytest.approx(expected, rel=1e-14)


def test_lists_of_yaml_with_an_item_on_each_line():
    items = "".join(f"  - {one}\n" for row in MATRIX for one in row)
    text = "image_width: 4000\nimage_height: 3000\ncamera_matrix:\n  rows: 3\n  cols: 3\n"
    text += f"  data:\n{items}"
    text += "dist:\n" + "".join(f"- {one}\n" for one in LENS)
    expected = read(YAML)[0][1].interior
    assert read(text)[0][1].interior == pytest.approx(expected, rel=1e-14)
    rows = "".join(f"  - {[*row]}\n" for row in MATRIX)
    text = f"image_width: 4000\nimage_height: 3000\nK:\n{rows}dist: {[*LENS]}\n"
    assert read(text, kind="opencv")[0][1].interior == pytest.approx(expected, rel=1e-14)


@pytest.mark.parametrize("lens", ["-0.07, 0 0, 1e-4, 0", "-0,07 0,5", "-0,07 0,0 0,1 0,2"])
def test_a_forgotten_comma_is_told(lens):
    """-0,07 0,5 would else be read as four coefficients."""
    text = "image_width: 4000\nimage_height: 3000\n"
    text += f"K: {[one for row in MATRIX for one in row]}\ndist: [{lens}]\n"
    (problem,) = problems_of(text, kind="opencv")
    assert (problem.expected.code, problem.row) == ("convert_no_comma", 4)


XML = """<?xml version="1.0"?>
<opencv_storage>
<calibration_Time>"now"</calibration_Time>
<image_Width>4000</image_Width>
<image_Height>3000</image_Height>
<Camera_Matrix type_id="opencv-matrix">
  <rows>3</rows> <cols>3</cols> <dt>d</dt>
  <data> 3000.5 0. 2004.2
    0. 3.0005e+03 1497.5 0. 0. 1.</data></Camera_Matrix>
<Distortion_Coefficients type_id="opencv-matrix"><rows>5</rows><cols>1</cols><dt>d</dt>
  <data>-.07 0. 0. 1e-4 0.</data></Distortion_Coefficients>
<views><_>a.jpg</_><_>b.jpg</_></views>
</opencv_storage>
"""


def test_xml_of_opencv():
    expected = read(YAML)[0][1].interior
    for text in (XML, XML.replace('<?xml version="1.0"?>\n', "<!-- mine -->")):
        assert read(text)[0][1].interior == pytest.approx(expected, rel=1e-14)


@pytest.mark.parametrize(("old", "new", "code"), [
    ("3.0005e+03", "x", "convert_finite"), ("3000.5 ", "", "convert_matrix_size"),
    ("<rows>3", "<rows>4", "convert_matrix_size"), ("</opencv_storage>", "", "convert_no_xml"),
    ("Camera_Matrix", "Other", "convert_under_name"),
    ("image_Width>", "image_Height>", "convert_given_twice"),
    ("<opencv_storage>", "<!DOCTYPE a []><opencv_storage>", "convert_doctype"),
])  # fmt: skip
def test_faults_of_xml_of_opencv(old, new, code):
    assert problems_of(XML.replace(old, new))[0].expected.code == code


def test_xml_of_another_program_taken_for_opencv():
    (problem,) = problems_of("<calibration></calibration>", kind="opencv")
    assert problem.expected.code == "convert_outermost"


POWERS = np.array([-1, -1, 2, 4, 6, 8, 1, 1, 2, 4, 0, 0])  # of 1/mm, of all but c


@pytest.mark.slow
@settings(max_examples=60)
@given(
    st.lists(st.floats(-1e-3, 1e-3), min_size=12, max_size=12),
    st.floats(0.06, 190),
    st.sampled_from(["both_y", "both_x", "b1_b2", "before_distortion"]),
    st.sampled_from(["distortion_of_ideal", "correction_added", "correction_subtracted"]),
    st.just(0.0) | st.floats(1e-9, 20),
    st.tuples(st.integers(1000, 9000), st.integers(1000, 9000)),
    st.tuples(st.floats(2e-3, 2e-2), st.floats(2e-3, 2e-2)),
    st.lists(st.sampled_from([np.nan, 0.0, 1e-5, 3e-4]), min_size=13, max_size=13),
    st.from_regex(r"[A-Za-z0-9_é][A-Za-z_ .()/#é-]{0,20}[a-z)]", fullmatch=True),
)
def test_cameras_toml_reads_back_the_same(
    tmp_path_factory, lens, diagonals, affinity, convention, balance, size, pixel, sds, name
):
    """Property: the job's own reader gives every number again, to the last digit."""
    corner_mm = np.hypot(*np.multiply(size, pixel)) / 2
    c = diagonals * 2 * corner_mm
    interior = np.array([c, *np.array(lens) * corner_mm ** -POWERS.astype(float)])
    form = Form(convention, affinity, balance)
    path = tmp_path_factory.mktemp("written", numbered=True) / "cameras.toml"
    path.write_text(cameras_toml_entry(name, interior, form, size, pixel, sds), encoding="utf-8")
    (setup,) = read_cameras(path)
    assert np.array_equal(setup.camera.values, interior)
    assert setup.camera.form == form
    assert np.array_equal(setup.camera.sd, sds, equal_nan=True)
    assert setup.camera.name == name
    assert np.abs(setup.pixel_mm / pixel - 1).max() < 3e-16


def test_keys_are_those_of_the_job():
    assert {name: key for name, (key, _) in PARAMETER_KEYS.items()} == KEYS
    assert [make_sd_key(name) for name in PARAMETERS] == [sd_key(name) for name in PARAMETERS]


def test_a_name_that_no_camera_can_have():
    for name in ("", "=A1", "a\nb", 'a"b', "x" * 65, "a "):
        with pytest.raises(InputError):
            cameras_toml_entry(name, INTERIOR, Form(), SIZE, PIXEL)


def test_several_cameras_in_one_cameras_toml(tmp_path):
    path = tmp_path / "cameras.toml"
    cameras = [
        ("one", CAMERA),
        ("two", make_framed_camera(INTERIOR, Form("correction_added"), PIXEL, SIZE)),
    ]
    path.write_text(write_camera("cameras.toml", cameras, sds=[None, np.full(13, 1e-6)]).text)
    assert [setup.camera.name for setup in read_cameras(path)] == ["one", "two"]


BOMB = '<!DOCTYPE x [<!ENTITY a "b">]>' + METASHAPE.split("\n", 1)[1]
TWO_ALIKE = "1 PINHOLE 4000 3000 1 1 1 1\n" * 2
BROKEN = {
    "doctype": (BOMB, None, "document type"),
    "truncated xml": (METASHAPE[:150], None, "not readable XML"),
    "f twice": (METASHAPE.replace("<cx>4.25</cx>", "<f>1</f>"), "'f'", "twice"),
    "no f": (METASHAPE.replace("<f>3000.5</f>", ""), "f", "missing"),
    "f 0": (METASHAPE.replace("3000.5", "0"), "f", "above 0"),
    "nan": (METASHAPE.replace("-0.07", "nan"), "k1", "finite"),
    "underscored": (METASHAPE.replace("3000.5", "3_000"), "f", "finite"),
    "fisheye xml": (METASHAPE.replace("frame", "fisheye"), "projection", "frame cameras"),
    "deep xml": ("<calibration>" * 200_000, None, "not readable XML"),
    "deep xml, whole": ("<calibration>" * 90_000 + "</calibration>" * 90_000, "width", "missing"),
    "document": ("<document></document>", None, "outermost"),
    "old photoscan": (METASHAPE.replace("f>", "fx>"), "fx", "PhotoScan"),
    "half a pixel": (METASHAPE.replace("4000", "4000.5"), "width", "whole pixels"),
    "unknown element": (METASHAPE.replace("date>", "day>"), "'day'", "unknown"),
    "b1 larger than f": (METASHAPE.replace("<date>", "<b1>-4000</b1><date>"), "b1", "magnitude"),
    "colmap model": ("1 OPENCV_FISHEYE 4 3 1 1 1 1 0 0 0 0", "MODEL", "those read are"),
    "colmap count": ("1 PINHOLE 4000 3000 3000 2000 1500", "PARAMS", "expected 4"),
    "colmap cut": ("1 PINHOLE 4000 3000 1 1 1 1\n2 PINHOLE 40", None, "incomplete line"),
    "colmap twice": (TWO_ALIKE, "CAMERA_ID", "twice"),
    "colmap inf": ("1 PINHOLE 4000 3000 inf 1 1 1", "fx", "finite"),
    "colmap nothing": ("# CAMERA_ID, MODEL", None, "no camera"),
    "colmap name": ("=1+1 PINHOLE 4000 3000 1 1 1 1", "CAMERA_ID", "expected a name"),
    "pix4d missing": (PIX4D.replace("T2 -0.0005\n", ""), "T2", "missing"),
    "pix4d twice": (PIX4D + "F 3\n", "F", "twice"),
    "pix4d key": (PIX4D + "Q 3\n", "'Q'", "unknown"),
    "pix4d sensor": (PIX4D.replace("20x15mm", "?"), "sensor width", "missing"),
    "pix4d shape": (PIX4D.replace("20x15", "20x12"), "columns", "proportions"),
    "inpho": ("camera_calibration_file 0\nFOCAL 4", None, "Inpho"),
    "yaml cut": (YAML[: YAML.index("1.0e-04")], "'data'", "without end"),
    "yaml short": (YAML.replace("3.0005e+03, 0., 2.0042e+03,", ""), "camera_matrix", "3 x 3"),
    "yaml nan": (YAML.replace("-7.0e-02", ".Nan"), "distortion_coefficients", "finite"),
    "yaml count": (YAML.replace("rows: 5", "rows: 4"), "distortion_coefficients", "4 x 1"),
    "yaml no k": (YAML.replace("distortion_c", "c"), "distortion_coefficients", "missing"),
    "yaml skew": (YAML.replace("3.0005e+03, 0., 2", "3.0005e+03, 1., 2"), "camera_matrix", "skew"),
    "yaml fisheye": (YAML + "distortion_model: equidistant\n", None, "fisheye"),
    "yaml size": (YAML.replace("image_height: 3000\n", ""), "image_height", "missing"),
    "yaml other size": (YAML.replace("_width: 4000", "_width: 400"), "format_px", "as given"),
    "json cut": ('{"K": [[1, 0,', None, "not readable JSON"),
    "json nan": ('{"K": [[NaN,0,1],[0,1,1],[0,0,1]], "dist": [0,0,0,0]}', "k", "finite"),
    "json text": ('{"K": "x", "dist": {}}', "k", "no numbers"),
    "json deep": ("{" + '"a":[' * 100_000, None, "JSON"),
    "json twice": ('{"K": [1,0,0,0,1,0,0,0,1], "k": 3, "dist": []}', "'k'", "twice"),
    "json true": ('{"K": [true,0,1,0,1,1,0,0,1], "dist": []}', "k", "finite"),
    "aicon no ck": ("Ck\nA1 2", "'Ck'", "one number"),
    "aicon c above 0": (AICON.replace("-15", "15"), "Ck", "found 15; expected a negative number"),
    "aicon key": (AICON + "Z 3", "'Z'", "unknown"),
    "aicon convention": (AICON + "convention odd", "convention", "expected one of"),
    "folds": (METASHAPE.replace("-0.07", "-0.9"), None, "folds"),
    "nothing": ("", None, "not a known kind of camera file"),
    "letter": ("Dear Sir or Madam,", None, "not a known kind of camera file"),
}  # fmt: skip


@pytest.mark.slow(after=1)
@pytest.mark.parametrize("what", BROKEN)
def test_broken_files_are_reported(what):
    """Hostile and damaged files: one line with the key, never anything but InputError."""
    text, key, part = BROKEN[what]
    problems = problems_of(text)
    told = [problem for problem in problems if part in problem.expected]
    assert told, [str(problem) for problem in problems]
    assert key is None or told[0].column == key
    assert told[0].file == "camera.txt"
    assert all(len(str(problem)) < 300 for problem in problems)


def test_all_problems_in_one_run():
    text = METASHAPE.replace("-0.07", "x").replace("4.25", "nan").replace("3000.5", "-1")
    keys = {problem.column for problem in problems_of(text, pixel_um=None)}
    assert keys == {"k1", "cx", "f", "pixel_um"}
    rows = [problem.row for problem in problems_of("1 PINHOLE 4 3 x y 1 1\n\n2 FOV 4 3 1 1 1 1 1")]
    assert rows == [1, 1, 3]


@pytest.mark.parametrize("kind", ["opencv", "colmap", "metashape"])
def test_missing_pixel_size_is_reported(kind):
    """Property: no file of these three says it; without it there are no millimetres."""
    (problem,) = problems_of(GOOD[kind], pixel_um=None)
    assert problem.column == "pixel_um"
    for bad in (0, -1, np.nan, "x"):
        assert {one.column for one in problems_of(GOOD[kind], pixel_um=bad)} == {"pixel_um"}


def test_other_missing_values_are_reported():
    (problem,) = problems_of(PIX4D, size_px=None)
    assert problem.column == "format_px"
    (problem,) = problems_of(AICON, pixel_um=None)
    assert "size of a pixel is missing" in problem.expected
    assert "as given" in problems_of(PIX4D, pixel_um=4.0)[0].expected
    assert "as given" in problems_of(AICON + "pixel_width 0.006\npixel_height 0.006")[0].expected
    assert problems_of(AICON + "pixel_width 0.006")[0].column == "pixel_width"
    assert "expected one of" in problems_of(YAML, kind="tiff")[0].expected
    assert problems_of(YAML, size_px=(0, 5))[0].column == "columns"
    for kind, cameras in (
        ("tiff", [("a", CAMERA)]),
        ("colmap", []),
        ("metashape", [("a", CAMERA)] * 2),
    ):
        with pytest.raises(InputError):
            write_camera(kind, cameras)


def test_files_that_are_none(tmp_path):
    """Hostile: missing, a folder, too long, binary, not UTF-8, an impossible name."""
    contents = {"long": b"x" * (LONGEST + 1), "zero": b"a\0b", "latin": b"\xe9\n"}
    for name, content in contents.items():
        (tmp_path / name).write_bytes(content)
    (tmp_path / "folder").mkdir()
    for name in ("missing", "folder", "long", "zero", "latin", "a\0b", "n" * 5000):
        with pytest.raises(InputError) as caught:
            read_camera(tmp_path / name, pixel_um=5)
        assert len(caught.value.problems) == 1


@pytest.mark.slow
@settings(max_examples=150)
@given(
    st.sampled_from(list(GOOD)),
    st.lists(
        st.tuples(
            st.integers(0, 700), st.integers(0, 40), st.text("0x.-e{}[]<>&:,\n# aK", max_size=8)
        ),
        min_size=1,
        max_size=4,
    ),
)
def test_damaged_file_is_read_or_reported(kind, cuts):
    """Property: a file that was cut and scribbled on gives finite cameras or InputError."""
    text = GOOD[kind]
    for start, length, scribble in cuts:
        text = text[:start] + scribble + text[start + length :]
    for given_kind in (None, kind):
        try:
            found = read(text, kind=given_kind)
        except InputError as error:
            told = [str(problem) for problem in error.problems]
        else:
            told = []
            assert all(np.all(np.isfinite(one.interior)) for _, one in found)
        assert not any("\n" in line for line in told)


def test_kinds_have_the_same_names_everywhere():
    assert {*reading.KINDS, "cameras.toml"} == set(writing.WRITING_KINDS)
