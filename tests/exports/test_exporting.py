"""Exports: what stands in the file, what is refused, and that no reading errs more than is said."""

import csv
import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from draws import draws
from exported_records import exact_record, lying, record_with, rows, tank_s1, written_record
from linted_tables import DECIMALS, SHAPES, STEPS

from tankcal.cli import main
from tankcal.errors import InputError
from tankcal.products.exports import exporting
from tankcal.products.exports.exporting import export_record, write_export
from tankcal.products.exports.profiles import find_profile, shipped_profiles
from tankcal.record import read, save
from tankcal.tank.dips import table_heights

EDGES = (  # of courses, deadwood, roof and bottoms of the shapes of the linter's tests
    0.0234, 0.15, 0.3, 0.55, 0.9, 1.0, 1.234, 1.6, 1.85, 1.9, 2.0, 2.3766, 2.4, 2.5, 3.8, 4.7,
    5.0, 5.0234, 5.7, 7.01, 7.6, 9.6,
)  # fmt: skip
OURS = replace(find_profile("csv"), grid="breakpoints", level_decimals=6)


@pytest.fixture
def lying_record(tmp_path):
    return exact_record(tmp_path, lying, rows(lying, 2.4, 0.05)[0])


def read_rows(data, separator=";", skipped=1):
    """Rows of numbers of a file, without comments and headings."""
    lines = [one for one in data.decode().splitlines() if not one.startswith("#")][skipped:]
    return [[float(cell) for cell in row] for row in csv.reader(lines, delimiter=separator)]


def codes(error):
    return [one.expected.code for one in error.value.problems]


@pytest.mark.slow(after=1)
@pytest.mark.parametrize("code", sorted(shipped_profiles()))
def test_shipped_profiles_round_trip(code, tmp_path):
    """Property: written, read by the linter, same rows, no finding (else it is refused)."""
    top, step = (2.4, 0.05) if code != "aveva-sixteenths" else (96 * 0.0254, 2 * 0.0254)
    height = table_heights(step, top)
    path = exact_record(tmp_path, lambda h: lying(h, top / 2), height)
    profile = find_profile(code)
    points = None if profile.max_points or profile.grid != "breakpoints" else 20
    export = export_record(path, profile, points=points)
    assert len(export.dip_m) <= (profile.max_points or len(height))
    first = (
        top / profile.parts if profile.grid == "fractions" else 0.0
    )  # fixed levels begin above 0
    assert export.dip_m[[0, -1]].tolist() == pytest.approx([first, top])


def test_each_volume_is_the_rounded_row(lying_record):
    """Second method: the rows of the file are rows of the table, rounded once."""
    export = export_record(lying_record, find_profile("pepperl-fuchs-luc-t10"))
    found = read_rows(export.data)
    assert len(found) == 11
    for dip, litres in found:
        assert litres == round(1000 * float(lying(np.array([dip]))[0]))


def test_points_for_an_error(lying_record):
    few = export_record(lying_record, OURS, max_error_m3=0.2)
    assert few.error_m3 <= 0.2
    assert 8 <= len(few.dip_m) <= 16
    one_less = export_record(lying_record, OURS, points=len(few.dip_m) - 1)
    assert one_less.error_m3 > 0.2


def system_reads(export, dips):
    """What a system with straight lines reads at dips."""
    return np.interp(dips, export.dip_m, export.volume_m3)


def assert_bound_holds(export, volume, top, dips, seed):
    dips = np.random.default_rng(seed).uniform(0, top, dips)
    assert np.abs(system_reads(export, dips) - volume(dips)).max() <= export.error_m3 + 1e-9


@pytest.mark.slow
@pytest.mark.parametrize("shape", ["lying", "deadwood"])
def test_the_bound_holds_at_any_dip(shape, tmp_path):
    """Simulation whose truth is the closed form, not the table: rounding and rows included."""
    volume, top = SHAPES[shape]
    path = exact_record(tmp_path, volume, table_heights(0.05, top), EDGES)
    for points, decimals in ((8, 1), (20, 3)):
        export = export_record(path, replace(OURS, volume_decimals=decimals), points=points)
        assert_bound_holds(export, volume, top, 20_000, points)
        assert export.error_m3 > export.interpolation_m3


