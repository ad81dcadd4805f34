"""Round trips: clouds written by other programs (laspy, libe57) or by hand are read as they are.

Truth: what was written, by a second method (the library's writer, numpy's printing).
"""

import itertools

import numpy as np
import pytest
from numpy.testing import assert_allclose
from written_clouds import (
    UNMOVED,
    some_wall,
    write_cloud,
    write_e57,
    write_las,
    write_ply,
    write_pts,
    write_ptx,
    write_xyz,
)

from tankcal.clouds import describe_cloud, read_cloud
from tankcal.errors import InputError

UTM = (600_000.0, 7_500_000.0, 800.0)
KINDS = ("las", "laz", "e57", "ply", "ptx", "pts", "xyz", "csv")


def points_of(path, **settings):
    return [part.xyz_m for part in read_cloud(describe_cloud(path), **settings)]


def read_all(path, **settings):
    return np.concatenate(points_of(path, **settings))


def refusal(path, **settings):
    with pytest.raises(InputError) as caught:
        read_all(path, **settings)
    return str(caught.value)


@pytest.mark.slow(after=1)
@pytest.mark.parametrize("kind", KINDS)
def test_round_trip_at_coordinates_of_utm(tmp_path, kind):
    xyz = some_wall(centre=UTM)
    found = read_all(write_cloud(tmp_path / f"wall.{kind}", xyz))
    assert found.dtype == np.float64
    assert_allclose(found, xyz, rtol=0, atol=1e-8)


@pytest.mark.slow(after=1)
@pytest.mark.parametrize("kind", KINDS)
def test_chunks_and_unit(tmp_path, kind):
    xyz = some_wall(103)
    parts = points_of(write_cloud(tmp_path / f"wall.{kind}", xyz), chunk=10, unit_m=0.3048)
    assert max(map(len, parts)) == 10
    assert all(part[:, 0].flags.c_contiguous for part in parts)
    assert_allclose(np.concatenate(parts), 0.3048 * xyz, rtol=0, atol=1e-8)


@pytest.mark.slow(after=1)
@pytest.mark.parametrize("kind", KINDS)
def test_progress_ends_with_all_points(tmp_path, kind):
    told = []
    path = write_cloud(tmp_path / f"wall.{kind}", some_wall(50))
    read_all(path, progress=lambda *args: told.append(args))
    assert told[-1] == (50, None if kind in ("xyz", "csv") else 50, path.name)


@pytest.mark.slow(after=1)
@pytest.mark.parametrize(
    ("version", "form", "ending"),
    [*itertools.product(["1.2"], [0, 1, 2, 3], ["las", "laz"])]
    + [*itertools.product(["1.4"], [6, 7, 8], ["las", "laz"])],
)
def test_point_formats_of_las(tmp_path, version, form, ending):
    xyz, path = some_wall(200), tmp_path / f"wall.{ending}"
    write_las(path, xyz, version=version, form=form, evlrs=int(version == "1.4"))
    assert describe_cloud(path).format == ending
    assert_allclose(read_all(path), xyz, rtol=0, atol=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("kind", "atol"), [("double", 0), ("single", 1e-6), ("scaled", 5.1e-6), ("integer", 0)]
)
def test_numbers_of_e57(tmp_path, kind, atol):
    xyz, path = some_wall(), tmp_path / "wall.e57"
    xyz = np.round(1000 * xyz) if kind == "integer" else xyz
    write_e57(path, [xyz], kind=kind)
    assert_allclose(read_all(path), xyz, rtol=0, atol=atol)


@pytest.mark.slow
def test_spherical_e57_without_returns(tmp_path):
    xyz, path = some_wall(300), tmp_path / "wall.e57"
    state = np.arange(300) % 3
    write_e57(path, [xyz], spherical=True, invalid=state)
    told = []
    assert_allclose(
        read_all(path, progress=lambda *args: told.append(args)), xyz[state == 0], atol=1e-12
    )
    assert told[-1][:2] == (300, 300)


@pytest.mark.slow
def test_scans_and_poses_of_e57(tmp_path):
    from pyquaternion import Quaternion

    path, scans = tmp_path / "walls.e57", [some_wall(40), some_wall(70, seed=2)]
    turn = Quaternion(axis=[1, 2, 3], degrees=50)
    write_e57(path, scans, poses=[((1, 0, 0, 0), (0, 0, 0)), (turn.elements, (1.5, -2, 3))])
    header = describe_cloud(path)
    assert [(one.name, one.declared) for one in header.scans] == [("scan 0", 40), ("scan 1", 70)]
    assert_allclose(header.scans[0].pose, np.eye(4), atol=1e-15)
    assert_allclose(header.scans[1].pose[:3, :3], turn.rotation_matrix, atol=1e-12)
    assert_allclose(header.scans[1].pose[:, 3], [1.5, -2, 3, 1])
    for number, part in enumerate(read_cloud(header)):
        assert part.scan == number
        assert_allclose(part.xyz_m, scans[number])


