"""Books as a serial cable, an editor or another maker leaves them.

Truth: the same survey written without the additions gives the same tables, to the last character.
"""

import re

import pytest
from simulated_fieldbooks import one_stand
from written_fieldbooks import PROFILE, WRITERS

from tankcal.errors import InputError
from tankcal.products.fieldbooks.importing import Choices, import_fieldbooks

TRANSFERS = {
    "STX in the first line": lambda data: b"\x02\r\n" + data,
    "STX and ETX around the file": lambda data: b"\x02" + data + b"\x03",
    "STX and ETX around each line": lambda data: re.sub(rb"([^\r\n]+)", b"\x02\\1\x03", data),
    "Ctrl-Z at the end": lambda data: data + b"\x1a",
    "Ctrl-Z and zeros to a whole sector": lambda data: (data + b"\x1a").ljust(-len(data) % 128
                                                                             + len(data) + 128,
                                                                             b"\0"),
    "zeros before the first line": lambda data: b"\0\0\0" + data,
    "XON and XOFF in lines": lambda data: data[:300] + b"\x13\x11" + data[300:] + b"\x13",
    "form feed at the end": lambda data: data + b"\x0c\r\n",
    "CR alone": lambda data: data.replace(b"\r\n", b"\n").replace(b"\n", b"\r"),
    "CR CR LF": lambda data: data.replace(b"\r\n", b"\n").replace(b"\n", b"\r\r\n"),
    "UTF-8 with a mark": lambda data: b"\xef\xbb\xbf" + data,
    "UTF-8 with two marks": lambda data: b"\xef\xbb\xbf\xef\xbb\xbf" + data,
    "UTF-16": lambda data: data.decode().encode("utf-16"),
    "UTF-16 of the other order": lambda data: ("\ufeff" + data.decode()).encode("utf-16-be"),
    "UTF-16 without a mark": lambda data: data.decode().encode("utf-16-le"),
    "UTF-16 without a mark, other order": lambda data: data.decode().encode("utf-16-be"),
}  # fmt: skip


def read(folder, data, name, **choices):
    """({table: bytes}, Imported) of a book."""
    folder.mkdir()
    path = folder / f"book.{name}"
    path.write_bytes(data)
    if name == "csv":
        (folder / "profile.toml").write_text(PROFILE, encoding="utf-8")
        choices["profile"] = folder / "profile.toml"
    found = import_fieldbooks([path], folder / "job", Choices(**choices))
    return {one.name: one.read_bytes() for one in found.paths}, found


@pytest.mark.slow
@pytest.mark.parametrize("name", WRITERS)
def test_a_transfer_changes_no_table(tmp_path, name):
    data = WRITERS[name](one_stand()).encode()
    truth, _ = read(tmp_path / "plain", data, name)
    assert truth["wall_hits.csv"].count(b"\n") > 50
    for number, (what, change) in enumerate(TRANSFERS.items()):
        if name == "jxl" and "two" in what:
            continue  # XML has one byte order mark
        if name == "jxl" and what in ("XON and XOFF in lines", "STX and ETX around each line"):
            continue  # no XML parser takes control characters inside the document
        changed = change(data)
        assert changed != data or (what.startswith("CR ") and name == "jxl"), what
        tables, _ = read(tmp_path / str(number), changed, name)
        assert tables == truth, what


def test_zeros_at_the_end_are_reported(tmp_path):
    data = WRITERS["gsi"](one_stand()).encode()
    _, found = read(tmp_path / "zeros", data + bytes(512), "gsi")
    assert any("512 zero bytes at the end" in str(line) for line in found.summary)
    _, found = read(tmp_path / "whole", data, "gsi")
    assert not any("zero bytes" in str(line) for line in found.summary)


FILLERS = ("-----", "?????", "*****", "     ", ".....")


@pytest.mark.slow(after=7)
@pytest.mark.parametrize("width", [8, 16])
@pytest.mark.parametrize("filler", [*FILLERS, "all"])
@pytest.mark.parametrize("index", ["83", "86", "87", "88"])
def test_a_word_of_gsi_without_a_value_is_as_a_missing_word(tmp_path, width, filler, index):
    lines = WRITERS["gsi"](one_stand(), width=width).splitlines(True)
    text = "".join([*lines[:10], *(line for line in lines if "WALL" in line)][:25])
    known = f"110099+{'T1'.zfill(width)} 81..08+{'1'.zfill(width)} 82..08+{'2'.zfill(width)} "
    known += f"83..08+{'3'.zfill(width)} "
    text = ("*" if width == 16 else "") + known + "\r\n" + text
    word = re.compile(rf" {index}\.\.(..)[+-]\d{{{width}}}")
    assert word.search(text)
    blank = "-" * width if filler == "all" else filler.rjust(width, "0")
    truth, _ = read(tmp_path / "missing", word.sub("", text).encode(), "gsi")
    for place, unit in enumerate(("08", "10", "..")):
        changed = word.sub(f" {index}..{unit}+{blank}", text).encode()
        tables, _ = read(tmp_path / str(place), changed, "gsi")
        assert tables == truth


