"""Whatever is handed in, it is read, or refused in plain lines with file and row."""

import re

import numpy as np
import pytest
from draws import draws
from simulated_fieldbooks import one_stand, two_stands
from written_fieldbooks import PROFILE, WRITERS

from tankcal.cli import main
from tankcal.errors import InputError
from tankcal.products.fieldbooks.importing import Choices, import_fieldbooks

FEW, MANY = 25, draws(150, 3000)
WHOLE = (
    b"", b"\n", b"\x00\x00\x00", b"\xff\xfe", b"\xff\xfe\x00", b"\xfe\xff\x00a", b"\xef\xbb\xbf",
    b"PK\x03\x04rest", b"\x89PNG\r\n\x1a\n\x00", b"<?xml version='1.0'?>", b"<JOBFile",
    b"<JOBFile><FieldBook></FieldBook></JOBFile>", b"<a>" * 5000, b"*11" * 9, b"00NM",
    b"00NMSDR33 V04-04.02", b"MO,AD0,UN1", b"a" * 3_000_000, b"11" + b"0" * 100_000,
    b"JB,\n" * 10, b"\xc3\x28\n", b"9" * 5000 + b",", "１１００".encode(), b"\r\r\r\r",
    b"<?xml version='1.0' encoding='martian'?><JOBFile></JOBFile>", b"SS,OP1,FP1,AR1e400\n",
    b"<?xml version='1.0' encoding='utf-32'?><JOBFile></JOBFile>",
)  # fmt: skip


PUT_IN = (b"\r", b"\n", b"+", b"-", b",", b" ", b"<", b"&", b"9" * 30, b"\xff", b"nan", b"1e9")


def told(path, out, **choices):
    """Problems of an import, or None where it is done; anything else is raised."""
    try:
        import_fieldbooks([path], out, Choices(**choices), replace_tables=True)
    except InputError as error:
        assert not out.exists()
        lines = [str(one) for one in error.problems]
        assert lines
        assert all(line.strip() and line.isprintable() and len(line) < 2000 for line in lines)
        return error.problems
    return None


def problems_of(tmp_path, text, name="book.txt", **choices):
    path = tmp_path / name
    path.write_bytes(text if isinstance(text, bytes) else text.encode("utf-8"))
    return [(one.expected.code, one.row) for one in told(path, tmp_path / "out", **choices)]


@pytest.mark.parametrize(
    ("name", "old", "new", "problems"),
    [
        ("gsi", "22.322+", "22.329+", [("gsi_value", 2)]),
        ("gsi", "21.322+0", "21.322+X", [("gsi_value", 2)]),
        ("gsi", " 22.322+", " 22.322?", [("no_gsi_line", 2)]),
        ("gsi", "22.322+", "21.322+", [("gsi_word_twice", 2)]),
        ("rw5", "UN1", "UN7", [("rw5_units", 2)]),
        ("rw5", "MO,", "--MO,", [("units_unknown", 6)]),
        ("rw5", "ZE10", "ZEx10", [("rw5_fields", 6)]),
        ("rw5", "AR18.2915", "AR18.7915", [("impossible_minutes", 6)]),
        ("rw5", "SS,OP1", "SS,OP2", [("other_station", 6)]),
        ("rw5", "SD4", "SD-4", [("negative_distance", 6)]),
        ("jxl", "<EDMDistance>4.", "<EDMDistance>4x", [("no_plain_number", 9)]),
        ("jxl", "<VerticalCircle>1", "<VerticalCircle>1000", [("beyond_reason", 9)]),
        ("jxl", "Face1", "Face2", [("face_unlike_circle", 9)]),
        ("jxl", "<StationID>s", "<StationID>q", [("jxl_station", 9)]),
        ("jxl", "</FieldBook>", "</FieldBoo>", [("no_xml", 216)]),
        ("sdr", "111111", "911111", [("sdr_units", 1), ("sdr_header", 2)]),
        ("sdr", "00NMSDR33", "00NMSDR44", [("format_unknown", None)]),
        ("sdr", "09F1               1", "09F1               7", [("sdr_station", 7)]),
        ("sdr", "18.48767", "18.x8767", [("sdr_number", 7)]),
        ("csv", "Ponto", "Pontos", [("no_such_heading", 1)]),
        ("csv", ";4,88467;", ";4.88467;", [("no_plain_number", 2)]),
        ("csv", "18° 29'", "18° 99'", [("impossible_minutes", 2)]),
        ("csv", "14/07/2026", "14-07-2026", [("csv_face_or_time", 2)]),
    ],
)  # fmt: skip
def test_each_fault_is_one_line(tmp_path, name, old, new, problems):
    text = WRITERS[name](one_stand())
    assert old in text
    choices = {}
    if name == "csv":
        (tmp_path / "profile.toml").write_text(PROFILE, encoding="utf-8")
        choices["profile"] = tmp_path / "profile.toml"
    assert problems_of(tmp_path, text.replace(old, new, 1), **choices) == problems