@pytest.mark.study
@pytest.mark.parametrize("step", STEPS)
def test_the_bound_holds_on_all_tables_of_the_linter(step, tmp_path, figure):
    """18 shapes (in CI five), so many dips each, three rounding steps; truth: closed forms."""
    most = 0.0
    for n, (volume, top) in list(enumerate(SHAPES.values()))[:: draws(4, 1)]:
        path = exact_record(tmp_path, volume, table_heights(STEPS[step], top), EDGES)
        for decimals in DECIMALS:
            profile = replace(OURS, volume_decimals=decimals)
            export = export_record(path, profile, points=20)
            dips = np.random.default_rng(n).uniform(0, top, draws(200_000, 1_000_000))
            error = np.abs(system_reads(export, dips) - volume(dips)).max()
            assert error <= export.error_m3 + 1e-9
            most = max(most, error / export.error_m3)
    figure(f"largest part of the bound, rows of {step}", f"{most:.4f}")


def test_spline_bound_holds(lying_record):
    from scipy.interpolate import CubicSpline

    export = export_record(lying_record, find_profile("siemens-lut400-spline"), points=12)
    spline = CubicSpline(export.dip_m, export.volume_m3, bc_type="natural")
    dips = np.linspace(0, 2.4, 50_001)
    error = np.abs(spline(dips) - lying(dips)).max()
    assert error <= export.error_m3
    assert error > 0.3 * export.error_m3
    assert np.all(np.diff(spline(dips)) >= 0)
    assert "export_spline" in [one.code for one in export.lines]


@pytest.mark.slow
def test_zero_row_offsets_order_and_marks(lying_record):
    profile = replace(
        find_profile("csv"), level_offset_m=0.25, volume_offset_m3=-0.5, order="descending",
        separator=";", decimal=",", line_end="crlf", volume_decimals=3, encoding="cp1252",
    )  # fmt: skip
    export = export_record(lying_record, replace(profile, level_offset_m=-0.25))
    text = export.data.decode("cp1252").replace(",", ".")
    assert text.count("\r\n") == text.count("\n")
    found = np.array(read_rows(text.encode()))[::-1]
    height = np.arange(49) / 20
    np.testing.assert_allclose(found[:, 0], height + 0.25, atol=1e-12)
    np.testing.assert_allclose(found[:, 1], lying(height) + 0.5, atol=0.0006)
    assert export.error_m3 - export.interpolation_m3 <= 0.000501
    without = export_record(lying_record, replace(find_profile("csv"), zero_row="forbidden"))
    assert read_rows(without.data, ",")[0][0] == 0.05


@pytest.mark.slow
@pytest.mark.parametrize("code", ["aveva-centimetres", "jd-edwards"])
def test_a_highest_row_off_the_marks_is_left_out(tmp_path, code):
    """At the next centimetre it would say 4 mm of the tank too little there: some 30 L."""
    height = np.append(np.arange(240) / 100, 2.396)
    export = export_record(exact_record(tmp_path, lying, height), find_profile(code))
    assert export.dip_m[-1] == pytest.approx(2.39)
    assert export.left_out_m == 2.396
    assert export.rounded_levels == 0
    dips = np.linspace(0.0, 2.39, 5001)
    read = np.interp(dips, export.dip_m, export.volume_m3)
    assert np.abs(read - lying(dips)).max() <= export.error_m3 < 0.02
    assert "export_top_left_out" in [one.code for one in export.lines]


@pytest.mark.slow
def test_increments_of_volume_add_up(lying_record):
    """Property: the increments, summed, are the rounded volumes of the rows."""
    export = export_record(lying_record, find_profile("jd-edwards-increments"))
    found = np.array(read_rows(export.data, ","))
    assert found[:, 0].tolist() == list(range(0, 241, 5))
    exact = 1000 * lying(np.arange(49) / 20)
    assert np.abs(np.cumsum(found[:, 1]) - exact).max() <= 0.5 + 1e-6


@pytest.mark.slow
def test_ullages(tmp_path):
    record = record_with(*rows(lying, 2.4, 0.05))
    record["job"]["datum"]["reference_height_m"] = 2.6
    save(record, tmp_path / "record.json")
    profile = replace(find_profile("csv"), columns=("ullage", "volume"), headings=())
    found = read_rows(export_record(tmp_path / "record.json", profile).data, ",", 0)
    assert found[0][0] == pytest.approx(2.6)
    assert found[-1] == pytest.approx([0.2, 45.2389], abs=1e-4)


