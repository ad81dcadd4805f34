"""Former tables: every kind of file gives the same rows in SI; what is not clear is one line."""

import csv
import gzip
import json
import lzma
import random
from pathlib import Path

import numpy as np
import openpyxl
import pytest
from written_pdfs import write_pdf

from tankcal.errors import InputError
from tankcal.products.recalibration.reading import read_former
from tankcal.tank.dips import dip_label

HEIGHT = np.arange(0, 801) / 100
VOLUME = np.round(np.pi * 6.5**2 * HEIGHT, 3)  # closed form
RECORDS = Path(__file__).parents[1] / "records"


def write(path, heading, rows, separator=","):
    text = [heading, *(separator.join(row) for row in rows)]
    path.write_text("\n".join(text) + "\n", encoding="utf-8")
    return path


def plain(path, heading="height_m,volume_m3"):
    rows = ((f"{h:.2f}", f"{v:.3f}") for h, v in zip(HEIGHT, VOLUME, strict=True))
    return write(path, heading, rows)


def in_litres(path):
    rows = [
        (f"{100 * h:.0f}", f"{1000 * v:,.0f}".replace(",", "."))
        for h, v in zip(HEIGHT, VOLUME, strict=True)
    ]
    return write(path, "Altura (cm);Capacidade (L)", rows, ";")


def ullages(path):
    rows = [
        (f"{9.2 - h:.2f}".replace(".", ","), f"{v:.3f}".replace(".", ","))
        for h, v in zip(HEIGHT, VOLUME, strict=True)
    ]
    (path.parent / "former.toml").write_text("[former]\nreference_height_m = 9.2\n")
    return write(path, "Vacío (m);Volumen (m³)", rows, ";")


def workbook(path):
    book = openpyxl.Workbook()
    book.active.append(["Tank 7"])
    book.active.append(["Dip (mm)", "Volume (L)"])
    for h, v in zip(HEIGHT, VOLUME, strict=True):
        book.active.append([round(1000 * h), round(1000 * v)])
    path = path.with_suffix(".xlsx")
    book.save(path)
    return path


def pdf(path):
    """Three pairs of columns a page, the last page shorter; prose, and numbers of pages."""
    rows = [(f"{100 * h:.0f}", f"{1000 * v:.0f}") for h, v in zip(HEIGHT, VOLUME, strict=True)]
    pages = []
    for first in range(0, len(rows), 180):
        words = [(50, 800, "Tank 7, calibrated on 3 May 2014"), (250, 20, f"Page {first} of 3")]
        for across in range(3):
            left = 50 + 170 * across
            part = rows[first + 60 * across : first + 60 * (across + 1)]
            if part:
                words += [(left, 770, "Dip"), (left + 70, 770, "Volume")]
                words += [(left, 760, r"\(cm\)"), (left + 70, 760, "L")]
            for k, (height, volume) in enumerate(part):
                words += [(left, 745 - 11 * k, height), (left + 70, 745 - 11 * k, volume)]
        pages.append(words)
    return write_pdf(pages, path.with_suffix(".pdf"))


MADE = [plain, in_litres, ullages, workbook]


@pytest.mark.parametrize("make", [*MADE, pytest.param(pdf, marks=pytest.mark.slow)])
def test_the_same_rows_out_of_any_file(make, tmp_path):
    path = make(tmp_path / "old.csv")
    toml = tmp_path / "former.toml"
    former = read_former(path, toml if toml.exists() else None)
    assert former.height_m == pytest.approx(HEIGHT, abs=1e-9)
    assert former.volume_m3 == pytest.approx(VOLUME, abs=1e-9)
    assert (former.height_quantum_m, former.volume_quantum_m3) == (0, pytest.approx(0.001))


def test_feet_and_inches(tmp_path):
    with open(tmp_path / "old.csv", "w", newline="") as file:
        rows = csv.writer(file)
        rows.writerow(["dip", "volume, bbl"])
        rows.writerows([dip_label(0.0254 * k, "ft-in-16"), f"{10 * k}.5"] for k in range(60))
    former = read_former(tmp_path / "old.csv")
    assert former.height_m == pytest.approx(0.0254 * np.arange(60))
    assert former.volume_m3[1] == pytest.approx(10.5 * 0.158987294928)


