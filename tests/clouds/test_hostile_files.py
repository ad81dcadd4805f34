"""Files built to harm, or broken: each is refused in words before a library sees it.

The table of cases is what laspy, lazrs and libe57 were seen to do with such files: hang, abort,
read fewer points than declared, or give nonsense. Truth: each file is sound but for the bytes
named.
"""

import struct
import time

import numpy as np
import pytest
from numpy.testing import assert_allclose
from written_clouds import some_wall, with_checksums, with_xml, write_cloud, write_e57, write_las

from tankcal.clouds import describe_cloud, read_cloud
from tankcal.clouds.formats import files, isolation
from tankcal.errors import InputError

COUNT = 1000
BILLIONS = 4_000_000_000


@pytest.fixture(scope="module")
def sound(tmp_path_factory):
    """{name: bytes} of sound files."""
    folder, xyz = tmp_path_factory.mktemp("sound"), some_wall(COUNT)
    write_las(folder / "old.las", xyz)
    write_las(folder / "old.laz", xyz)
    write_las(folder / "new.las", xyz, version="1.4", form=6)
    write_las(folder / "new.laz", xyz, version="1.4", form=6)
    write_las(folder / "last.las", xyz, version="1.4", form=6, evlrs=1)
    write_cloud(folder / "wall.e57", xyz)
    return {path.name: path.read_bytes() for path in folder.iterdir()}


def patched(data, *changes):
    """Bytes with (place, form, value) written into them."""
    data = bytearray(data)
    for place, form, value in changes:
        struct.pack_into("<" + form, data, place, value)
    return bytes(data)


def refused_header(tmp_path, name, data):
    """What `describe_cloud` says of the bytes, in under five seconds and one line a problem."""
    path = tmp_path / name
    path.write_bytes(data)
    start = time.process_time()
    with pytest.raises(InputError) as caught:
        describe_cloud(path)
    assert time.process_time() - start < 5
    assert all(problem.file == name for problem in caught.value.problems)
    return str(caught.value)


LAS_CASES = [
    ("old.las", [(100, "I", BILLIONS)], "behind 4000000000 records"),
    ("new.las", [(243, "I", BILLIONS), (235, "Q", 375)], "4000000000 records behind the points"),
    ("new.las", [(243, "I", BILLIONS)], "4000000000 records behind the points"),
    ("new.las", [(243, "I", 1)], "1 records behind the points"),
    ("new.las", [(247, "Q", 10**10)], "declares 10000000000 points, and has room for 1000"),
    ("new.las", [(247, "Q", 2**62)], "declares 4611686018427387904 points"),
    ("old.las", [(107, "I", 999)], "declares 999 points and holds 1000"),
    ("old.las", [(107, "I", 1001)], "declares 1001 points, and has room for 1000"),
    ("new.las", [(107, "I", 7)], "declares 1000 points in one place and 7 in another"),
    *[
        ("old.las", [(131, "d", scale)], "scale factors")
        for scale in (np.nan, 0, 1e300, -1, np.inf)
    ],
    *[("old.las", [(155, "d", offset)], "offsets") for offset in (np.inf, np.nan, 1e300)],
    ("old.las", [(179, "d", 1e9)], "coordinates from"),
    ("old.las", [(187, "d", np.nan)], "coordinates from"),
    ("old.las", [(96, "I", BILLIONS)], "points from byte 4000000000 on"),
    ("old.las", [(96, "I", 100)], "points from byte 100 on"),
    ("old.las", [(105, "H", 65535)], "has room for 0"),
    ("old.las", [(105, "H", 0)], "records of format 3 and 0 bytes"),
    ("old.las", [(94, "H", 0)], "a header of 0 bytes"),
    ("old.las", [(104, "B", 0x3F)], "records of format 63"),
    ("old.las", [(104, "B", 127)], "records of format 63"),
    ("old.las", [(24, "B", 9)], "LAS of version 9.2"),
    ("old.las", [(25, "B", 200)], "LAS of version 1.200"),
    ("old.las", [(104, "B", 3 | 0x80)], "without the LASzip record"),
    ("old.las", [(107, "I", 0)], "declares 0 points and holds 1000"),
    ("last.las", [(247, "Q", 0), (107, "I", 0)], "declares 0 points and holds 1000"),
    ("last.las", [(247, "Q", 900)], "declares 900 points and holds 1000"),
    ("last.las", [(235, "Q", 30_000)], "declares 1000 points and holds 987"),
]


@pytest.mark.slow(after=32)
@pytest.mark.parametrize(("name", "changes", "said"), LAS_CASES)
def test_las(tmp_path, sound, name, changes, said):
    assert said in refused_header(tmp_path, name, patched(sound[name], *changes))


def test_several_problems_of_one_header(tmp_path, sound):
    said = refused_header(
        tmp_path, "a.las", patched(sound["old.las"], (131, "d", 0), (155, "d", np.inf))
    )
    assert len(said.split("\n")) == 2


