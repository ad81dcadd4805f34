"""Small files by hand, from the public descriptions of the formats, and what is read of them."""

import csv
import json

import pytest

from tankcal.cli import main
from tankcal.errors import InputError
from tankcal.products.fieldbooks.importing import Choices, import_fieldbooks

TIES = {"targets_mm": 1.0, "targets_arcsec": 3.0}


def read(tmp_path, text, name="book.txt", **choices):
    """(Imported, {table: rows}) of a file."""
    path, out = tmp_path / name, tmp_path / "job"
    path.write_bytes(text if isinstance(text, bytes) else text.encode("utf-8"))
    found = import_fieldbooks([path], out, Choices(**choices), replace_tables=True)
    tables = {one.stem: list(csv.DictReader(one.open(encoding="utf-8"))) for one in found.paths}
    return found, tables


def codes(lines):
    """Codes of lines, and of what is said within them."""
    found = set()
    for one in lines:
        text = getattr(one, "expected", one)
        found.add(text.code)
        found |= {inner.code for inner in text.values.values() if hasattr(inner, "code")}
    return found


# ---- GSI


def test_gsi8_in_gon_with_millimetres(tmp_path):
    text = (
        "110001+0000EST1 84..10+00001000 85..10+00002000 86..10-00000500 88..10+00001550 \r\n"
        "110002+00000101 21.322+10000000 22.322+10000000 31..00+00006500 51..1.+0012+000 "
        "87..10+00000000 71....+000WALL1 \r\n"
        "410003+00000012 42....+00001810 \r\n"
        "110004+00000102 21.322+20000000 22.322+09000000 31..00+00006600 71....+0000WALL\r\n"
    )
    found, tables = read(tmp_path, text)
    assert [(one["setup"], one["station"], one["instrument_height_m"]) for one in tables["setups"]
            ] == [("EST1", "EST1", "1.550")]  # fmt: skip
    assert [list(one.values()) for one in tables["wall_hits"]] == [
        ["EST1", "90.000", "90.000", "6.500"],
        ["EST1", "180.000", "81.000", "6.600"],
    ]
    assert list(tables["control"][0].values()) == ["EST1", "1.000", "2.000", "-0.500"]
    assert {"gsi_codes_not_used", "ppm_in_distances"} <= codes(found.summary)


CODED = (
    "410001+00000021 42....+0000EST1 43....+00001500 \n"
    "110002+00000101 21.322+10000000 22.322+10000000 31..00+00006500 \n"
    "410003+WALL     42....+00000000 43....+00000000 \n"
    "110004+00000102 21.322+20000000 22.322+09000000 31..00+00006600 71....+---?---- \n"
    "410005+00000021 42....+0000EST2 43....+00001700 \n"
    "110006+00000103 21.322+20000000 22.322+09000000 31..00+00006600 41....+0000WALL \n"
)


@pytest.mark.parametrize(("choices", "hits"), [
    ({"codes": "before"}, [("EST1", "180.000"), ("EST2", "180.000")]),
    ({"codes": "after"}, [("EST1", "90.000"), ("EST2", "180.000")]),
    ({}, [("EST2", "180.000")]),
])  # fmt: skip
def test_code_blocks_of_gsi_mean_what_the_surveyor_says(tmp_path, choices, hits):
    found, tables = read(tmp_path, CODED, station_code="21", **choices)
    assert [(one["setup"], one["direction_deg"]) for one in tables["wall_hits"]] == hits
    assert [one["instrument_height_m"] for one in tables["setups"]][-1] == "1.700"
    assert ("gsi_codes_not_used" in codes(found.summary)) == (not choices)


def test_a_station_of_a_code_block_has_a_name_and_digits_for_its_height(tmp_path):
    text = CODED.replace("42....+0000EST1", "42....+00000000").replace("+00001700", "+000017,0")
    with pytest.raises(InputError) as told:
        read(tmp_path, text, station_code="21")
    assert [(one.expected.code, one.row) for one in told.value.problems] == [
        ("gsi_station_name", 1), ("no_plain_number", 5)
    ]  # fmt: skip
    with pytest.raises(InputError) as told:
        read(tmp_path, CODED + "*\n", station_code="21")
    assert [(one.expected.code, one.row) for one in told.value.problems] == [("no_gsi_line", 7)]