def test_e57_without_pose(tmp_path):
    path = write_cloud(tmp_path / "wall.e57", some_wall(5))
    assert describe_cloud(path).scans[0].pose is None


@pytest.mark.parametrize("order", ["ascii", "binary_little_endian", "binary_big_endian"])
@pytest.mark.parametrize("faces", [True, False])
def test_orders_of_ply(tmp_path, order, faces):
    xyz, path = some_wall(), tmp_path / "wall.ply"
    for kind, atol in (("double", 0), ("float", 1e-6)):
        write_ply(path, xyz, order=order, kind=kind, faces=faces)
        assert_allclose(read_all(path), xyz, rtol=0, atol=atol)


@pytest.mark.slow
@pytest.mark.parametrize("order", ["ascii", "binary_little_endian"])
def test_float32_that_cannot_tell_a_tenth_of_a_millimetre(tmp_path, order):
    path = tmp_path / "wall.ply"
    write_ply(path, some_wall(centre=UTM), order=order, kind="float")
    assert "32 bits hold 7500006 to 500 mm" in refusal(path)
    write_e57(path.with_suffix(".e57"), [some_wall(centre=UTM)], kind="single")
    assert "32 bits" in refusal(path.with_suffix(".e57"))


def test_ptx_of_two_scans_with_matrices_of_rows(tmp_path):
    turned = np.array([[0, 1, 0, 0], [-1, 0, 0, 0], [0, 0, 1, 0], [10, 20, 30, 1.0]])
    first, second = some_wall(30), some_wall(20, seed=2)
    second[::4] = 0
    write_ptx(tmp_path / "walls.ptx", [(first, UNMOVED), (second, turned)])
    header = describe_cloud(tmp_path / "walls.ptx")
    assert [one.declared for one in header.scans] == [30, 20]
    parts = list(read_cloud(header))
    assert_allclose(parts[0].xyz_m, first)
    assert_allclose(parts[1].xyz_m, second[second.any(axis=1)])
    # row (1, 0, 0, 1) times the matrix of rows: (10, 21, 30)
    assert_allclose(header.scans[1].pose @ [1, 0, 0, 1], [10, 21, 30, 1])


def test_pts_of_blocks_and_blank_lines(tmp_path):
    path, scans = tmp_path / "walls.pts", [some_wall(30), some_wall(20, seed=2)]
    write_pts(path, scans)
    path.write_text("\n" + path.read_text().replace("1 2 3\n", "1 2 3\r\n\r\n") + "\n\n")
    header = describe_cloud(path)
    assert [one.declared for one in header.scans] == [30, 20]
    assert_allclose(np.concatenate([part.xyz_m for part in read_cloud(header)]), np.vstack(scans))


@pytest.mark.parametrize(
    ("separator", "decimal", "heading"),
    [
        (" ", ".", ""),
        ("\t", ".", "X\tY\tZ\n"),
        (",", ".", "x_m,y_m,z_m\n"),
        (", ", ".", "# of a scanner\n\n//X,Y,Z\n"),
        (";", ",", "\ufeffX [m];Y [m];Z [m]\n"),
        (" ", ",", ""),
        ("   ", ".", "Easting Northing Height\n"),
    ],
)
@pytest.mark.parametrize("end", ["\n", "\r\n"])
def test_separators_of_text(tmp_path, separator, decimal, heading, end):
    xyz, path = some_wall(50), tmp_path / "wall.txt"
    write_xyz(path, xyz, separator=separator, decimal=decimal, heading=heading, end=end)
    assert describe_cloud(path).format == "xyz"
    assert_allclose(read_all(path), xyz, rtol=0, atol=1e-12)


def test_columns_are_found_by_their_heading(tmp_path):
    path = tmp_path / "wall.csv"
    path.write_text("id,Z,note,X,Y\n1,3,a,1,2\n2,6,,4,5\n")
    assert read_all(path).tolist() == [[1, 2, 3], [4, 5, 6]]
    path.write_text("point name\tX [m]\tY [m]\tZ [m]\n1 a\t1,5\t2\t3\n\t4\t5\t6\n")
    assert read_all(path).tolist() == [[1.5, 2, 3], [4, 5, 6]]