@pytest.mark.parametrize("name", ["old.las", "new.las", "old.laz", "new.laz", "wall.e57"])
@pytest.mark.parametrize("share", [0.001, 0.1, 0.5, 0.99])
def test_a_part_of_a_file(tmp_path, sound, name, share):
    data = sound[name]
    refused_header(tmp_path, name, data[: max(int(share * len(data)), 9)])


def laz_table(data):
    """Places of the pointer to the chunk table, and of the table."""
    first = struct.unpack_from("<I", data, 96)[0]
    return first, struct.unpack_from("<q", data, first)[0]


def laszip_record(data):
    return data.index(b"laszip encoded") - 2 + 54


LAZ_CASES = [
    (lambda data: [(laz_table(data)[1] + 4, "I", BILLIONS)], "a table of 4000000000 chunks"),
    (lambda data: [(laz_table(data)[1] + 4, "I", 0)], "a table of 0 chunks"),
    (lambda data: [(laz_table(data)[1] + 4, "I", 3)], "a table of 3 chunks"),
    (lambda data: [(laz_table(data)[0], "q", -1)], "at byte -1 of"),
    (lambda data: [(laz_table(data)[0], "q", 2**62)], "at byte 4611686018427387904 of"),
    (lambda data: [(laszip_record(data) + 12, "I", 0)], "does not describe"),
    (lambda data: [(laszip_record(data) + 32, "H", 65535)], "does not describe"),
    (lambda data: [(laszip_record(data) + 36, "H", 65535)], "does not describe"),
]


@pytest.mark.parametrize("name", ["old.laz", "new.laz"])
@pytest.mark.parametrize(("changes", "said"), LAZ_CASES)
def test_laz(tmp_path, sound, name, changes, said):
    data = sound[name]
    assert said in refused_header(tmp_path, name, patched(data, *changes(data)))


@pytest.mark.parametrize("count", [10**10, 2**62])
def test_count_of_laz(tmp_path, sound, count):
    said = refused_header(tmp_path, "a.laz", patched(sound["new.laz"], (247, "Q", count)))
    assert f"chunks for {count} points" in said or "in another" in said


def xml_of(change):
    return lambda data: with_xml(data, change, are_summed=False)


def replaced(old, new):
    def change(xml):
        assert old in xml
        return xml.replace(old, new)

    return xml_of(change)


NESTED = b"<a>" * 50_000 + b"</a>" * 50_000
BOMB = b"".join(
    b'<!ENTITY a%d "%s">' % (i, b"&a%d;" % (i - 1) * 10 if i else b"lol") for i in range(9)
)
XML_START = b'<?xml version="1.0" encoding="UTF-8"?>'
E57_CASES = [
    (replaced(b'recordCount="1000"', b'recordCount="100000000"'), "declares 100000000 points"),
    (replaced(b'recordCount="1000"', b'recordCount="1000000000000"'), "have no room|has no room"),
    (replaced(b'recordCount="1000"', b'recordCount="-1"'), "declares -1 points"),
    (replaced(b'recordCount="1000"', b'recordCount="x"'), "declares -1 points"),
    (replaced(b'fileOffset="48"', b'fileOffset="4000000000000"'), "would begin at byte 40000"),
    (replaced(b'fileOffset="48"', b'fileOffset="52"'), "would begin at byte 52"),
    (replaced(b"</e57Root>", NESTED + b"</e57Root>"), "in each other"),
    pytest.param(
        replaced(b"</e57Root>", b"<a/>" * 300_000 + b"</e57Root>"),
        "has 200001 elements",
        marks=pytest.mark.slow,
    ),
    (replaced(XML_START, XML_START + b"<!DOCTYPE a [%s]>" % BOMB), "entities"),
    (replaced(XML_START, XML_START + b'<!DOCTYPE a SYSTEM "file:///etc/passwd">'), "entities"),
    (replaced(b"cartesianX", b"otherX"), "neither cartesian nor spherical"),
    (replaced(b"</e57Root>", b""), "not well formed"),
    (replaced(b"data3D", b"dataXX"), "names no scans"),
    (xml_of(lambda xml: b""), "its XML would be 0 bytes"),
    (lambda data: with_checksums(patched(data, (24, "Q", 2**62))), "its XML would be"),
    (lambda data: with_checksums(patched(data, (32, "Q", 2**62))), "its XML would be"),
    (lambda data: with_checksums(patched(data, (16, "Q", 2**62))), "bytes long and is"),
    (lambda data: with_checksums(patched(data, (40, "Q", 7))), "pages of 7 bytes"),
    (lambda data: data + bytes(1024), "bytes long and is"),
]