@pytest.mark.parametrize(
    ("name", "old", "new", "row", "column"),
    [
        ("rw5", r"SD(4)[.]\d+", r"SD\1", 6, "SD"),
        ("rw5", r"ZE(\d+)[.]\d+", r"ZE\1", 6, "ZE"),
        ("rw5", r"AR(\d+[.]\d)\d+", r"AR\1", 6, "AR"),
        ("sdr", r"(?s)(.*09F1.{64}\d+[.]).*", r"\1", 215, "direction"),
        ("sdr", r"(09F1.{32})(\d[.]\d{5})\d{3}", r"\1\2   ", 7, "distance"),
        ("csv", ";4,88467;", ";4,88;", 2, "distance"),
        ("csv", r"(18° 29' \d+),\d+", r"\1", 2, "direction"),
    ],
)
def test_a_number_that_is_cut_short_is_told(tmp_path, name, old, new, row, column):
    (tmp_path / "profile.toml").write_text(PROFILE, encoding="utf-8")
    whole = WRITERS[name](one_stand())
    text = re.sub(old, new, whole, count=1)
    assert text != whole
    path = tmp_path / "book.txt"
    path.write_text(text, encoding="utf-8", newline="")
    found = told(path, tmp_path / "out",
                 profile=tmp_path / "profile.toml" if name == "csv" else None)  # fmt: skip
    assert [(one.expected.code, one.row, one.column) for one in found] == [
        ("cut_short", row, column)
    ]


def test_round_numbers_are_no_cut_ones(tmp_path):
    """With all decimals; without the blanks at the end; of a program that leaves out zeros."""
    (tmp_path / "profile.toml").write_text(PROFILE, encoding="utf-8")
    path, profile = tmp_path / "book.txt", tmp_path / "profile.toml"
    text = WRITERS["sdr"](one_stand())
    text = re.sub(r"(09F1.{64})\d+[.]\d+", r"\g<1>290.00000000", text, count=1)
    path.write_text("\n".join(line.rstrip() for line in text.splitlines()), encoding="utf-8")
    assert told(path, tmp_path / "sdr") is None
    text = WRITERS["csv"](one_stand()).replace(";4,88467;", ";5,00000;", 1)
    text = re.sub(r"(,\d+?)0+;", r"\1;", text).replace(";5,0;", ";5;")
    path.write_text(text, encoding="utf-8")
    assert ";5;" in text
    assert told(path, tmp_path / "csv", profile=profile) is None


@pytest.mark.parametrize(("many", "refused"), [(1, 1), (2, 2), (10, 2), (11, 0), (40, 0)])
def test_two_ways_of_writing_are_no_cut_numbers(tmp_path, many, refused):
    """So many of 104 distances have 1 decimal: from a tenth of them on it is a way of writing."""
    text, count = re.subn(r"SD(\d+[.]\d)\d+", r"SD\1", WRITERS["rw5"](one_stand()), count=many)
    assert count == many
    path = tmp_path / "book.rw5"
    path.write_text(text, encoding="utf-8")
    found = told(path, tmp_path / "out") or []
    assert {one.expected.code for one in found} <= {"cut_short", "more_problems"}
    assert min(len(found), 2) == refused


def test_a_table_without_a_profile(tmp_path):
    text = WRITERS["csv"](one_stand())
    assert problems_of(tmp_path, text) == [("format_unknown", None)]
    assert problems_of(tmp_path, text, format="csv") == [("profile_needed", None)]


@pytest.mark.parametrize(
    ("old", "new", "code"),
    [
        ('"dms"', '"parsec"', "profile_choice"),
        ('length = "m"', 'lenght = "m"', "profile_key"),
        ('point = "Ponto"', "point = 0", "profile_place"),
        ('point = "Ponto"', "", "profile_column"),
        ("time_format = ", "time_format = 5 #", "profile_text"),
        ('decimal = ","', 'decimal = ","\nfirst_row = nan', "profile_number"),
        ('decimal = ","', 'decimal = ["x"]', "profile_choice"),
        ("%d/%m/%Y", "%", "csv_face_or_time"),
        ("[columns]", "[columns", "toml_cannot_be_read"),
    ],
)
def test_faults_of_a_profile(tmp_path, old, new, code):
    (tmp_path / "profile.toml").write_text(PROFILE.replace(old, new), encoding="utf-8")
    found = problems_of(tmp_path, WRITERS["csv"](one_stand()), profile=tmp_path / "profile.toml")
    assert code in [one for one, _ in found]


def test_ties_need_their_standard_deviations(tmp_path):
    found = problems_of(tmp_path, WRITERS["gsi"](two_stands()))
    assert found == [("ties_without_sd", None)] * 2


def test_which_points_are_hits_is_asked(tmp_path):
    text = WRITERS["gsi"](one_stand()).replace("WALL", "0042")
    assert problems_of(tmp_path, text) == [("which_are_hits", None)]


def test_two_points_of_one_name_are_no_faces(tmp_path):
    survey = one_stand(faces=2, index=0.2)
    codes = {code for code, _ in problems_of(tmp_path, WRITERS["gsi"](survey))}
    assert codes == {"no_pair_of_faces", "more_problems"}