def test_several_blocks_of_gsi_on_one_line(tmp_path):
    """As a file came whose ends of lines were lost; more than a line of other formats may have."""
    lines = CODED.splitlines()
    wanted = read(tmp_path, CODED, station_code="21")[1]
    assert read(tmp_path, "".join(lines), station_code="21")[1] == wanted
    wide = "".join(
        f"*11{n:04d}+{n:016d} 21.322+{n * 100000:016d} 22.322+{10000000:016d} 31..00+{6500:016d} "
        for n in range(1, 101)
    )
    assert len(wide) > 4000
    assert len(read(tmp_path, wide, hits=("*",))[1]["wall_hits"]) == 100


def test_gsi_sexagesimal_and_face_2(tmp_path):
    """12 34 56.7 on face 1, and on face 2 the same with 2 seconds on either circle."""
    text = (
        "*110001+0000000000000W01 21.024+0000000001234567 22.024+0000000009000000 "
        "31..06+0000000000065001\n"
        "*110002+0000000000000W01 21.024+0000000019234587 22.024+0000000027000020 "
        "31..06+0000000000065003\n"
    )
    found, tables = read(tmp_path, text, hits=("W*",))
    (hit,) = tables["wall_hits"]
    assert float(hit["direction_deg"]) == pytest.approx(12 + 34 / 60 + 57.7 / 3600, abs=1e-7)
    assert float(hit["zenith_deg"]) == pytest.approx(90 - 1 / 3600, abs=1e-7)
    assert hit["distance_m"] == "6.5002"
    assert tables["setups"][0]["setup"] == "S1"
    assert codes(found.warnings) == {"no_station"}


def test_gsi_set_ups_change_with_their_station(tmp_path):
    shot = "11000{0}+00000{1} 21.322+0{2}000000 22.322+10000000 31..00+00006500 84..10+0000{3} " \
           "85..10+00000000 86..10+00000000 88..10+0000{4}"  # fmt: skip
    lines = [shot.format(n, 100 + n, n, *where) for n, where in enumerate(
        [("1000", "1500"), ("1000", "1500"), ("2000", "1500"), ("2000", "1600")], 1)]  # fmt: skip
    _, tables = read(tmp_path, "\n".join(lines), hits=("1*",))
    assert [one["setup"] for one in tables["wall_hits"]] == ["S1", "S1", "S2", "S3"]
    assert [one["instrument_height_m"] for one in tables["setups"]] == ["1.500", "1.500", "1.600"]


def test_horizontal_distances_tell_an_angle_that_is_no_zenith_angle(tmp_path):
    text = "110001+00000001 21.322+00000000 22.322+01000000 31..00+00006500 32..00+00006420\n"
    with pytest.raises(InputError) as told:
        read(tmp_path, text, hits=("*",))
    assert codes(told.value.problems) == {"horizontal_unlike_slope"}


# ---- RW5

RW5 = """\
JB,NMTANK,DT07-14-2026,TM08:55:00
MO,AD0,UN1,SF1.00000000,EC0,EO0.0,AU0
--SurvCE
OC,OP1,N 100.0000,E 200.0000,EL10.000,--CP
BK,OP1,BP2,BS0.0000,BC0.0000
LS,HI1.500000,HR0.000000
BD,OP1,FP2,AR0.0000,ZE90.0000,SD5.000000,--BS
SS,OP1,FP101,AR57.1630,ZE89.4305,SD7.393000,--WALL
SS,OP1,FP102,AR237.1650,ZE270.1645,SD7.395000,--WALL
"""


def test_rw5(tmp_path):
    found, tables = read(tmp_path, RW5)
    first, second = tables["wall_hits"]
    assert float(first["direction_deg"]) == pytest.approx(57 + 16 / 60 + 30 / 3600, abs=1e-7)
    assert float(first["zenith_deg"]) == pytest.approx(89 + 43 / 60 + 5 / 3600, abs=1e-7)
    assert float(second["direction_deg"]) == pytest.approx(57 + 16 / 60 + 50 / 3600, abs=1e-7)
    assert float(second["zenith_deg"]) == pytest.approx(89 + 43 / 60 + 15 / 3600, abs=1e-7)
    assert list(tables["control"][0].values()) == ["1", "200.000", "100.000", "10.000"]
    assert {"ties_nothing", "notes"} <= codes(found.summary)


