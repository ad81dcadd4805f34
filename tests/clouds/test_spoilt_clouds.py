"""Clouds spoilt at random, the same ones on every machine: read whole, or refused in words.

Property: whatever bytes a file has, there is no exception but InputError, no hang, no abort of the
process that reads, and never fewer points than declared without a word.
"""

import resource

import numpy as np
import pytest
from draws import draws
from written_clouds import UNMOVED, some_wall, with_checksums, write_cloud, write_las, write_ply
from written_clouds import write_ptx as write_scans

from tankcal.clouds import describe_cloud, read_cloud
from tankcal.errors import InputError

MOST_S = 5  # of processor, of the reader and its child
HOSTILE = (0, 1, 0x7F, 0x80, 0xFF)
NUMBERS = (
    b"\xff" * 8, b"\0" * 8, b"\xff\xff\xff\x7f", b"\0\0\0\x80", np.array([np.nan]).tobytes(),
    np.array([1e300]).tobytes(), np.array([np.inf]).tobytes(), np.uint64(2**62).tobytes(),
    b" ", b"\n", b"-", b"9" * 12, b"nan", b"<", b"\r", b"0 0 0\n", b"1e999", b"]]>",
)  # fmt: skip
QUICK = {"las": 40, "laz": 6, "e57": 6, "ply": 40, "ptx": 40}
SLOW = {"las": 200, "laz": 60, "e57": 60, "ply": 200, "ptx": 200}
FULL = {  # 10 000 of make study-full; those that need a child take a third of a second each
    kind: draws(full // 10, full)
    for kind, full in {"las": 2600, "laz": 1100, "e57": 1100, "ply": 2600, "ptx": 2600}.items()
}


@pytest.fixture(scope="module")
def sound(tmp_path_factory):
    """{format: list of bytes} of sound files."""
    folder, xyz = tmp_path_factory.mktemp("sound"), some_wall(150)
    for ending in ("las", "laz"):
        write_las(folder / f"old.{ending}", xyz)
        write_las(folder / f"new.{ending}", xyz, version="1.4", form=6, evlrs=1)
    write_cloud(folder / "wall.e57", xyz)
    write_ply(folder / "binary.ply", xyz)
    write_ply(folder / "last.ply", xyz, order="binary_big_endian", faces=False)
    write_ply(folder / "text.ply", xyz, order="ascii")
    write_scans(folder / "wall.ptx", [(xyz[:60], UNMOVED), (xyz[60:], UNMOVED)])
    found = {}
    for path in sorted(folder.iterdir()):
        found.setdefault(path.suffix[1:], []).append(path.read_bytes())
    return found


def spoilt(data, rng):
    """The bytes with one to four things wrong, more often in the head than in the rest."""
    data = bytearray(data)
    for _ in range(rng.integers(1, 5)):
        size = len(data)
        at = int(rng.integers(min(size, 600) if rng.random() < 0.7 else size)) if size else 0
        kind, length = rng.integers(7), int(rng.integers(1, 60))
        if kind == 0:
            data[at : at + 1] = bytes([HOSTILE[rng.integers(len(HOSTILE))]])
        elif kind in (1, 2):
            value = NUMBERS[rng.integers(len(NUMBERS))]
            data[at : at + len(value)] = value
        elif kind == 3:
            data[at : at + 1] = rng.bytes(1)
        elif kind == 4 and rng.random() < 0.3:
            del data[at:]
        elif kind == 5:
            data[at : at + length] = data[at // 2 : at // 2 + length]
        elif kind == 6 and rng.random() < 0.5:
            del data[at : at + length]
    return bytes(data)


def spoilt_file(kind, sources, rng):
    """The bytes of one spoilt file; of E57 two of three have sound checksums."""
    data = spoilt(sources[rng.integers(len(sources))], rng)
    if kind == "e57":
        if rng.random() < 0.5 and len(data) > 8192:  # the XML stands there
            at = int(rng.integers(6200, len(data)))
            data = data[:at] + bytes([rng.integers(32, 127)]) + data[at + 1 :]
        if rng.random() < 0.67:
            data = with_checksums(data[: len(data) // 1024 * 1024])
    return data


def processor_s():
    """Seconds of processor of this process and of its children that ended."""
    both = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    return sum(one.ru_utime + one.ru_stime for one in both)


def outcome(path):
    """(whether the file was refused, seconds); fails where points are lost without a word."""
    start, told = processor_s(), []
    try:
        header = describe_cloud(path)
        delivered = sum(
            len(part.xyz_m) for part in read_cloud(header, progress=lambda *args: told.append(args))
        )
    except InputError as error:
        return bool(error.problems), processor_s() - start
    declared = sum(scan.declared for scan in header.scans)
    assert told[-1][:2] == (declared, declared)
    assert declared > 0
    assert delivered == declared or header.format in ("ptx", "e57")
    return False, processor_s() - start


def spoil_and_read(kind, sources, folder, counts):
    rng = np.random.default_rng([11, *kind.encode()])
    path, refused, longest = folder / f"spoilt.{kind}", 0, 0.0
    for _ in range(counts[kind]):
        path.write_bytes(spoilt_file(kind, sources, rng))
        is_refused, seconds = outcome(path)
        refused, longest = refused + is_refused, max(longest, seconds)
    assert refused > 0
    assert longest < MOST_S
    return f"{refused} refused, none longer than {longest:.1f} s"


@pytest.mark.slow(after=1)
@pytest.mark.parametrize("kind", QUICK)
def test_some_spoilt_files(sound, kind, tmp_path):
    spoil_and_read(kind, sound[kind], tmp_path, QUICK)


@pytest.mark.slow
@pytest.mark.twentieth
@pytest.mark.parametrize("kind", SLOW)
def test_hundreds_of_spoilt_files(sound, kind, tmp_path):
    spoil_and_read(kind, sound[kind], tmp_path, SLOW)


@pytest.mark.study
@pytest.mark.parametrize("kind", FULL)
def test_ten_thousand_spoilt_files(sound, kind, tmp_path, figure):
    figure(
        f"{FULL[kind]} spoilt files of {kind}", spoil_and_read(kind, sound[kind], tmp_path, FULL)
    )