def test_a_target_height_without_a_value_does_not_keep_the_height_before(tmp_path):
    text = (
        "110001+000000S1 84..10+00001000 85..10+00002000 86..10+00000500 88..10+00001550\n"
        "110002+000000T1 21.322+10000000 22.322+10000000 31..00+00006500 87..10+00001300\n"
        "110003+000000T2 21.322+20000000 22.322+10000000 31..00+00006500 87..10+000-----\n"
    )
    ties = {"no_hits": True, "targets_mm": 1.0, "targets_arcsec": 3.0}
    tables, _ = read(tmp_path / "book", text.encode(), "gsi", **ties)
    rows = tables["slope_distances.csv"].decode().split()
    assert rows == ["setup,to,distance_m,s_mm,target_height_m", "S1,T1,6.500,1,1.300",
                    "S1,T2,6.500,1,"]  # fmt: skip


@pytest.mark.parametrize("broken", ["+0012-045", "+1234----", "+0000-001", "+000X----"])
def test_digits_with_a_filler_are_refused(tmp_path, broken):
    text = f"110002+000000W1 21.322+10000000 22.322+10000000 31..00{broken}\n"
    with pytest.raises(InputError) as error:
        read(tmp_path / "book", text.encode(), "gsi", hits=("W*",))
    assert error.value.problems[0].expected.code == "gsi_value"


FOREIGN = {
    "Nikon RAW": (
        "CO,Nikon RAW data format V2.00\nCO,T1\nMP,1,,100.000,200.000,10.000,ST\n"
        "ST,1,,,,1.430,0.0000,0.0000\nF1,,0.000,,0.0000,100.5344,13:47:08\n"
        "SS,2,0.000,5.020,10.0000,102.2000,14:02:04,WALL\n",
        "MP,BP1,,100.000,200.000,10.000,ST\nST,BP1,,,,1.430,0.0000,0.0000\n"
        + "SS,HR2,0.000,5.020,10.0000,102.2000,14:02:04,WALL\n" * 30,
    ),
    "Trimble DC": ("00NMSC V10-70       TANK\n10NMTANK            SCV\n" + "13NMnote\n" * 2,),
    "Geodimeter": ("50=TANK\n54=TANK\n2=S1\n3=1.55\n5=W1\n7=20.0000\n8=98.1234\n9=5.215\n",),
    "Topcon GTS": ("GTS-600 v3.0\nSTN\t1,1.550,\nHV\t10.0000,98.0000\nSD\t10.0,98.0,5.2\n",),
    "LandXML": ('<?xml version="1.0"?>\n<LandXML version="1.2">\n<Units/>\n</LandXML>\n',),
}


@pytest.mark.parametrize("name", FOREIGN)
def test_a_format_that_is_not_read_is_named(tmp_path, name):
    for number, text in enumerate(FOREIGN[name]):
        with pytest.raises(InputError) as error:
            read(tmp_path / str(number), text.encode(), "txt", hits=("W*",))
        (problem,) = error.value.problems
        assert problem.expected.code == "format_foreign"
        assert problem.expected.values["name"] == name


@pytest.mark.parametrize("case", ["gsi-stx-etx/book.gsi", "sdr-stx-first-line/book.sdr",
                                  "gsi-dashes-for-no-height/book.gsi",
                                  "gsi-dashes-station-height/book.gsi"])  # fmt: skip
def test_cases_from_outside(tmp_path, case, shared):
    path = shared / "cases" / case
    if not path.exists():
        pytest.skip("the cases from outside are not here")
    tables, _ = read(tmp_path / "case", path.read_bytes(), case[-3:], hits=("W*",))
    assert tables["wall_hits.csv"].count(b"\n") == 7
    control = tables["control.csv"].decode().split()
    xy = "200.000,100.000" if "sdr" in case else "100.000,200.000"
    assert control[1] == f"S1,{xy}" + (",10.000" if "station" not in case else "")