@pytest.mark.parametrize(("field", "direction"), [
    ("AR30.0000", 30.0), ("AL30.0000", 330.0), ("DR30.0000", 210.0), ("DL30.0000", 150.0),
    ("AZ30.0000", 30.0), ("BRS30.0000E", 150.0), ("BRN30.0000W", 330.0),
])  # fmt: skip
def test_horizontal_angles_of_rw5(tmp_path, field, direction):
    text = RW5.replace("AR57.1630", field).replace("BD,", "--BD,").replace("SS,OP1,FP102", "--")
    _, tables = read(tmp_path, text)
    assert float(tables["wall_hits"][0]["direction_deg"]) == pytest.approx(direction, abs=1e-9)


def test_azimuths_beside_angles_of_rw5_are_brought_to_one_zero(tmp_path):
    text = RW5.replace("BS0.0000,BC0.0000", "BS12.0000,BC2.0000")
    text += "SS,OP1,FP103,AZ40.0000,VA10.0000,HD5,--WALL\n"
    _, tables = read(tmp_path, text)
    third = tables["wall_hits"][2]
    assert float(third["direction_deg"]) == pytest.approx(30.0, abs=1e-7)
    assert float(third["zenith_deg"]) == pytest.approx(80.0, abs=1e-7)
    assert float(third["distance_m"]) == pytest.approx(5 / 0.984807753, abs=1e-6)


def test_coordinates_that_differ_matter_where_they_are_needed(tmp_path):
    other = "SP,PN77,N 1.0,E 2.0,EL3.0\nSP,PN77,N 1.5,E 2.0,EL3.0\n"
    _, tables = read(tmp_path, RW5 + other)
    assert len(tables["control"]) == 1
    with pytest.raises(InputError) as told:
        read(tmp_path, RW5 + other.replace("77", "1"))
    assert codes(told.value.problems) == {"imported_known_twice"}
    assert [one.row for one in told.value.problems] == [10, 11]
    _, tables = read(tmp_path, RW5 + other.replace("77", "1"), no_control=True)
    assert "control" not in tables


def test_a_time_belongs_to_the_reading_before_it_alone(tmp_path):
    text = RW5 + "--DT07-14-2026\n--TM09:00:00\n--DT07-14-2026\n--TM12:00:00\n"
    text = text.replace("FP102", "FP103").replace("237.1650,ZE270", "3.0000,ZE70")
    _, tables = read(tmp_path, text)
    assert [one["time"] for one in tables["wall_hits"]] == ["", "2026-07-14T09:00:00"]


def test_a_new_backsight_or_height_is_a_new_set_up_of_rw5(tmp_path):
    again = RW5.split("SF1.0")[1].split("\n", 2)[2]
    _, tables = read(tmp_path, RW5 + again.replace("FP10", "FP20"))
    assert len(tables["setups"]) == 1
    _, tables = read(tmp_path, RW5 + again.replace("FP10", "FP20").replace("HI1.5", "HI1.6"),
                     leave=("2",))  # fmt: skip
    assert [one["setup"] for one in tables["setups"]] == ["1", "1-2"]


# ---- JobXML


def jxl(records):
    return (
        '<?xml version="1.0" encoding="UTF-8"?><JOBFile version="5.7">\n<FieldBook>\n'
        '<StationRecord ID="s"><StationName>A</StationName><TheodoliteHeight>1.5</TheodoliteHeight>'
        f"</StationRecord>\n{records}\n</FieldBook></JOBFile>"
    )


def shot(name, hz, v, sd, more="", deleted="false", method="DirectReading"):
    return (
        f'<PointRecord ID="{name}"><Name>{name}</Name><Code>WALL</Code><Method>{method}</Method>'
        f"<Deleted>{deleted}</Deleted><Circle><HorizontalCircle>{hz}</HorizontalCircle>"
        f"<VerticalCircle>{v}</VerticalCircle><EDMDistance>{sd}</EDMDistance>{more}</Circle>"
        "<StationID>s</StationID></PointRecord>\n"
    )


