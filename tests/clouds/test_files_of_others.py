"""Clouds as other programs write them: a count below titles, one stream of LAZ, no rotation.

Truth: the same points in a file without the particularity.
"""

import io
import struct

import numpy as np
import pytest
from written_clouds import some_wall, write_e57, write_las

from tankcal.clouds import describe_cloud, pieces_of, read_cloud
from tankcal.errors import InputError

TITLES = "//X{0}Y{0}Z{0}Rf{0}Intensity"


def points(path, piece=None):
    header = describe_cloud(path)
    if piece is None:
        return np.vstack([one.xyz_m for one in read_cloud(header)])
    parts = [
        one.xyz_m for part in pieces_of(header, piece) for one in read_cloud(header, piece=part)
    ]
    return np.vstack(parts)


def refusal(path):
    with pytest.raises(InputError) as error:
        points(path)
    (problem,) = error.value.problems
    return problem.expected.code


@pytest.mark.slow(after=9)
@pytest.mark.parametrize("newline", ["\n", "\r\n"])
@pytest.mark.parametrize("separator", [" ", ";", ",", "\t"])
@pytest.mark.parametrize("head", ["{titles}\n{count}\n", "{count}\n{titles}\n",
                                  "# saved\n{titles}\n\n{count}\n# more\n",
                                  "{bare}\n{count}\n"])  # fmt: skip
def test_titles_and_a_count_before_the_points(tmp_path, head, separator, newline):
    xyz = np.round(some_wall(300), 4)
    titles = TITLES.format(separator)
    rows = [separator.join([*(f"{one:.4f}" for one in row), "0.5", "7"]) for row in xyz]
    head = head.format(titles=titles, count=len(xyz), bare=titles[2:])
    path = tmp_path / "cloud.txt"
    path.write_text((head + "\n".join(rows) + "\n").replace("\n", newline), newline="")
    assert describe_cloud(path).scans[0].declared == 300
    np.testing.assert_array_equal(points(path), xyz)
    np.testing.assert_array_equal(points(path, piece=40), xyz)
    path.write_text(head + "\n".join(rows[:-1]) + "\n")
    assert refusal(path) == "cloud_file_count"
    path.write_text(head + "\n".join([*rows, rows[0]]) + "\n")
    assert refusal(path) == "cloud_file_count"


def laszip_record(data):
    """(its place, place of the points) in the bytes of a LAZ file."""
    return data.find(b"laszip encoded") + 52, struct.unpack_from("<I", data, 96)[0]


@pytest.mark.slow
@pytest.mark.parametrize("chunk", [0, 50_000, 0xFFFFFFFF])
def test_one_stream_of_laszip_1(tmp_path, chunk):
    """Points of LASzip 1.2: compressor 1, no table of chunks, any size of a chunk."""
    lazrs = pytest.importorskip("lazrs")
    xyz = some_wall(60_000)
    whole, plain = tmp_path / "whole.laz", tmp_path / "plain.las"
    write_las(whole, xyz)
    write_las(plain, xyz)
    data, las = whole.read_bytes(), plain.read_bytes()
    record, first = laszip_record(data)
    rows = np.frombuffer(las[struct.unpack_from("<I", las, 96)[0] :], np.uint8)
    size = struct.unpack_from("<H", las, 105)[0]
    large = bytearray(data[record:first])
    struct.pack_into("<I", large, 12, 1_000_000)  # so that all points are in one chunk
    stream = io.BytesIO()
    compressor = lazrs.LasZipCompressor(stream, lazrs.LazVlr(bytes(large)))
    compressor.compress_many(rows[: size * len(xyz)])
    compressor.done()
    body = stream.getvalue()
    body = body[8 : struct.unpack_from("<q", body)[0]]
    struct.pack_into("<HHBB", large, 0, 1, 0, 1, 2)
    struct.pack_into("<I", large, 12, chunk)
    path = tmp_path / "old.laz"
    path.write_bytes(data[:record] + bytes(large) + body)
    np.testing.assert_array_equal(points(path), points(whole))


@pytest.mark.slow(after=1)
@pytest.mark.parametrize(("place", "form", "value", "code"),
                         [(0, "<H", 4, "cloud_file_laz_kind"), (2, "<H", 1, "cloud_file_laz_kind"),
                          (38, "<H", 9, "cloud_file_unsupported"),
                          (36, "<H", 21, "cloud_file_laz_record")])  # fmt: skip
def test_another_compression_is_named(tmp_path, place, form, value, code):
    path = tmp_path / "cloud.laz"
    write_las(path, some_wall(300))
    data = bytearray(path.read_bytes())
    struct.pack_into(form, data, laszip_record(data)[0] + place, value)
    path.write_bytes(data)
    assert refusal(path) == code


def zeros(path, *positions):
    """An E57 file whose rotations are quaternions of zeros."""
    write_e57(path, [some_wall(200)] * len(positions),
              poses=[((0.0, 0.0, 0.0, 0.0), one) for one in positions])  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize("position", [(0, 0, 0), (1, 2, 3)])
def test_a_quaternion_of_zeros_is_no_pose(tmp_path, position):
    path = tmp_path / "scan.e57"
    zeros(path, position)
    (scan,) = describe_cloud(path).scans
    assert scan.pose is None
    assert scan.warning.code == "cloud_file_e57_zero_pose"
    assert scan.is_placed == any(position)
    np.testing.assert_allclose(points(path), some_wall(200), rtol=0, atol=1e-9)


def test_other_quaternions_are_judged_as_before(tmp_path):
    for quaternion in ((0.5, 0, 0, 0), (1e-9, 0, 0, 0), (2, 0, 0, 0)):
        path = tmp_path / "scan.e57"
        write_e57(path, [some_wall(200)], poses=[(quaternion, (0, 0, 0))])
        assert refusal(path) == "cloud_file_e57_pose"
    write_e57(path, [some_wall(200)], poses=[((1, 0, 0, 0), (1, 2, 3))])
    (scan,) = describe_cloud(path).scans
    assert scan.warning is None
    np.testing.assert_array_equal(scan.pose[:3], [[1, 0, 0, 1], [0, 1, 0, 2], [0, 0, 1, 3]])
