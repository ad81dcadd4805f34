"""Files read by pieces: together they are the file, whatever the size of a piece."""

import numpy as np
import pytest
from numpy.testing import assert_array_equal
from written_clouds import UNMOVED, some_wall, write_cloud, write_e57, write_las, write_ptx

from tankcal.clouds import CloudPiece, describe_cloud, estimate_count, pieces_of, read_cloud
from tankcal.errors import InputError

SOUGHT = ("las", "ply", "xyz", "csv")  # formats that are cut between any two points


def read_by_pieces(header, each):
    return np.concatenate([read(header, piece=one) for one in pieces_of(header, each)])


def read(header, **settings):
    found = [part.xyz_m for part in read_cloud(header, **settings)]
    return np.concatenate(found) if found else np.zeros((0, 3))


@pytest.mark.slow
@pytest.mark.parametrize("kind", [*SOUGHT, "laz", "e57", "ptx", "pts"])
@pytest.mark.parametrize("each", [1, 7, 100, 10**6])
def test_pieces_are_the_file(tmp_path, kind, each):  # invariance
    header = describe_cloud(write_cloud(tmp_path / f"wall.{kind}", some_wall(103)))
    pieces = pieces_of(header, each)
    assert_array_equal(
        np.concatenate([read(header, piece=one, chunk=5) for one in pieces]), read(header)
    )
    assert (len(pieces) > 1) == (kind in SOUGHT and each < 103)


@pytest.mark.slow
def test_laz_is_cut_at_its_chunks(tmp_path):  # invariance
    write_las(tmp_path / "wall.laz", some_wall(120_000))
    header = describe_cloud(tmp_path / "wall.laz")
    pieces = pieces_of(header, 60_000)
    assert [(one.first, one.count) for one in pieces] == [
        (0, 50_000),
        (50_000, 50_000),
        (100_000, 20_000),
    ]
    assert_array_equal(read_by_pieces(header, 60_000), read(header))


@pytest.mark.slow
def test_e57_has_a_piece_for_each_scan(tmp_path):
    scans = [some_wall(count, seed=count) for count in (30, 50)]
    write_e57(tmp_path / "wall.e57", scans)
    header = describe_cloud(tmp_path / "wall.e57")
    pieces = pieces_of(header, 10)
    assert [one.scan for one in pieces] == [0, 1]
    (part,) = read_cloud(header, piece=pieces[1])
    assert part.scan == 1
    assert_array_equal(part.xyz_m, scans[1])


def test_heading_blank_lines_and_a_mark_of_utf8_are_in_one_piece(tmp_path):
    path = tmp_path / "wall.csv"
    rows = "\r\n".join(f"{i};{i + 0.5};1" for i in range(50))
    path.write_bytes(b"\xef\xbb\xbfx;y;z\r\n\r\n" + rows.encode())
    header = describe_cloud(path)
    assert len(pieces_of(header, 4)) > 5
    assert_array_equal(read_by_pieces(header, 4)[:, 0], np.arange(50))


def test_a_bad_row_keeps_its_number(tmp_path):
    path = tmp_path / "wall.xyz"
    rows = [f"{i} 1 2" for i in range(400)]
    path.write_text("\n".join([*rows[:350], "", "1 b 2", *rows[350:]]) + "\n")
    header = describe_cloud(path)
    with pytest.raises(InputError, match=r"row 352: y: found 'b'"):
        read_by_pieces(header, 20)


@pytest.mark.slow
def test_a_piece_that_ends_early_is_told_with_both_numbers(tmp_path):
    header = describe_cloud(write_cloud(tmp_path / "wall.laz", some_wall(100)))
    with pytest.raises(InputError):  # the decoder has no points behind the last
        read(header, piece=CloudPiece(None, 0, 101))
    other = describe_cloud(write_cloud(tmp_path / "wall.las", some_wall(100)))
    with pytest.raises(InputError, match="declares 100 points and holds 100"):
        read(other, piece=CloudPiece(None, 60, 41))


def test_a_point_outside_is_told_with_its_number_in_the_file(tmp_path):
    path = tmp_path / "wall.las"
    write_las(path, some_wall(100), form=0)
    data = bytearray(path.read_bytes())
    place = len(data) - 20 * 100 + 20 * 80
    data[place : place + 4] = (2**31 - 1).to_bytes(4, "little")
    path.write_bytes(data)
    header = describe_cloud(path)
    with pytest.raises(InputError, match="point 81 is"):
        read_by_pieces(header, 30)


def test_rows_of_text_are_told_from_its_start(tmp_path):
    header = describe_cloud(write_cloud(tmp_path / "wall.xyz", some_wall(20_000)))
    assert abs(estimate_count(header) / 20_000 - 1) < 0.02
    write_ptx(tmp_path / "wall.ptx", [(some_wall(50), UNMOVED)])
    assert estimate_count(describe_cloud(tmp_path / "wall.ptx")) == 50