@pytest.mark.parametrize("kind", ["parts", pytest.param("pdf", marks=pytest.mark.slow)])
def test_feet_inches_and_sixteenths(kind, tmp_path):
    rows = [(f"{k // 192}-{k // 16 % 12:02d}-{k % 16:02d}", f"{10 * k}.5") for k in range(120)]
    path = tmp_path / "old.csv"
    if kind == "pdf":
        words = [(50, 770, "Gauge ft-in-16"), (200, 770, "Volume, bbl")]
        for k, row in enumerate(rows[:60]):
            words += [(50, 755 - 11 * k, row[0]), (200, 755 - 11 * k, row[1])]
        path, rows = write_pdf([words], path.with_suffix(".pdf")), rows[:60]
    else:
        write(path, "Gauge ft-in-16,bbl", rows)
    former = read_former(path)
    assert former.height_m == pytest.approx(0.0015875 * np.arange(len(rows)), abs=1e-12)
    assert former.volume_m3[1] == pytest.approx(10.5 * 0.158987294928)


@pytest.mark.slow(after=3)
@pytest.mark.parametrize(
    ("digit", "factor"), [(1, 0.001), (2, 0.002), (5, 0.005), (10, 0.01), (100, 0.1)]
)
def test_the_rounding_is_read_off_the_volumes(tmp_path, digit, factor):
    rows = [
        (f"{h:.2f}", f"{digit * round(1000 * v / digit)}")
        for h, v in zip(HEIGHT, VOLUME, strict=True)
    ]
    former = read_former(write(tmp_path / "old.csv", "dip m,volume L", rows))
    assert former.volume_quantum_m3 == pytest.approx(factor)


@pytest.mark.parametrize(
    ("heading", "said", "U", "k"),
    [
        ("height_m,volume_m3,U_m3,k", ("0.250", "2.1"), 0.25, 2.1),
        ("Altura (m),Volume (m³),Incerteza expandida U (k = 2) (L)", ("250",), 0.25, 2.0),
        ("Dip m,Volume m3,u (L),k", ("100", "2.5"), 0.25, 2.5),
    ],
)
def test_columns_of_uncertainty(tmp_path, heading, said, U, k):
    rows = [(f"{h:.2f}", f"{v:.3f}", *said) for h, v in zip(HEIGHT, VOLUME, strict=True)]
    former = read_former(write(tmp_path / "old.csv", heading, rows))
    assert (former.U_m3[[0, -1]].tolist(), former.k) == (pytest.approx([U, U]), k)


def test_uncertainty_in_percent_is_of_each_volume(tmp_path):
    toml = tmp_path / "former.toml"
    toml.write_text("[former]\nu_percent = 0.1\nk = 3\ncommon = 0.5\n")
    former = read_former(plain(tmp_path / "old.csv"), toml)
    assert former.U_m3 == pytest.approx(0.003 * VOLUME)
    assert (former.k, former.common) == (3, 0.5)


def test_everything_that_may_be_declared(tmp_path):
    plain(tmp_path / "old.csv")
    (tmp_path / "former.toml").write_text(
        '[former]\nfile = "old.csv"\nkind = "vertical"\nreference_temperature_c = 15\n'
        "liquid_density_kg_m3 = 0\nU_m3 = 0.5\nk = 2\nrounding_m3 = 0.01\ndate = 2014-05-03\n"
        'method = "strapping"\nlaboratory = "L"\nnumber = "7/14"\n[roof]\nmass_kg = 42000\n'
        'reference_density_kg_m3 = 850\nweighing = "air"\ncritical_bottom_m = 1\n'
        "critical_top_m = 1.5\n"
    )
    former = read_former(tmp_path / "former.toml")  # names the table's file itself
    assert (former.kind, former.reference_temperature_c, former.liquid_density_kg_m3) == (
        "vertical", 15, 0,
    )  # fmt: skip
    assert (former.volume_quantum_m3, former.date, former.number) == (0.01, "2014-05-03", "7/14")
    roof = former.roof
    assert (roof.mass_kg, roof.weighing, roof.critical_m) == (42000, "air", (1, 1.5))