@pytest.mark.parametrize(("change", "said"), E57_CASES)
def test_e57(tmp_path, sound, change, said):
    found = refused_header(tmp_path, "a.e57", change(sound["wall.e57"]))
    assert any(part in found for part in said.split("|"))


@pytest.mark.slow
def test_changed_xml_is_read_when_it_is_sound(tmp_path, sound):
    """The helper of these cases makes sound files of its own accord."""
    path = tmp_path / "a.e57"
    path.write_bytes(with_xml(sound["wall.e57"], lambda xml: xml + b"  <!-- more -->"))
    found = np.concatenate([part.xyz_m for part in read_cloud(describe_cloud(path))])
    assert_allclose(found, some_wall(COUNT))


@pytest.mark.parametrize("quaternion", [(2, 0, 0, 0), (0.9, 0, 0, 0), (1e200, 0, 0, 0)])
def test_pose_of_e57(tmp_path, quaternion):
    write_e57(tmp_path / "a.e57", [some_wall(5)], poses=[(quaternion, (0, 0, 0))])
    said = refused_header(tmp_path, "a.e57", (tmp_path / "a.e57").read_bytes())
    assert "quaternion of length 1" in said


@pytest.mark.slow
@pytest.mark.parametrize("name", ["old.las", "new.laz"])
@pytest.mark.parametrize(
    ("place", "value", "said"),
    [
        (131, 0.00015, "outside of the box"),
        (155, 1.0, "outside of the box"),
    ],
)
def test_scale_and_offset_that_are_wrong_but_possible(tmp_path, sound, name, place, value, said):
    """Points then leave the box of the header."""
    path = tmp_path / name
    path.write_bytes(patched(sound[name], (place, "d", value)))
    with pytest.raises(InputError, match=said):
        list(read_cloud(describe_cloud(path)))


@pytest.mark.slow
def test_damaged_points_of_e57(tmp_path, sound):
    path, data = tmp_path / "a.e57", bytearray(sound["wall.e57"])
    data[5000] ^= 1
    path.write_bytes(data)
    with pytest.raises(InputError, match="its reader refused it"):
        list(read_cloud(describe_cloud(path)))


# ---- what ends the child, the parent tells


def died(tmp_path, monkeypatch, code):
    path = write_cloud(tmp_path / "a.laz", some_wall(50))
    header = describe_cloud(path)
    monkeypatch.setattr(isolation, "CODE", code)
    with pytest.raises(InputError) as caught:
        list(read_cloud(header))
    return str(caught.value)


LIMITED = "from tankcal.clouds.formats import isolation; isolation.{name}({arguments}); "
WORK = "import json, sys; sys.path[:] = json.loads(sys.argv[1])['sys_path']; "


def test_an_abort(tmp_path, monkeypatch):
    assert "(signal 6)" in died(tmp_path, monkeypatch, "import os; os.abort()")


def test_an_end_before_the_last_point(tmp_path, monkeypatch):
    assert "ended with status 3" in died(tmp_path, monkeypatch, "raise SystemExit(3)")


@pytest.mark.slow
def test_a_child_that_sleeps(tmp_path, monkeypatch):
    monkeypatch.setattr(isolation, "SILENT_S", 1)
    assert "was stopped" in died(tmp_path, monkeypatch, "import time; time.sleep(100)")


@pytest.mark.slow
def test_a_child_that_computes_for_ever(tmp_path, monkeypatch):
    code = WORK + LIMITED.format(name="_allow_time", arguments="-0.1e6") + "\nwhile True: pass"
    assert "was stopped" in died(tmp_path, monkeypatch, code)


@pytest.mark.slow
def test_a_child_that_wants_all_memory(tmp_path, monkeypatch):
    code = WORK + (
        "from tankcal.clouds.formats import isolation\n"
        "def greedy(request): yield 0, 1, bytes(1 << 40)\n"
        "isolation.laz_chunks = greedy; isolation.main({'kind': 'laz'})"
    )
    assert "more memory" in died(tmp_path, monkeypatch, code)


@pytest.mark.slow
def test_a_child_that_gives_fewer_or_more_points(tmp_path, monkeypatch):
    code = WORK + (
        "from tankcal.clouds.formats import isolation\n"
        "def wrong(request): yield 0, {n}, bytes(12 * {n})\n"
        "isolation.laz_chunks = wrong; isolation.main({{'kind': 'laz'}})"
    )
    for n in (49, 51):
        said = died(tmp_path, monkeypatch, code.format(n=n))
        assert f"declares 50 points and holds {n}" in said or "outside of the box" in said


def test_a_device_is_no_file(tmp_path):
    for name in ("/dev/zero", "/dev/null"):
        with pytest.raises(InputError, match="a folder or a device"):
            files.open_cloud(name)


def test_limits_are_generous():
    """A chunk of a million points takes the child about half a second of processor."""
    assert isolation.LEAST_CPU_S + isolation.CPU_S_OF_MILLION > 30