def test_control_targets_need_a_time(tmp_path):
    text = "".join(
        line for line in WRITERS["rw5"](one_stand()).splitlines(True)
        if not line.startswith(("--DT", "--TM"))
    )  # fmt: skip
    codes = [code for code, _ in problems_of(tmp_path, text, control=("T?",))]
    assert codes == ["control_without_time"] * 8


def test_all_problems_of_all_files_in_one_run(tmp_path, capsys):
    for name, text in (("a.gsi", "11"), ("b.rw5", "MO,UN9\nMO,UN8"), ("c.jxl", "<JOBFile>")):
        (tmp_path / name).write_text(text)
    files = [str(tmp_path / name) for name in ("a.gsi", "b.rw5", "c.jxl", "missing.sdr")]
    assert main(["import", *files, "--out", str(tmp_path / "out")]) == 2
    lines = capsys.readouterr().err.splitlines()
    assert {line.split(": ")[1].split(",")[0] for line in lines} == {
        "a.gsi", "b.rw5", "c.jxl", "missing.sdr"
    }  # fmt: skip
    assert not (tmp_path / "out").exists()


def test_a_file_twice_and_a_name_that_no_job_takes(tmp_path, capsys):
    text = WRITERS["rw5"](one_stand())
    for name in ("a.rw5", "b.rw5"):
        (tmp_path / name).write_text(text)
    files = [str(tmp_path / name) for name in ("a.rw5", "b.rw5")]
    assert main(["import", *files, "--out", str(tmp_path / "out")]) == 2
    told = "tankcal: b.rw5: identical to a.rw5; expected each file once\n"
    assert capsys.readouterr().err == told
    (tmp_path / "a.rw5").write_text(text.replace("OP1", "OP+1"))
    assert main(["import", files[0], "--out", str(tmp_path / "out")]) == 2
    lines = capsys.readouterr().err.splitlines()
    places = [line.split(": ")[1] for line in lines]
    assert places == [
        "a.rw5, row 3, control.point", "a.rw5, row 6, setups.setup", "a.rw5, row 6, setups.station"
    ]  # fmt: skip


@pytest.mark.slow(after=17)
@pytest.mark.parametrize("data", WHOLE)
def test_what_is_no_field_book_is_refused(tmp_path, data):
    (tmp_path / "profile.toml").write_text(PROFILE, encoding="utf-8")
    path = tmp_path / "book"
    path.write_bytes(data)
    for name in (None, "gsi", "rw5", "jxl", "sdr", "csv"):
        for profile in (None, tmp_path / "profile.toml"):
            assert told(path, tmp_path / "out", format=name, profile=profile)


def spoilt(data, rng):
    """The bytes of a field book with one to three things wrong."""
    for _ in range(rng.integers(1, 4)):
        kind = rng.integers(8)
        place = int(rng.integers(len(data) + 1))
        if kind == 0:
            data = data[:place]
        elif kind == 1:
            data = data[:place] + bytes([rng.integers(256)]) + data[place + 1 :]
        elif kind == 2:
            data = data.decode("utf-8", "replace").encode("utf-16")
        elif kind == 3:
            data = data[:place] + PUT_IN[rng.integers(len(PUT_IN))] + data[place:]
        elif kind == 4:
            lines = data.split(b"\n")
            rng.shuffle(lines)
            data = b"\n".join(lines)
        elif kind == 5:
            lines = data.split(b"\n")
            data = b"\n".join(lines + lines)
        elif kind == 6:
            data = b"\xef\xbb\xbf" + data
        else:
            other = int(rng.integers(len(data) + 1))
            first, last = sorted((place, other))
            data = data[:first] + data[min(last, first + 200) :]
    return data


def assert_told(tmp_path, seeds):
    (tmp_path / "profile.toml").write_text(PROFILE, encoding="utf-8")
    texts = {name: write(one_stand(hits=3, faces=2)).encode("utf-8")
             for name, write in WRITERS.items()}  # fmt: skip
    for name, data in texts.items():
        for seed in seeds:
            path, out = tmp_path / f"book.{name}", tmp_path / f"{name}-{seed}"
            path.write_bytes(spoilt(data, np.random.default_rng([len(name), ord(name[0]), seed])))
            told(path, out, hits=("*",) if seed % 2 else (), format=name if seed % 3 else None,
                 profile=tmp_path / "profile.toml" if name == "csv" else None)  # fmt: skip


@pytest.mark.slow
@pytest.mark.twentieth
def test_spoilt_field_books_are_told(tmp_path):
    assert_told(tmp_path, range(FEW))


@pytest.mark.study
def test_very_many_spoilt_field_books(tmp_path):
    assert_told(tmp_path, range(1000, 1000 + MANY))


@pytest.mark.parametrize(("name", "is_told"), [("rw5", True), ("gsi", False)])
def test_choices_about_code_blocks_are_told_where_no_file_has_them(tmp_path, name, is_told):
    path = tmp_path / "book"
    path.write_text(WRITERS[name](one_stand()))
    choices = Choices(codes="before", station_code="21")
    found = import_fieldbooks([path], tmp_path / "out", choices)
    told = [one.file for one in found.warnings if one.expected.code == "option_of_gsi"]
    assert told == (["--codes", "--station-code"] if is_told else [])
