"""Whole comparisons: the kept example, records with themselves, courses, bad input."""

import gzip
import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from draws import draws
from tables_of_s1 import HEIGHTS, PLATES, RADII, former_s1, new_s1, rings_m3

from tankcal.errors import InputError
from tankcal.products.recalibration.comparison import Asked, compare, compare_files
from tankcal.record.recalibration import COMPARISON, STEPS, ComparisonFile
from tankcal.record.schema import from_plain, to_plain

EXAMPLE = Path(__file__).with_name("comparison.json")
RECORDS = Path(__file__).parents[1] / "records" / "1"
COURSES = HEIGHTS, PLATES
COURSES_CSV = "course,height_m,thickness_mm\n1,1.8,9\n2,1.8,8\n3,1.8,7\n4,1.5,6\n5,1.5,6\n"


def example():
    """The comparison that is kept as an example."""
    dips = np.round(np.arange(0.1, 8.41, 0.05), 3)
    tables = former_s1(dips, digit=0.001), new_s1(dips)
    return compare(*tables, courses=COURSES, fingerprints=("1" * 64, "2" * 64))


def write_example():
    """Keep the example anew."""
    plain = to_plain(example())
    EXAMPLE.write_text(json.dumps(plain, ensure_ascii=False, indent=1) + "\n", encoding="utf-8")


def same(one, two, path=""):
    """Places where plain data differ by more than 1e-9 of themselves."""
    if isinstance(one, dict) and isinstance(two, dict) and set(one) == set(two):
        return [place for key in one for place in same(one[key], two[key], f"{path}.{key}")]
    if isinstance(one, list) and isinstance(two, list) and len(one) == len(two):
        pairs = enumerate(zip(one, two, strict=True))
        return [place for k, (a, b) in pairs for place in same(a, b, f"{path}[{k}]")]
    if isinstance(one, float) and isinstance(two, float):
        return [] if one == pytest.approx(two, rel=1e-6, abs=1e-9) else [path]
    return [] if one == two else [path]


def test_the_example_is_what_is_made():
    """To keep it anew after a change that is meant: `write_example()`."""
    kept = json.loads(EXAMPLE.read_text(encoding="utf-8"))
    made = json.loads(json.dumps(to_plain(example()), allow_nan=False))
    assert same(kept | {"tankcal": ""}, made | {"tankcal": ""}) == []
    assert COMPARISON.migrated(kept, "comparison.json") == kept
    assert to_plain(from_plain(ComparisonFile, kept)) == kept


def test_the_waterfall_adds_up():
    for one in example().waterfall:
        steps = sum(getattr(one, f"{name}_m3") for name in STEPS)
        assert one.former_m3 + steps + one.tank_m3 == pytest.approx(one.new_m3, abs=1e-9)


# ---- records


def unpacked(path, folder):
    to = folder / "record.json"
    to.write_bytes(gzip.decompress(path.read_bytes()))
    return to


@pytest.mark.slow(after=1)
@pytest.mark.parametrize(
    "kind", ["furnished", "uncertain", pytest.param("lying", marks=pytest.mark.slow)]
)
def test_a_record_with_itself(kind, tmp_path):
    """Invariance: nothing differs, whatever the tank has; E_n is 0, and the table is kept."""
    unpacked(RECORDS / f"{kind}.json.gz", tmp_path)
    found = compare_files(Asked(tmp_path, tmp_path / "record.json"))
    assert not np.any(found.rows.d_m3)
    assert np.nanmax(np.abs(found.rows.E_n)) == 0
    assert {one.state for one in found.steps} == {"same"}
    assert all(one.d_m == 0 for one in found.courses)
    assert found.verdict == "keep"
    assert found.former.sha256 == found.new.sha256
    assert (found.former.origin, found.former.U_of_deliveries) == ("record", "record")


# ---- courses


def test_radii_of_courses_that_changed():
    """Closed form: two courses 1 and 2 mm wider, in tables of litres."""
    changes = np.array([0.0, 0.001, 0.0, 0.0, 0.002])
    dips = np.round(np.arange(0.10, 8.395, 0.01), 3)
    tables = [
        replace(
            new_s1(dips, volume_quantum_m3=0.001, common=0.3),
            volume_m3=np.round(rings_m3(dips, radii, 850.0), 3),
        )
        for radii in (RADII, RADII + changes)
    ]
    courses = compare(*tables, courses=COURSES).courses
    off = [one.d_m - change for one, change in zip(courses, changes, strict=True)]
    assert np.abs(off).max() < 5e-6
    assert max(one.u_rounding_m for one in courses) < 3e-6
    radii = np.array([one.new_m for one in courses])
    assert np.abs(radii - RADII - changes).max() < 2e-5
    u = courses[4].u_m  # U of 0.06 % each, c = 0.3, r about 7.2 m
    assert u == pytest.approx(np.sqrt(2 - 0.6) * 0.0003 / 2 * 7.203, rel=0.01)
    assert courses[4].w == pytest.approx(0.002 / u, rel=0.01)


