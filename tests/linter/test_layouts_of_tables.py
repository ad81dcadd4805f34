"""Dips with fractions or in several columns, tables of ten columns, totals: read or refused."""

import time
from math import pi

import openpyxl
import pytest
from tables_of_others import AREA_M2, BARREL, FOOT_M, INCH_M, US_GALLON, columns, volumes, wide

from tankcal.errors import InputError
from tankcal.job.tables import Log
from tankcal.products.linter.linting import lint
from tankcal.products.recalibration.reading import read_rows

MM = [k / 1000 for k in range(10)]
VULGAR = {1: "¼", 2: "½", 3: "¾"}


def write(folder, text):
    path = folder / "table.csv"
    path.write_text(text, encoding="utf-8")
    return path


def summary(folder, text):
    report = lint(write(folder, text))
    assert report.errors == 0, [str(one) for one in report.findings]
    return report.summaries[0]


def assert_quarters(folder, heading, labels, separator=","):
    """Labels of 161 quarters of an inch give their heights exactly."""
    heights = [float(k * INCH_M / 4) for k in range(161)]
    text = columns(heading, labels, volumes(heights, US_GALLON, 2), separator=separator)
    log = Log()
    rows, report = read_rows(write(folder, text), log)
    assert report.errors == 0
    assert log.problems == []
    assert rows.height_m == pytest.approx(heights, abs=1e-12)
    assert rows.volume_m3 == pytest.approx([AREA_M2 * h for h in heights], abs=2e-5)