def test_comments_between_rows_and_a_last_line_without_end(tmp_path):
    path = tmp_path / "wall.xyz"
    path.write_text("1 2 3\n# a comment\n\n   \n4 5 6 7 8\n  7 8 9")
    assert read_all(path).tolist() == [[1, 2, 3], [4, 5, 6], [7, 8, 9]]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("1 2 3\n4 x 6\n", "wall.xyz, row 2: y: found 'x'"),
        ("1 2 3\n4 5\n", "row 2: z: found ''"),
        ("1 2 3\n4 nan 6\n", "row 2: y: found 'nan'"),
        ("1 2 3\n4 5 1e999\n", "row 2: z: found '1e999'"),
        ("1 2 3\n\n# 4\n4 5 1_0\n", "row 4: z: found '1_0'"),
        ("1,5,2,5,3,5\n", "row 1: a comma here"),
        ("1.5;2,5;3\n", "row 1: a comma here"),
        ("point east height\n1 2 3\n", "row 1: found 'point east height'"),
        ("1 2\n3 4\n", "row 1: 2 columns"),
        ("X [m] Y [m] Z [m]\n1 2 3\n", "row 1: found 'X [m] Y [m] Z [m]'; expected a heading"),
        ("x;y;z\n1 2 3\n", None),
        ("# x y z of the shell\n1 2 3\n", None),
        ("x,y,z\n1;2;3;4\n", "row 1: found 'x,y,z'"),
        ("".join(f"{i} 5 6 7\n" for i in range(20)), "its first column counts the rows"),
        ("# nothing\n", "holds no points"),
        ("1 2 3\r4 5 6\r", "holds no points"),
        ("1 2 3\n4 5 6\r7 8 9\n", "row 2: "),
        ("1 2 3\n4 5 1e8\n", "point 2 is (4, 5, 1e+08)"),
        ("1 2 3\n" + "4" * 3_000_000, "row 2: a line of more than"),
        ("1 2 3\n5 6 " + "4" * 900_000 + "x\n", "row 2: z: found '4444"),
    ],
)
def test_rows_of_text(tmp_path, text, said):
    path = tmp_path / "wall.xyz"
    path.write_bytes(text.encode())
    if said is None:
        assert read_all(path).tolist() == [[1, 2, 3]]
    else:
        assert said in refusal(path)


@pytest.mark.parametrize(
    ("name", "text", "said"),
    [
        ("wall.pts", "3\n1 2 3\n4 5 6\n", "declares 3 points and holds 2"),
        ("wall.pts", "1\n1 2 3\n4 5 6\n", "row 3: found '4 5 6'"),
        ("wall.pts", "99999999999\n1 2 3\n", "have no room"),
        ("wall.pts", "0\n0 0 0\n", "row 2: found '0 0 0'"),
        ("wall.ptx", "1 2 3\n", "does not begin as a PTX"),
        ("wall.xyz", "", "empty"),
    ],
)
def test_counts_of_text(tmp_path, name, text, said):
    (tmp_path / name).write_text(text)
    assert said in refusal(tmp_path / name)


def test_ptx_that_is_cut_or_scaled(tmp_path):
    path = tmp_path / "wall.ptx"
    write_ptx(path, [(some_wall(9), UNMOVED), (some_wall(8), 2 * UNMOVED)])
    assert "row 22: after the size of a scan" in refusal(path)
    write_ptx(path, [(some_wall(9), UNMOVED), (some_wall(8), UNMOVED)])
    text = path.read_text()
    path.write_text(text[: text[:-1].rindex("\n") + 1])
    assert "scan 2 declares 8 points and holds 7" in refusal(path)


def test_points_that_are_not_finite(tmp_path):
    xyz, path = some_wall(20), tmp_path / "wall.ply"
    xyz[7, 1] = np.nan
    write_ply(path, xyz)
    assert "point 8 is (" in refusal(path)
    xyz[:] = np.nan
    write_ply(path, xyz)
    assert "point 1 is (nan, nan, nan)" in refusal(path)


def test_files_of_other_kinds(tmp_path):
    (tmp_path / "a.las").write_text("1 2 3\n")
    (tmp_path / "a.txt").write_bytes(b"1 2\0 3\n")
    (tmp_path / "a.xyz").write_bytes("1 2 3\n".encode("utf-16"))
    assert "no format that is read" in refusal(tmp_path / "a.las")
    assert "no format that is read" in refusal(tmp_path / "a.txt")
    assert "UTF-16" in refusal(tmp_path / "a.xyz")
    assert "a folder or a device" in refusal(tmp_path)
    assert "cannot be read" in refusal(tmp_path / "none.las")


def test_signature_goes_before_ending(tmp_path):
    path = write_cloud(tmp_path / "wall.las", some_wall(5))
    path.rename(tmp_path / "wall.txt")
    assert describe_cloud(tmp_path / "wall.txt").format == "las"


def test_a_missing_library_is_told_in_one_line(tmp_path, monkeypatch):
    paths = [write_cloud(tmp_path / f"wall.{kind}", some_wall(5)) for kind in ("laz", "e57")]
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None)
    for path in paths:
        with pytest.raises(InputError, match=r'-m pip install "lazrs>='):
            describe_cloud(path)


def test_a_file_that_changed_meanwhile(tmp_path):
    path = write_cloud(tmp_path / "wall.xyz", some_wall(5))
    header = describe_cloud(path)
    write_cloud(path, some_wall(6))
    with pytest.raises(InputError, match="changed since"):
        list(read_cloud(header))


@pytest.mark.slow
def test_a_reader_that_is_left_ends_its_child(tmp_path):
    path = write_cloud(tmp_path / "wall.laz", some_wall(1000))
    parts = read_cloud(describe_cloud(path), chunk=10)
    next(parts)
    parts.close()  # waits for the child; a hang would show here