def test_courses_that_no_row_reaches_are_left_out():
    dips = np.round(np.arange(0.10, 5.0, 0.01), 3)
    found = compare(former_s1(dips), new_s1(dips), courses=COURSES)
    assert [one.course for one in found.courses] == [1, 2, 3]


# ---- what cannot be compared


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"kind": "sphere"}, "a sphere tank, but former.csv is of a vertical one"),
        ({"common": 0.3}, "common is 0.3 there and 0.5 for former.csv"),
        ({"volume_m3": 1000 * new_s1().volume_m3}, "m3 at 8.39 m, but 1366.98 m3 in former.csv"),
        ({"height_m": 20 + new_s1().height_m}, "dips from 20.1 to 28.39 m; expected some in"),
    ],
)
def test_tables_that_are_not_of_one_tank(change, words):
    with pytest.raises(InputError) as caught:
        compare(former_s1(), replace(new_s1(), **change))
    assert words in str(caught.value)


def write_tables(folder, **changed):
    """old.csv, new.csv with former.toml of each, courses.csv; returns what to ask."""
    dips = np.round(np.arange(0.10, 8.395, 0.01), 3)
    files = {"courses.csv": COURSES_CSV}
    for name, table in (("old", former_s1(dips, 0.001)), ("new", new_s1(dips))):
        rows = zip(table.height_m, table.volume_m3, strict=True)
        lines = [f"{dip:.2f},{volume:.3f}" for dip, volume in rows]
        files[f"{name}.csv"] = "\n".join(["dip_m,volume_m3", *lines])
        declared = {
            "kind": f'"{table.kind}"', "reference_temperature_c": table.reference_temperature_c,
            "liquid_density_kg_m3": table.liquid_density_kg_m3, "U_percent": 0.1, "k": 2,
            "reference_height_m": table.reference_height_m, "date": table.date,
            "laboratory": f'"{table.laboratory}"',
        }  # fmt: skip
        keys = [f"{key} = {value}" for key, value in declared.items()]
        files[f"{name}.toml"] = "\n".join(["[former]", *keys])
    for name, text in (files | changed).items():
        (folder / name).write_text(text, encoding="utf-8")
    return Asked(
        folder / "old.csv", folder / "new.csv", former=folder / "old.toml",
        new_former=folder / "new.toml", courses=folder / "courses.csv",
    )  # fmt: skip


def test_tables_of_files(tmp_path):
    found = compare_files(write_tables(tmp_path))
    assert found.verdict == "recalibrate"  # by its age
    assert found.zero.height_m == pytest.approx(0.002)
    assert [one.state for one in found.steps[:3]] == ["done"] * 3
    assert len(found.courses) == 5
    assert found.new.laboratory == "Laboratory B"
    assert len(found.former.sha256) == 64 != found.new.sha256
    assert found.courses[0].d_m == pytest.approx(0.0005, abs=5e-6)


def test_tables_of_the_same_name_are_told_apart_by_their_folders(tmp_path):
    asked = write_tables(tmp_path)
    paths = []
    for name, kind in (("old", "vertical"), ("new", "sphere")):
        folder = tmp_path / name / "results"
        folder.mkdir(parents=True)
        (folder / "table.csv").write_text((tmp_path / f"{name}.csv").read_text())
        (folder / "former.toml").write_text(f'[former]\nfile = "table.csv"\nkind = "{kind}"\n')
        paths.append(folder / "former.toml")
    with pytest.raises(InputError) as caught:
        compare_files(replace(asked, old=paths[0], new=paths[1], former=None, new_former=None))
    said = str(caught.value)
    assert said.startswith("new/results/table.csv: ")
    assert "but old/results/table.csv is of a vertical one" in said