@pytest.mark.slow
def test_a_record_and_what_is_written_of_it_say_the_same(example_run):
    results = example_run / "results"
    record = read_former(results / "record.json")
    assert record.kind == "vertical"
    assert record.record["format"] == "tankcal-record/2"
    assert (record.factor_m3**2).sum(axis=1) ** 0.5 * record.k == pytest.approx(
        record.record["capacity"]["U_m3"], rel=1e-6
    )
    for name, near in (("capacity.csv", 1e-6), ("capacity.xlsx", 1e-9), ("certificate.pdf", 6e-4)):
        former = read_former(results / name)
        assert former.height_m == pytest.approx(record.height_m, abs=1e-6)
        assert former.volume_m3 == pytest.approx(record.volume_m3, abs=near)
        assert former.U_m3 == pytest.approx(record.U_m3, rel=0.06)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "opened", "kind"),
    [
        ("1/furnished.json.gz", gzip, "vertical"),
        ("1/lying.json.gz", gzip, "horizontal"),
        ("2/silva-1995.json.xz", lzma, "vertical"),
    ],
)
def test_records_of_released_versions(name, opened, kind, tmp_path):
    (tmp_path / "record.json").write_bytes(opened.decompress((RECORDS / name).read_bytes()))
    record = json.loads((tmp_path / "record.json").read_text())
    former = read_former(tmp_path / "record.json")
    assert former.volume_m3.tolist() == record["capacity"]["volume_m3"]
    assert former.kind == kind


# ---- what is refused, and in which words


def refusal(path, toml=None):
    with pytest.raises(InputError) as caught:
        read_former(path, toml)
    return list(map(str, caught.value.problems))


def test_a_table_that_the_linter_calls_wrong(tmp_path):
    path = plain(tmp_path / "old.csv")
    path.write_text(path.read_text().replace("132.732", "132.372"))
    first, finding = refusal(path)
    assert "the table has errors (1)" in first
    assert finding.startswith("old.csv, row 102, volume_m3: found 132.372; expected about 132.732")


def test_warnings_of_the_linter_are_kept(tmp_path):
    path = plain(tmp_path / "old.csv", "height,volume_m3")
    (warning,) = read_former(path).warnings
    assert "no unit in a heading" in str(warning)


def test_all_problems_of_the_declaration_in_one_run(tmp_path):
    toml = tmp_path / "former.toml"
    toml.write_text(
        "[former]\nrefference_height_m = 9\nU_m3 = -1\nu_percent = 0.1\nu_m3 = 0.1\n"
        "liquid_density_kg_m3 = 0.85\ncommon = 2\n[rof]\n[roof]\nmass_kg = 4e4\n"
    )
    said = "\n".join(refusal(plain(tmp_path / "old.csv"), toml))
    for expected in (
        "row 2, former.refference_height_m: unknown key",
        "did you mean reference_height_m?",
        "former.U_m3: found -1",
        "former.u_percent: given together with u_m3",
        "former.liquid_density_kg_m3: found 0.85; expected kg/m3",
        "former.common: found 2; expected a number from 0 to 1",
        "[rof]: unknown section (did you mean roof?)",
        "roof.weighing: missing",
    ):
        assert expected in said


@pytest.mark.parametrize(
    ("make", "toml", "said"),
    [
        (ullages, None, "a table of ullages; expected reference_height_m"),
        (ullages, "reference_height_m = 8", "1.2 m more than reference_height_m"),
        (plain, "height_unit = 'cm'", "the heading says units of 1 m; declared 0.01 m"),
        (plain, "U_m3 = 1", "former.k: missing"),
        (plain, "file = 'new.csv'", "but the table is old.csv"),
        (plain, "sheet = 'A'", "no sheet 'A'"),
        (plain, "volume_column = 'volume'", "did you mean volume_m3?"),
    ],
)
def test_one_clear_line(make, toml, said, tmp_path):
    path = make(tmp_path / "old.csv")
    declared = None
    if toml is not None:
        declared = tmp_path / "declared.toml"
        declared.write_text(f"[former]\n{toml}\n")
    (line,) = refusal(path, declared)
    assert said in line