def test_feet_and_inches(tmp_path):
    height = table_heights(0.0254 / 16 * 8, 2.0)
    path = written_record(tmp_path, height[:-1], 10 * height[:-1])
    profile = replace(find_profile("csv"), level_unit="ft-in-16", separator=";")
    text = export_record(path, profile).data.decode()
    assert "1' 0 1/2\";3.1750\n" in text


@pytest.mark.slow
def test_provenance(lying_record, tmp_path):
    import hashlib

    text = export_record(lying_record, find_profile("csv"), language="pt-BR").data.decode()
    assert hashlib.sha256(lying_record.read_bytes()).hexdigest() in text
    assert "temperatura de referência" in text
    record = record_with(*rows(lying, 2.4, 0.05)) | {"points": [], "adjustment": None}
    save(record, tmp_path / "theory.json")
    said = [one.code for one in export_record(tmp_path / "theory.json", find_profile("csv")).facts]
    assert "export_theoretical" in said


@pytest.mark.parametrize(
    ("method", "is_theoretical"), [("great_circles", False), ("strapping", False), ("radii", True)]
)
def test_only_tables_without_a_survey_are_theoretical(tmp_path, method, is_theoretical):
    save(record_with(*rows(lying, 2.4, 0.05)) | {"points": [], "adjustment": None}, tmp_path / "r")
    record = replace(read(tmp_path / "r"), surveys={method: object()})
    said = [fact.code for fact in exporting._provenance(record, "")]
    assert ("export_theoretical" in said) == is_theoretical


def test_critical_zone_stands(tmp_path):
    height, volume = rows(tank_s1, 8.4, 0.2)
    record = record_with(height, volume)
    record["capacity"]["for_use"] = [not 1.1 < one < 1.7 for one in height]
    save(record, tmp_path / "record.json")
    export = export_record(tmp_path / "record.json", OURS, points=6)
    assert {1.0, 1.8} <= set(export.dip_m.round(6))


@pytest.mark.slow(after=3)
@pytest.mark.parametrize(
    ("change", "given", "code"),
    [
        ({"max_points": 40, "grid": "every row"}, {}, "export_limit_points"),
        ({"min_points": 12, "max_points": 20}, {"points": 5}, "export_limit_points"),
        ({"max_points": 10}, {"points": 11}, "export_limit_points"),
        ({"digits": 5}, {"points": 9}, "export_limit_digits"),
        ({"largest": 45.0}, {"points": 9}, "export_limit_volume"),
        ({"columns": ("ullage", "volume"), "headings": ()}, {"points": 9}, "export_no_reference"),
        ({}, {}, "export_how_many"),
        ({}, {"max_error_m3": 1e-6}, "export_not_within"),
        ({"grid": "step", "step_m": 0.003}, {}, "export_no_row"),
        ({"grid": "step", "step_m": 1e-9}, {}, "export_many_steps"),
        ({"columns": ("dip", "increment_volume")}, {"points": 9}, "export_increments_only"),
    ],
)  # fmt: skip
def test_what_a_profile_cannot_take_is_refused(change, given, code, lying_record):
    with pytest.raises(InputError) as error:
        export_record(lying_record, replace(OURS, **change), **given)
    assert code in codes(error)


@pytest.mark.parametrize(
    ("height", "volume", "code"),
    [
        ([0, 1, 2, 3], [0, 5, 4, 9], "record_impossible"),
        ([0, 1, 2, 3], [-1, 0, 4, 9], "record_impossible"),
        ([0, 1, 2, 3], [0, 1, 4, 1e90], "record_impossible"),
        ([0, 2, 1, 3], [0, 1, 4, 9], "record_heights"),
        ([0, 1, 2, 1e90], [0, 1, 4, 9], "record_heights"),
        ([0, 1, 1, 3], [0, 5, 6, 9], "record_heights"),
        ([0], [0], "export_bad_heights"),
    ],
)
def test_tables_that_cannot_be_exported(height, volume, code, tmp_path):
    with pytest.raises(InputError) as error:
        export_record(written_record(tmp_path, height, volume), OURS, points=3)
    assert codes(error) == [code]