@pytest.mark.slow
@pytest.mark.parametrize("end", ["\r\n", "\r"])
def test_former_with_the_line_ends_of_any_system(tmp_path, end):
    asked = write_tables(tmp_path)
    lines = ["# known", "[former]", 'file = "old.csv"', *(tmp_path / "old.toml").read_text()
             .splitlines()[1:]]  # fmt: skip
    (tmp_path / "former.toml").write_text(end.join(lines), newline="")
    known = compare_files(asked)
    found = compare_files(replace(asked, old=tmp_path / "former.toml", former=None))
    assert found.former.sha256 == known.former.sha256
    assert found.courses == known.courses


def test_courses_with_decimal_commas(tmp_path):
    commas = COURSES_CSV.replace(",", ";").replace(".", ",")
    asked = write_tables(tmp_path, **{"courses.csv": commas})
    assert len(compare_files(asked).courses) == 5


def test_all_problems_at_once(tmp_path):
    asked = write_tables(
        tmp_path,
        **{
            "old.csv": "dip_m,volume_m3\n0,0\n1,100\n2,x\n3,300\n4,400\n5,500\n",
            "new.toml": "[former]\nU_percent = 0.1\nk = 2\nreference_temperature_c = 'warm'\n",
            "courses.csv": "course,height_m\n1,1.8\n2,-1\n",
        },
    )
    with pytest.raises(InputError) as caught:
        compare_files(replace(asked, rule="france_2021"))
    places = {one.file for one in caught.value.problems}
    assert {"old.csv", "new.toml", "courses.csv", "--rule"} <= places
    assert "france_2020_recalibration" in str(caught.value)


@pytest.mark.slow(after=2)
@pytest.mark.parametrize("text", ["", "course,height_m,thickness_mm\n", "x\n", "\0", "a;b\n1;2\n"])
def test_courses_that_are_none(text, tmp_path):
    asked = write_tables(tmp_path, **{"courses.csv": text})
    with pytest.raises(InputError) as caught:
        compare_files(asked)
    assert all(one.file == "courses.csv" for one in caught.value.problems)


def test_a_folder_without_a_record(tmp_path):
    (tmp_path / "empty").mkdir()
    with pytest.raises(InputError, match="a folder without record"):
        compare_files(replace(write_tables(tmp_path), new=tmp_path / "empty", new_former=None))


# ---- coverage of the whole


@pytest.mark.study
@pytest.mark.parametrize("c", [0.0, 0.6])
def test_one_comparison_in_twenty_calls_an_unchanged_tank_another(c, figure):
    """Simulation: both tables of S-1 by tapes that are off, correlated by c; rounded to litres.

    Truth: radii times the scale of each tape, volumes by rings; the zero, the temperature and the
    head of the former table are others, and declared.
    """
    rng, count, tape = np.random.default_rng(7), draws(600, 20_000), 1.5e-4
    dips = np.round(np.arange(0.10, 8.395, 0.05), 3)
    common = np.sqrt(c) * tape * rng.normal(size=count)
    scales = common + np.sqrt(1 - c) * tape * rng.normal(size=(2, count))
    beyond = {"top": 0, "delivery": 0}
    for old, new in scales.T:
        tables = []
        for scale, table in ((old, former_s1(dips)), (new, new_s1(dips))):
            if table.liquid_density_kg_m3:
                volumes = rings_m3(dips, RADII * (1 + scale), 850.0)
            else:
                volumes = rings_m3(dips - 0.002, RADII * (1 + scale)) / (1 + 5.5e-5) ** 2
            U = 1.96 * 2 * tape * volumes
            given = {"U_m3": U, "common": c, "volume_quantum_m3": 0.001}
            tables.append(replace(table, volume_m3=np.round(volumes, 3), **given))
        found = compare(*tables, courses=COURSES)
        beyond["top"] += abs(found.rows.E_n[-1]) > 1
        beyond["delivery"] += abs(found.deliveries[0].E_n) > 1
    for name, number in beyond.items():
        rate = 100 * number / count
        figure(f"|E_n| > 1, c = {c}, {name}", f"{rate:.2f} % of {count}")
        assert abs(rate - 5) < max(0.5, 3 * np.sqrt(5 * 95 / count))


def test_a_former_table_of_a_later_day_is_told():
    """Day of the former one after that of the new one: turned round, or a slip."""
    dips = np.round(np.arange(0.1, 8.41, 0.1), 3)
    former, new = former_s1(dips, digit=0.001), new_s1(dips)
    for day, is_told in (("2031-01-01", True), ("2011-01-01", False)):
        pair = replace(former, date=day), replace(new, date="2026-05-31")
        found = compare(*pair, courses=COURSES, fingerprints=("1" * 64, "2" * 64))
        codes = [one.code for one in found.warnings]
        assert ("compare_dates_turned" in codes) is is_told