def test_jobxml_leaves_out_what_was_deleted_and_what_is_a_mean(tmp_path):
    text = jxl(
        shot("1", 10, 90, 6)
        + shot("2", 20, 90, 6, deleted="true")
        + shot("1", 10, 90, 6, method="MeanTurnedAngle")
        + shot("4", 30, 90, 6, method="DistanceOffset")
        + '<NoteRecord ID="n"><Text>x</Text></NoteRecord>'
    )
    found, tables = read(tmp_path, text)
    assert [one["direction_deg"] for one in tables["wall_hits"]] == ["10.000"]
    assert {"deleted", "jxl_means", "jxl_method", "jxl_records"} <= codes(found.summary)


def test_jobxml_in_utf16(tmp_path):
    text = jxl(shot("Ação".encode("ascii", "ignore").decode() or "1", 10, 90, 6))
    _, tables = read(tmp_path, text.replace("UTF-8", "UTF-16").encode("utf-16"))
    assert len(tables["wall_hits"]) == 1


@pytest.mark.parametrize("bomb", [
    '<!DOCTYPE x [<!ENTITY a "aaaa"><!ENTITY b "&a;&a;&a;&a;">]>',
    '<!DOCTYPE x SYSTEM "file:///etc/passwd">',
])  # fmt: skip
def test_jobxml_with_a_document_type_is_refused(tmp_path, bomb):
    text = jxl(shot("1", 10, 90, 6)).replace("<JOBFile", bomb + "<JOBFile")
    with pytest.raises(InputError) as told:
        read(tmp_path, text)
    assert codes(told.value.problems) == {"xml_doctype"}


# ---- SDR


def test_sdr33_as_published(tmp_path):
    """The header and the station of a sample that Total Open Station publishes; shots are ours."""
    text = (
        "00NMSDR33 V04-04.02     00-000-00 00:00 211111\n"
        "10NMJOB3            121111\n"
        "06NM1.00000000      \n"
        "01NM:SET5F V01-00    020078                      31                                0.0\n"
        "13PCP.C. mm Applied:-30.000                                     \n"
        "02TP        00000031509.97000000    937.27400000    20.05300000     1.50500000      11\n"
        "03NM1.60000000      \n"
        "08TP        00000009510.50400000    908.83800000    19.69900000     11              \n"
        "09F1        00000031        000000107.39300000      100.00000000    50.00000000     WALL\n"
    )
    found, tables = read(tmp_path, text)
    assert list(tables["setups"][0].values()) == ["31", "31", "1.505"]
    assert list(tables["wall_hits"][0].values()) == ["31", "45.000", "90.000", "7.393"]
    assert list(tables["control"][0].values()) == ["31", "937.274", "509.970", "20.053"]
    assert {"computed_points", "import_applied"} <= codes(found.summary)


@pytest.mark.parametrize(("zero", "zenith"), [("1", "90.000"), ("2", "0.000")])
def test_sdr33_of_spectra_precision(tmp_path, zero, zenith):
    """A name of 17 characters moves what follows it; the last record is 0000 (shapes as seen)."""
    text = (
        "\n00NMSDR33V04-01     000027-Sep-18 14:20:113121\n"
        f'01KI1Nikon FOCUS 6W 5"900722Nikon FOCUS 6W 5"9007221{zero}     0.000     0.000\n'
        "13NMTemp:20C Press:1013hPa Prism:-30 02-Aug-2018 14:18:36\n"
        "02KI               A4.773           -2.422          0.044           0.000           \n"
        "09F1               A               16.730           90.00000000     10.00000000     WALL\n"
        "0000\n"
    )
    found, tables = read(tmp_path, text)
    assert [one["zenith_deg"] for one in tables["wall_hits"]] == [zenith]
    assert "-30 mm" in found.summary[1]