@pytest.mark.slow(after=1)
@pytest.mark.parametrize("form", ["{} {}/4", "{} {}\u20444", "{}-{}/4", "{}{}", "{} {}"])
def test_inches_with_fractions(form, tmp_path):
    part = (lambda n: n) if "4" in form else VULGAR.get
    labels = [form.format(k // 4, part(k % 4)) if k % 4 else str(k // 4) for k in range(161)]
    assert_quarters(tmp_path, "Dip (in),US gallons", labels)
    assert_quarters(tmp_path, "Medição (1/4 pol),galões (EUA)", labels)


@pytest.mark.slow
@pytest.mark.parametrize(
    "form", ["{}' {} {}/4\"", "{}'-{} {}/4\"", "{} ft {} {}/4 in", "{}' {}{}\""]
)
def test_feet_and_inches_with_fractions(form, tmp_path):
    part = (lambda n: n) if "/" in form else VULGAR.get
    labels = [
        form.format(k // 48, k // 4 % 12, part(k % 4)) if k % 4 else f"{k // 48}' {k // 4 % 12}\""
        for k in range(161)
    ]
    assert_quarters(tmp_path, "Dip;US gallons", labels, ";")


def test_fractions_without_a_unit_are_inches_with_a_warning(tmp_path):
    labels = [f"{k // 4} {k % 4}/4" for k in range(161)]
    heights = [float(k * INCH_M / 4) for k in range(161)]
    report = lint(write(tmp_path, columns("Dip,Volume (L)", labels, volumes(heights, 0.001, 1))))
    assert [one.severity for one in report.findings] == ["warning"]
    assert "taken as inches" in str(report.findings[0])
    assert "0 to 1.016 m" in report.summaries[0]


def test_fractions_of_feet_and_improper_ones_are_refused(tmp_path):
    labels = [f"{k // 4} {k % 4}/4" for k in range(9)]
    heights = [k / 10 for k in range(9)]
    text = columns("Dip (ft),Volume (L)", labels, volumes(heights, 0.001, 1))
    texts = [str(one) for one in lint(write(tmp_path, text)).findings]
    assert any("row 2, Dip (ft): error: found '0 0/4'" in one for one in texts)
    text = text.replace("(ft)", "(in)").replace("1 3/4", "1 7/4")
    (finding,) = [one for one in lint(write(tmp_path, text)).findings if "proper" in str(one)]
    assert (finding.severity, finding.problem.row) == ("error", 9)


def test_a_heading_of_feet_and_inches_over_plain_numbers_is_refused(tmp_path):
    text = columns("Dip (ft-in),Volume (L)", range(50), volumes([k / 10 for k in range(50)]))
    with pytest.raises(InputError, match="names feet and inches, but the heights are plain"):
        lint(write(tmp_path, text))


@pytest.mark.slow(after=3)
@pytest.mark.parametrize(
    ("heading", "cells", "step_m"),
    [
        ("FT,IN,BBLS", lambda k: (k // 12, k % 12), INCH_M),
        ("Feet,Inches,BBLS", lambda k: ("" if k % 12 else k // 12, k % 12), INCH_M),
        ("Pés,Pol,Barris", lambda k: (k // 12, k % 12), INCH_M),
        ("Pies,Pulgadas,Barriles", lambda k: (k // 12, k % 12), INCH_M),
        ("Dip,,Volume\nft,in,bbl", lambda k: (k // 12, k % 12), INCH_M),
        ("FT,IN,1/8,BBLS", lambda k: (k // 96, k // 8 % 12, k % 8), INCH_M / 8),
        ("FT,IN,16ths,BBLS", lambda k: (k // 192, k // 16 % 12, k % 16), INCH_M / 16),
        (
            "FT,IN,Fraction,BBLS",
            lambda k: (k // 96, k // 8 % 12, f"{k % 8}/8" if k % 8 else ""),
            INCH_M / 8,
        ),
        (
            "FT,IN,BBLS",
            lambda k: (k // 48, f"{k // 4 % 12} {k % 4}/4" if k % 4 else k // 4 % 12),
            INCH_M / 4,
        ),
        ("m,cm,bbl", lambda k: (k // 100, k % 100), 0.01),
        ("cm,mm,bbl", lambda k: (k // 10, k % 10), 0.001),
    ],
)
def test_heights_in_several_columns(heading, cells, step_m, tmp_path):
    heights = [float(k * step_m) for k in range(401)]
    text = columns(heading, *zip(*map(cells, range(401)), strict=True), volumes(heights, BARREL))
    log = Log()
    rows, report = read_rows(write(tmp_path, text), log)
    assert report.errors == 0, [str(one) for one in report.findings]
    assert rows.height_m == pytest.approx(heights, abs=1e-9)
    assert rows.volume_m3 == pytest.approx([AREA_M2 * h for h in heights], abs=1e-9)


def test_one_height_in_two_units_is_not_added_up(tmp_path):
    heights = [k / 100 for k in range(301)]
    feet = [f"{h / float(FOOT_M):.3f}" for h in heights]
    for heading, first, second in (
        ("Height (m),Height (cm),Volume (L)", heights, range(301)),
        ("Dip (m),Dip (ft),Volume (L)", heights, feet),
    ):
        text = columns(heading, first, second, volumes(heights, 0.001, 1))
        assert "301 rows, 0 to 3 m" in summary(tmp_path, text)


def test_parts_of_a_height_that_are_too_large(tmp_path):
    cells = [(k // 12, k % 12 if k != 20 else 15, f"{k / 10:.1f}") for k in range(61)]
    report = lint(write(tmp_path, columns("FT,IN,BBLS", *zip(*cells, strict=True))))
    first = next(one for one in report.findings if one.problem.row == 22)
    assert "found '15' in column 2, a part of a height; expected a number from 0" in str(first)
    cells = [(k // 30, k % 30, f"{k / 10:.1f}") for k in range(61)]
    with pytest.raises(InputError, match="neither one height in two units nor the parts"):
        lint(write(tmp_path, columns("FT,IN,BBLS", *zip(*cells, strict=True))))


@pytest.mark.slow(after=4)
@pytest.mark.parametrize(
    ("heading", "bases", "labels_m", "base_m", "rows"),
    [
        ("cm," + ",".join(f"{k} mm" for k in range(10)), range(30), MM, 0.01, 300),
        ("Altura (cm)," + ",".join(map(str, range(10))), range(30), MM, 0.01, 300),
        ("cm/mm," + ",".join(map(str, range(10))), range(30), MM, 0.01, 300),
        ("cm \\ mm," + ",".join(f"+{k}" for k in range(10)), range(30), MM, 0.01, 300),
        ("dm," + ",".join(f"{k} cm" for k in range(10)), range(30), [k / 100 for k in range(10)],
         0.1, 300),
        ("m," + ",".join(f"{k}0 cm" for k in range(10)), range(9), [k / 10 for k in range(10)], 1,
         90),
        ("m," + ",".join(f"{5 * k} cm" for k in range(20)), range(5), [k / 20 for k in range(20)],
         1, 100),
        ("mm," + ",".join(map(str, range(20))), range(0, 600, 20), [k / 1000 for k in range(20)],
         0.001, 600),
        ("ft," + ",".join(f"{k} in" for k in range(12)), range(10),
         [float(k * INCH_M) for k in range(12)], float(FOOT_M), 120),
        ("Inches,0,1/8,1/4,3/8,1/2,5/8,3/4,7/8", range(40),
         [float(k * INCH_M / 8) for k in range(8)], float(INCH_M), 320),
        ("mm," + ",".join(f"{k} cm" for k in range(30)), range(10), [k / 100 for k in range(30)],
         0.001, 300),
        ("Height (cm),Volume (L)," + ",".join(map(str, range(1, 10))), range(30), MM, 0.01, 300),
        ("Height,Volume (L),,,,,,,,,\ncm," + ",".join(f"{k} mm" for k in range(10)), range(30), MM,
         0.01, 300),
        ("Volumes in litres\ncm," + ",".join(f"{k} mm" for k in range(10)), range(30), MM, 0.01,
         300),
    ],
)  # fmt: skip
def test_columns_that_are_steps_of_the_height(heading, bases, labels_m, base_m, rows, tmp_path):
    """No row is lost: heights and volumes of all cells, against the closed form."""
    report = lint(write(tmp_path, wide(heading, bases, labels_m, base_m)))
    assert report.errors == 0, [str(one) for one in report.findings]
    log = Log()
    text = wide("Volumes in litres\n" + heading, bases, labels_m, base_m)
    found, _ = read_rows(write(tmp_path, text), log)
    assert log.problems == []
    heights = sorted(base * base_m + label for base in bases for label in labels_m)
    assert len(found.height_m) == rows == len(heights)
    assert found.height_m == pytest.approx(heights, abs=1e-9)
    assert found.volume_m3 == pytest.approx([AREA_M2 * h for h in heights], abs=6e-6)


def test_wide_tables_with_commas_pages_and_totals(tmp_path):
    def line(base):
        cells = [f"{AREA_M2 * 1000 * (base / 100 + mm):.2f}".replace(".", ",") for mm in MM]
        return ";".join([str(base), *cells])

    heading = "Altura (cm);" + ";".join(map(str, range(10)))
    first, second = (map(line, part) for part in (range(15), range(15, 30)))
    lines = ["Volumes em litros", heading, *first, heading, *second, "Total" + ";9" * 10]
    assert "300 rows, 0 to 0.299 m" in summary(tmp_path, "\n".join(lines) + "\n")
    lines[-1] = "30;" + line(30).split(";", 1)[1].split(";")[0] + ";" * 9  # the top of the tank
    assert "301 rows, 0 to 0.3 m" in summary(tmp_path, "\n".join(lines) + "\n")


def test_wide_tables_in_a_workbook(tmp_path):
    book = openpyxl.Workbook()
    book.active.append(["Capacity in litres"])
    book.active.append(["cm", *range(10)])
    for base in range(30):
        book.active.append([base, *(round(AREA_M2 * 1000 * (base / 100 + mm), 1) for mm in MM)])
    book.save(tmp_path / "table.xlsx")
    assert "300 rows, 0 to 0.299 m" in lint(tmp_path / "table.xlsx").summaries[0]


@pytest.mark.parametrize(
    ("heading", "columns_of_rows", "words"),
    [
        ("cm," + ",".join(f"{k} mm" for k in range(5)), 5, "do not fill the steps of the rows"),
        ("cm," + ",".join(f"{k} mm" for k in range(11)), 11, "do not fill the steps of the rows"),
        ("Height (cm),Volume (L),,,,,,,,,", 10, "no heading of heights or volumes|expected 2"),
        (None, 10, "no heading, and 11 columns of numbers"),
    ],
)
def test_layouts_that_are_not_clear_are_refused(heading, columns_of_rows, words, tmp_path):
    text = wide(heading or "", range(30), [k / 1000 for k in range(columns_of_rows)], 0.01)
    with pytest.raises(InputError, match=words) as error:
        lint(write(tmp_path, text.lstrip("\n")))
    assert len(error.value.problems) == 1


def test_unnamed_columns_of_a_workbook_are_refused(tmp_path):
    book = openpyxl.Workbook()
    book.active.append(["Height (cm)", "Volume (L)"])
    for base in range(30):
        book.active.append([base, *(round(AREA_M2 * 1000 * (base / 100 + mm), 1) for mm in MM)])
    book.save(tmp_path / "table.xlsx")
    with pytest.raises(InputError, match="9 columns of numbers"):
        lint(tmp_path / "table.xlsx")


def test_columns_of_parts_are_named_and_left_out(tmp_path):
    parts = [f"{AREA_M2 * k:.0f}" for k in range(1, 10)]
    lines = [",".join([str(r), f"{AREA_M2 * 10 * r:.0f}", *parts]) for r in range(30)]
    heading = "Height (cm),Volume (L)," + ",".join(map(str, range(1, 10)))
    report = lint(write(tmp_path, "\n".join([heading, *lines]) + "\n"))
    (finding,) = report.findings
    assert "columns 1 to 9 have parts of a step" in str(finding)
    assert "30 rows, 0 to 0.29 m" in report.summaries[0]


@pytest.mark.parametrize(
    "footer",
    ["Total,12566.37", "TOTAL GERAL,12566.37", "Sum:,633345", "Suma,633345", "Soma,9",
     "Capacidade total,12566.37", "Capacidad máxima,12566", "Max.,12566.37", "Nominal,12500"],
)  # fmt: skip
def test_a_total_row_is_no_row_of_the_table(footer, tmp_path):
    heights = [k / 100 for k in range(101)]
    text = columns("Height (cm),Volume (L)", range(101), volumes(heights, 0.001, 2))
    report = lint(write(tmp_path, text + footer + "\n"))
    assert report.findings == ()
    assert "101 rows, 0 to 1 m" in report.summaries[0]
    odd = lint(write(tmp_path, text.replace("\n50,", "\nxx,")))
    assert "row 52, Height (cm): error: found 'xx'" in str(odd.findings[0])


def test_summaries_of_several_columns_of_volumes_name_them(tmp_path):
    heights = [k / 100 for k in range(101)]
    cells = volumes(heights, 0.001, 2), volumes([0.9 * h for h in heights], 0.001, 2)
    text = columns("Height (cm),Gross volume (L),Net volume (L)", range(101), *cells)
    gross, net = lint(write(tmp_path, text)).summaries
    assert gross.startswith("table.csv, Gross volume (L): 101 rows")
    assert net.startswith("table.csv, Net volume (L): 101 rows")


@pytest.mark.parametrize(
    ("title", "unit"), [("Barrels", BARREL), ("US gallons", US_GALLON), ("Litros", 0.001)]
)
def test_a_title_that_is_a_unit_holds_for_a_wide_table(title, unit, tmp_path):
    """Barrels in the title were taken as cubic metres."""
    cells = [[f"{2 * r + k / 6:.3f}" for r in range(7)] for k in range(12)]
    text = columns("Feet," + ",".join(map(str, range(12))), range(7), *cells)
    report = lint(write(tmp_path, f"{title}\n{text}"))
    assert "no unit" not in str(report.findings)
    total = float(report.summaries[0].split("total ")[1].split()[0])
    assert total == pytest.approx((12 + 11 / 6) * float(unit), rel=1e-4)


# the last row


@pytest.mark.parametrize("share", [0.5, 1.2, 1.5])
def test_a_share_too_much_in_a_last_row_at_a_part_of_a_step(share, tmp_path):
    """3 cm after steps of 10 cm: 0.5 cm of rounding is 17 % of the last interval, not 20 %."""
    labels = [*range(0, 101, 10), 103]
    cells = volumes([k / 100 for k in labels], 0.001, 2)
    true = columns("Height (cm),Volume (L)", labels, cells)
    assert lint(write(tmp_path, true)).findings == ()
    cells[-1] = f"{1000 * AREA_M2 * (1 + 0.03 * share):.2f}"
    (finding,) = lint(write(tmp_path, columns("Height (cm),Volume (L)", labels, cells))).findings
    assert f"row 13, Volume (L): error: found {cells[-1]}; expected about 12943.36" in str(finding)


@pytest.mark.slow(after=4)
@pytest.mark.parametrize("step_m", [0.1, 0.01, 0.001])
@pytest.mark.parametrize("part", [0.04, 0.3, 0.5])
@pytest.mark.parametrize("shape", ["upright", "lying", "sphere"])
def test_an_excess_in_a_last_row_at_a_part_of_a_step(shape, part, step_m, tmp_path):
    """An exact last row is no error; a volume that the interval cannot hold is one."""
    from linted_tables import lying

    volume = {
        "upright": lambda h: AREA_M2 * h,
        "lying": lambda h: float(lying(h)),
        "sphere": lambda h: pi * h**2 * (1.2 - h / 3),
    }[shape]
    whole = {0.1: 18, 0.01: 120, 0.001: 600}[step_m]
    top = round((whole + part) * step_m, 5)
    heights = [k * step_m for k in range(whole + 1)] + [top]
    cells = [f"{1000 * volume(h):.2f}" for h in heights]
    labels = [f"{100 * h:.8g}" for h in heights]
    assert lint(write(tmp_path, columns("Height (cm),Volume (L)", labels, cells))).findings == ()
    last = float(cells[-1])
    for excess in (4 * (last - float(cells[-2])), last):
        wrong = [*cells[:-1], f"{last + excess:.2f}"]
        report = lint(write(tmp_path, columns("Height (cm),Volume (L)", labels, wrong)))
        (finding,) = [one for one in report.findings if one.severity == "error"]
        assert finding.problem.row == whole + 3
        assert f"found {last + excess:.2f}; expected about" in str(finding)


def test_cases(shared):
    folder = shared / "cases"
    if not (folder / "wide-cm-by-mm").exists():
        pytest.skip("no shared cases here")
    feet = lint(folder / "feet-and-inches-in-two-columns" / "table.csv")
    assert feet.findings == ()
    assert "72 rows, 0 to 1.8034 m, step 0.0254 m, total 22.662049 m3" in feet.summaries[0]
    ten = lint(folder / "wide-cm-by-mm" / "table.csv")
    assert ten.errors == 0
    assert "300 rows, 0 to 0.299 m, step 0.001 m, total 3.757 m3" in ten.summaries[0]
    for name, row in (("lint-last-row-mm-table", 303), ("lint-last-row-partial-step", 53)):
        (finding,) = lint(folder / name / "table.csv").findings
        assert (finding.severity, finding.problem.row) == ("error", row)


def test_a_title_over_the_first_page_holds_for_all_pages(tmp_path):
    heights = [k / 100 for k in range(101)]
    cells = volumes(heights, 0.1, 4)
    pages = [
        columns("Height (cm),Volume", range(101)[first : first + 51], cells[first : first + 51])
        for first in (0, 51)
    ]
    assert "total 12.56637 m3" in summary(tmp_path, "Volumes in hL\n" + "".join(pages))


@pytest.mark.parametrize("cell", ["a", ")", "a ", "1/", "m³ ", "10 ", "=k", '"'])
def test_a_cell_of_any_length_is_read_in_no_time(tmp_path, cell):
    """The reader of headings looks for patterns from each letter on: only in short cells."""
    since = time.process_time()
    with pytest.raises(InputError, match="no table found"):
        lint(write(tmp_path, cell * (100_000 // len(cell))))
    assert time.process_time() - since < 20