@pytest.mark.slow(after=6)
@pytest.mark.parametrize("column", ["u_m3", "U_m3", "stated_U_m3", "k", "area_m2"])
@pytest.mark.parametrize("change", [lambda values: values[:-1], lambda values: [-1.0, *values[1:]]])
def test_columns_that_do_not_fit_their_table(column, change, lying_record, tmp_path):
    record = json.loads(Path(lying_record).read_text())
    record["capacity"][column] = change(record["capacity"][column])
    path = tmp_path / "record.json"
    path.write_text(json.dumps(record))
    with pytest.raises(InputError) as error:
        export_record(path, OURS, points=9)
    assert codes(error) == ["record_column"]


@pytest.mark.slow
def test_levels_that_coincide_are_left_out(tmp_path):
    """Rows of 25 mm by a profile of centimetres: every second one stands as it is."""
    path = exact_record(tmp_path, lying, rows(lying, 2.4, 0.025)[0])
    export = export_record(path, find_profile("jd-edwards"))
    assert len(export.dip_m) == 49
    assert export.rounded_levels == 0


# the command line


def test_the_command_writes_file_and_report(lying_record, tmp_path, capsys):
    out = tmp_path / "made" / "tank.csv"
    arguments = ["export", str(lying_record), "--profile", "signet-9900", "--out", str(out)]
    assert main([*arguments, "--language", "es"]) == 0
    assert sorted(one.name for one in out.parent.iterdir()) == ["tank-report.txt", "tank.csv"]
    report = (out.parent / "tank-report.txt").read_text()
    assert report.startswith("10 de las 49 filas")
    assert report.splitlines()[1] in capsys.readouterr().out


@pytest.mark.slow
def test_the_command_as_json_and_list(lying_record, tmp_path, capsys):
    out = str(tmp_path / "t.csv")
    assert main(["export", str(lying_record), "--profile", "csv", "--out", out, "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["points"] == 49
    assert found["error_l"] > 0
    assert main(["export", "--list"]) == 0
    assert len(capsys.readouterr().out.splitlines()) == len(shipped_profiles())


@pytest.mark.slow
@pytest.mark.parametrize(
    "arguments",
    [
        [], ["--profile", "csv"], ["nowhere", "--profile", "csv"], ["RECORD"],
        ["RECORD", "--profile", "nobody"], ["RECORD", "--profile", "signet-9900", "--points", "40"],
        ["RECORD", "--profile", "csv", "--out", "RECORD"],
        ["RECORD", "--profile", "csv", "--gauge-on-shell", "--out", "x.csv"],
    ],
)  # fmt: skip
def test_refusals_leave_what_was_there(arguments, lying_record, capsys):
    before = lying_record.read_bytes()
    given = [str(lying_record) if one == "RECORD" else one for one in arguments]
    assert main(["export", *given]) == 2
    assert capsys.readouterr().err.startswith("tankcal: ")
    assert [one.name for one in lying_record.parent.iterdir()] == ["record.json"]
    assert lying_record.read_bytes() == before


@pytest.mark.slow
def test_both_files_or_none(lying_record, tmp_path):
    """A report that cannot be written leaves no new table behind."""
    export = export_record(lying_record, find_profile("csv"))
    (tmp_path / "t-report.txt").mkdir()
    with pytest.raises(OSError, match="t-report"):
        write_export(export, tmp_path / "t.csv")
    assert not (tmp_path / "t.csv").exists()


@pytest.mark.slow
def test_hytd_of_an_upright_tank(tmp_path):
    """Second method: the line of the gauge is that of the record's own plates and radii."""
    from tankcal.products.exports.exporting import gauge_correction

    record = record_with(*rows(tank_s1, 8.4, 0.2))
    record["choices"] = [one for one in record["choices"] if one["code"] != "head"]
    record["choices"].append({"code": "head", "value": 850.0})
    save(record, tmp_path / "record.json")
    export = export_record(tmp_path / "record.json", OURS, points=8, hangs_on_shell=True)
    plates = [(c["height_m"], c["thickness_m"], c["inside_radius_m"]) for c in record["courses"]]
    assert plates
    expected = gauge_correction(8.4, plates, 850.0, record["job"]["material"]["e_pa"])
    assert export.gauge == expected
    assert "export_hytd" in [one.code for one in export.lines]
    without = export_record(tmp_path / "record.json", OURS, points=8)
    assert without.gauge is None