def test_means_beside_faces_are_left_out_of_sdr(tmp_path):
    head = "00NMSDR33V04-01     000014-Jul-26 08:55 111111\n" + f"02TP{'A':>16}" + "0.0".ljust(
        16) * 4 + "\n"  # fmt: skip
    line = f"{'A':>16}{'1':>16}{'6.0':<16}{'90.0':<16}{'10.0':<16}WALL\n"
    found, tables = read(tmp_path, head + "09F1" + line + "09MC" + line)
    assert len(tables["wall_hits"]) == 1
    assert "means" in codes(found.summary)
    _, tables = read(tmp_path, head + "09MC" + line)
    assert len(tables["wall_hits"]) == 1


# ---- plain tables


def test_columns_by_number_and_vertical_angles_from_the_horizon(tmp_path):
    (tmp_path / "p.toml").write_text(
        'length = "ft"\nangle = "gon"\nvertical = "horizon"\nseparator = " "\nfirst_row = 2\n'
        'station = "A"\ninstrument_height_m = 1.5\n'
        "[columns]\npoint = 1\ndirection = 3\nzenith = 2\ndistance = 4\n"
    )
    _, tables = read(tmp_path, "anything\n1 10 100  20\n2 -10 200 20\n", hits=("*",),
                     profile=tmp_path / "p.toml")  # fmt: skip
    assert [list(one.values()) for one in tables["wall_hits"]] == [
        ["A", "90.000", "81.000", "6.096"],
        ["A", "180.000", "99.000", "6.096"],
    ]


# ---- no station


@pytest.mark.parametrize(("name", "left_out"), [
    ("sdr", ("02",)), ("rw5", ("OC", "LS")), ("rw5", ("OC", "BK", "LS")),
])  # fmt: skip
def test_a_file_without_a_station_says_what_to_fill_in(tmp_path, name, left_out):
    from simulated_fieldbooks import one_stand
    from written_fieldbooks import WRITERS

    lines = WRITERS[name](one_stand()).splitlines(True)
    text = "".join(line for line in lines if not line.startswith(left_out))
    found, tables = read(tmp_path, text)
    assert codes(found.warnings) == {"no_station"}
    assert [one["setup"] for one in tables["setups"]] == ["1"]
    for start, wanted in (("LS", {"no_instrument_height"}), ("OC", {"station_of_readings"})):
        text = "".join(line for line in lines if not line.startswith(start))
        assert codes(read(tmp_path, text)[0].warnings) == (wanted if name == "rw5" else set())


def test_a_missing_station_of_jobxml_is_one_problem(tmp_path):
    text = jxl("".join(shot(str(number), 10 * number, 90, 6) for number in range(1, 9)))
    with pytest.raises(InputError) as told:
        read(tmp_path, text.replace('"s"', '"other"'))
    (problem,) = told.value.problems
    assert (problem.expected.code, problem.expected.values["count"]) == ("jxl_station", 8)


# ---- which is what, and the folder


def test_hits_control_and_what_is_left_are_chosen(tmp_path):
    text = RW5 + "SS,OP1,FP900,AR1.0000,ZE80.0000,SD4.000000,--K\n--DT07-14-2026\n--TM09:00:00\n"
    found, tables = read(tmp_path, text, hits=("101-102",), check=("102",), control=("K",),
                         leave=("2",))  # fmt: skip
    assert [one["use"] for one in tables["wall_hits"]] == ["", "check"]
    assert [(one["target"], one["time"]) for one in tables["control_readings"]] == [
        ("900", "2026-07-14T09:00:00")
    ]
    assert "left_by_choice" in codes(found.summary)


def test_control_targets_may_tie_and_without_hits_all_targets_count(tmp_path):
    from simulated_fieldbooks import one_stand, two_stands
    from written_fieldbooks import rw5

    _, tables = read(tmp_path, rw5(two_stands()), control=("T1",), **TIES)
    assert [(one["setup"], one["target"]) for one in tables["control_readings"]] == [
        ("1", "T1"), ("2", "T1")
    ]  # fmt: skip
    assert len(tables["directions"]) == 8
    _, tables = read(tmp_path, rw5(one_stand()), no_hits=True, leave=("WALL",), **TIES)
    assert len(tables["slope_distances"]) == 8
    assert not {"wall_hits", "control_readings"} & set(tables)