def test_units_that_are_not_clear_are_asked_for(tmp_path):
    rows = [(f"{k}", f"{10 * k}") for k in range(10, 610, 10)]  # 6 m3 in 0.6 m, or in 6 m
    path, toml = write(tmp_path / "old.csv", "height,volume", rows), tmp_path / "former.toml"
    (line,) = refusal(path)
    assert "height_unit and volume_unit" in line
    toml.write_text("[former]\nheight_unit = 'cm'\nvolume_unit = 'L'\n")
    assert read_former(path, toml).volume_m3[-1] == pytest.approx(6)


def test_a_mark_that_may_be_of_thousands_is_asked_for(tmp_path):
    rows = [(f"{h:.2f}", f"{v:.3f}") for h, v in zip(HEIGHT[:500], VOLUME, strict=False)]
    (line,) = refusal(write(tmp_path / "old.csv", "dip m,volume L", rows))
    assert "found 1.327 in a unit of 0.001 m3" in line


def test_columns_that_differ_are_asked_for(tmp_path):
    rows = [
        (f"{h:.2f}", f"{v:.3f}", f"{1.01 * v:.3f}") for h, v in zip(HEIGHT, VOLUME, strict=True)
    ]
    path = write(tmp_path / "old.csv", "dip m,volume at 15 C m3,volume at 20 C m3", rows)
    (line,) = refusal(path)
    assert "several columns of volumes" in line
    (tmp_path / "former.toml").write_text("[former]\nvolume_column = 'volume at 20 C m3'\n")
    former = read_former(path, tmp_path / "former.toml")
    assert former.volume_m3[-1] == pytest.approx(1.01 * VOLUME[-1], abs=1e-3)


@pytest.mark.slow
def test_a_record_is_not_contradicted(example_record, tmp_path):
    toml = tmp_path / "former.toml"
    toml.write_text("[former]\nreference_temperature_c = 15.5\nU_m3 = 1\nk = 2\n")
    said = refusal(example_record, toml)
    assert len(said) == 3
    assert "but the record has 20" in said[0]


@pytest.mark.slow
@pytest.mark.parametrize(
    "data",
    [b"", b"\0\1\2", b"%PDF-1.4\njunk", b"PK\3\4junk", b"{", b"[" * 100_000, b"height_m,volume_m3",
     b"height_m,volume_m3\n1,2\n", b"height_m,volume_m3\n0,0\n1,nan\n2,inf\n", b"\xff\xfe1\0",
     b"height_m,volume_m3\n" + b"1,1\n" * 9, b"a" * 100_000, b"\n" * 1000],
)  # fmt: skip
def test_no_rubbish_is_more_than_lines(data, tmp_path):
    (tmp_path / "old.csv").write_bytes(data)
    assert all(line.startswith("old.csv") for line in refusal(tmp_path / "old.csv"))


@pytest.mark.slow
def test_spoilt_files_are_read_or_refused(tmp_path):
    rng, path = random.Random(21), tmp_path / "old.csv"
    sound = plain(path).read_bytes()[:2000]
    toml = b"[former]\nU_m3 = 0.5\nk = 2\ndate = 2014-05-03\n[roof]\nmass_kg = 4e4\n"
    for _ in range(300):
        for name, data in (("old.csv", bytearray(sound)), ("former.toml", bytearray(toml))):
            for _ in range(rng.choice((0, 1, 5))):
                place = rng.randrange(len(data))
                data[place : place + rng.randrange(3)] = rng.randbytes(rng.randrange(3))
            (tmp_path / name).write_bytes(data)
        try:
            former = read_former(path, tmp_path / "former.toml")
        except InputError:
            continue
        assert np.all(np.diff(former.height_m) > 0)


@pytest.mark.slow
def test_a_scanned_pdf_is_one_line(tmp_path):
    (line,) = refusal(write_pdf([[]], tmp_path / "old.pdf"))
    assert "is it a scan?" in line