def test_an_end_needs_a_beginning_before_it(tmp_path, capsys):
    book = tmp_path / "book.rw5"
    book.write_text(RW5)
    for times in (["--end", "2026-07-14"], ["--begin", "2026-07-14T09:00", "--end", "2026-07-13"]):
        assert main(["import", str(book), "--out", str(tmp_path / "job"), *times]) == 2
        assert capsys.readouterr().err.startswith("tankcal: --end: expected a time later")
    with pytest.raises(SystemExit):
        main(["import", str(book), "--out", str(tmp_path / "job"), "--begin", "soon"])


def test_times_that_no_file_has_are_said(tmp_path):
    text = RW5 + "BD,OP1,FP2,AR0.0000,ZE90.0000,SD5.000000,--BS\n"
    found, tables = read(tmp_path, text)
    assert "control_readings" not in tables
    assert "again_without_time" in codes(found.summary)
    import datetime

    begin = datetime.datetime(2026, 7, 14, 9)
    _, tables = read(tmp_path, text, begin=begin, end=begin + datetime.timedelta(minutes=3))
    assert [one["time"][11:] for one in tables["control_readings"]] == ["09:00:00", "09:03:00"]


@pytest.mark.slow
def test_an_empty_table_is_filled_in_and_one_with_rows_is_not(tmp_path, capsys):
    job = tmp_path / "job"
    assert main(["new", str(job), "--survey", "wall-hits", "--language", "pt-BR"]) == 0
    settings = (job / "job.toml").read_text(encoding="utf-8")
    settings = settings.replace('separator = ","', 'separator = ";"')
    (job / "job.toml").write_text(settings.replace('decimal = "."', 'decimal = ","'), "utf-8")
    book = tmp_path / "book.rw5"
    book.write_text(RW5)
    assert main(["import", str(book), "--out", str(job)]) == 0
    lines = (job / "wall_hits.csv").read_text(encoding="utf-8").splitlines()
    assert lines[0].startswith("# ")
    assert lines[-2].startswith("1;57,275;89,718055")
    before = {one.name: one.read_bytes() for one in job.iterdir()}
    capsys.readouterr()
    assert main(["import", str(book), "--out", str(job)]) == 2
    errors = capsys.readouterr().err.splitlines()
    assert [line.split(":")[1].strip() for line in errors] == [
        "setups.csv", "wall_hits.csv", "control.csv",
    ]  # fmt: skip
    assert {one.name: one.read_bytes() for one in job.iterdir()} == before
    assert main(["import", str(book), "--out", str(job), "--replace"]) == 0


@pytest.mark.slow
def test_a_folder_without_a_job_is_told_how_to_go_on(tmp_path, capsys):
    """What is printed is followed; with the job there, nothing of it is said."""
    book, out = tmp_path / "book.rw5", tmp_path / "nowhere"
    book.write_text(RW5)
    assert main(["import", str(book), "--out", str(out)]) == 0
    new, again, run = (line.split()[1:] for line in capsys.readouterr().out.splitlines()[-4:]
                       if line.startswith("  tankcal"))  # fmt: skip
    assert new == ["new", f"{out}-job", "--survey", "wall-hits"]
    assert main(new) == 0
    capsys.readouterr()
    assert main(["import", str(book), *again[2:]]) == 0
    assert capsys.readouterr().out.splitlines()[-2:] == ["then", f"  tankcal {' '.join(run)}"]
    assert run == ["run", f"{out}-job"]


def test_the_name_of_a_folder_acts_on_no_terminal(tmp_path, capsys):
    book = tmp_path / "book.rw5"
    book.write_text(RW5)
    assert main(["import", str(book), "--out", str(tmp_path / "\x1b[2Jx")]) == 0
    printed = capsys.readouterr()
    assert "\\x1b[2Jx" in printed.out
    assert "\x1b" not in printed.out + printed.err


def test_json_and_another_language(tmp_path, capsys):
    book = tmp_path / "book.rw5"
    book.write_text(RW5)
    assert main(["import", str(book), "--out", str(tmp_path / "job"), "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert told["exit_status"] == 0
    assert len(told["files"]) == 3
    assert main(["import", str(book), "--out", str(tmp_path / "j"), "--language", "pt-BR"]) == 0
    shown = capsys.readouterr().out
    assert "visadas à parede: 2" in shown
    assert "not recognised" not in shown
