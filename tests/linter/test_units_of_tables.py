"""Units, factors and countries in headings: applied exactly, or refused by name."""

import openpyxl
import pytest
from tables_of_others import (
    AREA_M2,
    BARREL,
    FOOT_M,
    IMPERIAL_GALLON,
    INCH_M,
    LITRE,
    US_GALLON,
    columns,
    volumes,
)

from tankcal.errors import InputError
from tankcal.job.tables import Log
from tankcal.products.linter.linting import lint
from tankcal.products.linter.units import heading_of
from tankcal.products.recalibration.reading import read_rows
from tankcal.text.words import load_words, say

CM = [k / 100 for k in range(101)]


def write(folder, text, name="table.csv"):
    path = folder / name
    path.write_text(text, encoding="utf-8")
    return path


def assert_refused(folder, text, *words):
    """One line, with the place, and not a guess."""
    with pytest.raises(InputError) as error:
        lint(write(folder, text))
    assert len(error.value.problems) == 1
    for word in words:
        assert word in str(error.value)


@pytest.mark.slow(after=21)
@pytest.mark.parametrize(
    ("heading", "size"),
    [
        ("Volume (m³)", 1),
        ("Volume [m^3]", 1),
        ("metros cúbicos", 1),
        ("Capacidade, kL", 1),
        ("Volume (L)", LITRE),
        ("Volumen en litros", LITRE),
        ("Volume (dm³)", LITRE),
        ("hl", 100 * LITRE),
        ("Volume_daL", 10 * LITRE),
        ("decalitros", 10 * LITRE),
        ("Volume (mL)", LITRE / 1000),
        ("cm³", LITRE / 1000),
        ("BBLS", BARREL),
        ("barriles", BARREL),
        ("Volume (kbbl)", 1000 * BARREL),
        ("Volume (UK gal)", IMPERIAL_GALLON),
        ("Imp. gal.", IMPERIAL_GALLON),
        ("Gallons (Imperial)", IMPERIAL_GALLON),
        ("galões imperiais", IMPERIAL_GALLON),
        ("Galones ingleses", IMPERIAL_GALLON),
        ("igal", IMPERIAL_GALLON),
        ("U.S. gallons", US_GALLON),
        ("USG", US_GALLON),
        ("Galões (EUA)", US_GALLON),
        ("galones EE.UU.", US_GALLON),
        ("Volume (cu ft)", FOOT_M**3),
        ("cu. ft.", FOOT_M**3),
        ("Volume, ft³", FOOT_M**3),
        ("pés cúbicos", FOOT_M**3),
        ("pies cúbicos", FOOT_M**3),
        ("cubic inches", INCH_M**3),
        ("Volume (10 L)", 10 * LITRE),
        ("Volume (x 10 L)", 10 * LITRE),
        ("Volume ×10 L", 10 * LITRE),
        ("Volume (L x 1000)", 1),
        ("Volume (10³ L)", 1),
        ("Volume (1,000 L)", 1),
        ("milhares de litros", 1),
        ("miles de litros", 1),
        ("Thousands of US gallons", 1000 * US_GALLON),
        ("Volume (x 0.1 m3)", 100 * LITRE),
        ("Volume (100's L)", 100 * LITRE),
        ("Volume ('000 L)", 1),
        ("Volume, 000’s L", 1),
        ("V/L", LITRE),
        ("GOV at 15 °C (L)", LITRE),
        ("Volume (net), bbl at 60F", BARREL),
    ],
)
def test_volumes_of_every_unit_are_exact(heading, size, tmp_path):
    """The same tank in each unit gives the same volumes to 1e-9."""
    heading = f'"{heading}"' if "," in heading else heading
    text = columns(f"Height (cm),{heading}", range(101), volumes(CM, size, 12))
    log = Log()
    rows, report = read_rows(write(tmp_path, text), log)
    assert not report.errors, [str(one) for one in report.findings]
    assert log.problems == []
    assert rows.height_m == pytest.approx(CM, abs=1e-12)
    truth = [AREA_M2 * h for h in CM]
    assert rows.volume_m3 == pytest.approx(truth, rel=1e-9)


@pytest.mark.slow(after=16)
@pytest.mark.parametrize(
    ("heading", "size"),
    [
        ("Height (m)", 1),
        ("Altura (mts)", 1),
        ("dm", 0.1),
        ("Nível (cm)", 0.01),
        ("h/mm", 0.001),
        ("Altura (pulg.)", INCH_M),
        ("Medição (pol)", INCH_M),
        ('Dip (")', INCH_M),
        ("Altura (pés)", FOOT_M),
        ("pies", FOOT_M),
        ("Level (1/8 in)", INCH_M / 8),
        ("Level (⅛ in)", INCH_M / 8),
        ("Dip (1/16 inch)", INCH_M / 16),
        ('Dip (1/8")', INCH_M / 8),
        ("Dip (in/8)", INCH_M / 8),
        ("Eighths of an inch", INCH_M / 8),
        ("oitavos de polegada", INCH_M / 8),
        ("dieciseisavos de pulgada", INCH_M / 16),
        ("Height (10 cm)", 0.1),
        ("Height (x 5 mm)", 0.005),
        ("Dip (x 0.1 in)", INCH_M / 10),
        ("Dip (half inch)", INCH_M / 2),
        ("Nível (meia polegada)", INCH_M / 2),
        ("Sonda (cuartos de pulgada)", INCH_M / 4),
        ("Dip (c.m.)", 0.01),
        ("Dip M.M.", 0.001),
    ],
)
def test_heights_of_every_unit_are_exact(heading, size, tmp_path):
    heights = [k * float(size) for k in range(121)]
    heading = heading.replace('"', '""')
    text = columns(f'"{heading}",Volume (L)', range(121), volumes(heights))
    log = Log()
    rows, report = read_rows(write(tmp_path, text), log)
    assert not report.errors, [str(one) for one in report.findings]
    assert rows.height_m == pytest.approx(heights, rel=1e-12, abs=1e-12)
    assert rows.volume_m3 == pytest.approx([AREA_M2 * h for h in heights], rel=1e-9, abs=1e-11)


@pytest.mark.parametrize(
    ("heading", "unit", "kind"),
    [
        ("Content (kg)", "kg", "a mass"),
        ("Content_kg", "kg", "a mass"),
        ("kg", "kg", "a mass"),
        ("Capacidade em toneladas", "toneladas", "a mass"),
        ("Volume (t)", "t", "a mass"),
        ("Volume [MT]", "MT", "a mass"),
        ("Contenido; libras", "libras", "a mass"),
        ("Volume (%)", "%", "a percentage"),
        ("Volume %", "%", "a percentage"),
        ("Capacidade (por cento)", "percent", "a percentage"),
        ("Volume (V)", "V", "a signal"),
        ("Volume (mA)", "mA", "a signal"),
        ("Volume (kPa)", "kPa", "a pressure"),
        ("Volume (quarts)", "quarts", "not a unit that is read"),
        ("Volume (xyz)", "xyz", "not a unit that is read"),
        ("Volume (ML)", "ML", "several meanings"),
        ("Volume (Mbbl)", "Mbbl", "several meanings"),
        ("Volume (MCF)", "MCF", "several meanings"),
        ("Imperial barrels", "barrels", "several meanings"),
        ("Volume (beer barrels)", "barrels", "several meanings"),
        ("Volume (μL)", "μL", "not a unit that is read"),
        ("Volume (kg/L)", "kg/l", "not a unit that is read"),
        ("Volume (L) or gal", "l gal", "two units"),
        ("Volume (cm)", "cm", "a length"),
    ],
)
def test_units_of_no_volume_are_refused_by_name(heading, unit, kind, tmp_path):
    text = columns(f"Height (cm);{heading}", range(101), volumes(CM, decimals=2), separator=";")
    if ";" in heading:
        text = text.replace("Contenido; libras", '"Contenido; libras"')
    assert_refused(tmp_path, text, "table.csv, row 1", f"the unit {unit}, ", kind, "m3, L, hL")


@pytest.mark.parametrize(
    "heading", ["Level (mV)", "Level (%)", "Nível, kPa", "Level (V)", "Dip (µm)"]
)
def test_units_of_no_height_are_refused_by_name(heading, tmp_path):
    text = columns(f"{heading};Volume (L)", range(101), volumes(CM, decimals=2), separator=";")
    assert_refused(tmp_path, text, "row 1", "found the unit", "m, dm, cm, mm, in, ft")


@pytest.mark.parametrize("number", ["Volume (x1000)", "Volume (1000)", "Volume (15 L)"])
def test_a_number_that_may_be_a_factor_is_refused(number, tmp_path):
    text = columns(f"Height (cm),{number}", range(101), volumes(CM, decimals=2))
    assert_refused(tmp_path, text, "row 1", "perhaps a factor")


@pytest.mark.parametrize(
    ("heading", "decimals", "digits", "found"),
    [("Height (cm),Volume (10 L)", 0, -1, "12570"), ("Height (1/4 in),Volume (L)", 2, 2, "0.25")],
)
def test_a_factor_that_may_be_the_rounding_is_refused(heading, decimals, digits, found, tmp_path):
    heights = CM if "cm" in heading else [float(k * INCH_M / 4) for k in range(101)]
    cells = [f"{round(AREA_M2 * h * 1000, digits):.{decimals}f}" for h in heights]
    labels = range(101) if "cm" in heading else [k / 4 for k in range(101)]
    assert_refused(tmp_path, columns(heading, labels, cells), "factor", found, "rounding")
    explicit = heading.replace("(10 L)", "(x 10 L)").replace("(1/4 in)", "(in)")
    assert lint(write(tmp_path, columns(explicit, labels, cells))).errors == 0


@pytest.mark.parametrize(
    ("heading", "size"),
    [
        ("Dip (0.1 in)", INCH_M / 10),
        ("Dip (0.01 in)", INCH_M / 100),
        ("Volume (100's L)", 100 * LITRE),
        ("Volume ('000 L)", 1),
        ("Dip (half inch)", INCH_M / 2),
        ("Dip (c.m.)", 0.01),
    ],
)
def test_factors_of_headings(heading, size):
    """The factor before "in" is not dropped, as it was with "in" taken for a preposition."""
    assert heading_of(heading).unit == pytest.approx(size, rel=1e-12)


@pytest.mark.parametrize("heading", ["Dip (16ths)", "Dip (0.3 in)", "Dip (15 in)"])
def test_factors_of_headings_that_are_refused(heading):
    assert "perhaps a factor" in str(heading_of(heading).named.complaint)


def test_units_in_a_row_of_their_own(tmp_path):
    body = columns("", range(101), volumes(CM, decimals=2))
    for rows, total in (
        ("Height,Content\ncm,L", 12.57),
        ("Height,Content\n[cm],[x 10 L]", 125.66),
        ("cm,L\nHeight,Content", 12.57),
        ("Dip,Contents\n(cm),(ft³)", 12566.37 * 0.028316847),
    ):
        (line,) = lint(write(tmp_path, rows + body)).summaries
        assert "101 rows, 0 to 1 m" in line
        assert float(line.split("total ")[1].split()[0]) == pytest.approx(total, rel=1e-3)
    for rows in ("Height,Content\ncm,kg", "cm,kg\nHeight,Volume", "Height,Volume\n(cm),(%)"):
        assert_refused(tmp_path, rows + body, "row 1", "found the unit")
    assert_refused(tmp_path, "Height,Content\ncm,xyz" + body, "the unit xyz")


def test_a_title_names_the_unit_where_the_heading_does_not(tmp_path):
    body = columns("Height (cm),Volume", range(101), volumes(CM, decimals=2))
    (line,) = lint(write(tmp_path, "Volumes in hL\n" + body)).summaries
    assert "total 1256.637 m3" in line
    assert_refused(tmp_path, "Contents in kg\n" + body, "row 2", "the unit kg, a mass")
    gallons = body.replace("Volume", "Gallons")
    report = lint(write(tmp_path, "All volumes in imperial gallons\n" + gallons))
    assert report.findings == ()
    assert "total 57.127849 m3" in report.summaries[0]
    plain = lint(
        write(tmp_path, "Tank 5 of 50000 L capacity\n" + body.replace("e\n", "e (L)\n", 1))
    )
    assert "total 12.56637 m3" in plain.summaries[0]


def test_gallons_of_no_country(tmp_path):
    """They are taken as US gallons with a warning, and not computed from undeclared."""
    path = write(tmp_path, columns("Dip (in),Gallons", range(101), volumes(CM, US_GALLON, 1)))
    (finding,) = lint(path).findings
    assert finding.severity == "warning"
    assert "imperial gallons (4.54609 L) give volumes 20 % larger" in str(finding)
    log = Log()
    assert read_rows(path, log)[0] is None
    assert "US gal or imp gal" in str(log.problems[0])


def test_a_column_of_another_unit_gives_way(tmp_path):
    """A percentage or a mass beside volumes in litres is not the column that is read."""
    litres = volumes(CM, decimals=2)
    for heading in (
        "Level (%),Height (cm),Content (kg),Volume (L)",
        "Height (cm),Level (%),Volume (L),Content (kg)",
    ):
        cells = {"%": range(101), "cm": range(101), "kg": litres, "L": litres}
        order = [cells[name.split("(")[1][:-1]] for name in heading.split(",")]
        report = lint(write(tmp_path, columns(heading, *order)))
        assert report.findings == ()
        assert report.summaries == (
            "table.csv: 101 rows, 0 to 1 m, step 0.01 m, total 12.56637 m3",
        )


def test_half_a_heading_is_refused(tmp_path):
    litres = volumes(CM, decimals=2)
    without_volumes = columns("Height (cm),Peso", range(101), litres)
    assert_refused(tmp_path, without_volumes, "row 1", "without a column of volumes")
    without_heights = columns("Pressure,Volume (L)", range(101), litres)
    assert_refused(tmp_path, without_heights, "row 1", "without a column of heights")


def test_volumes_left_of_their_heights(tmp_path):
    text = columns("Volume (L),Height (cm)", volumes(CM, decimals=2), range(101))
    report = lint(write(tmp_path, text))
    assert report.findings == ()
    assert "0 to 1 m, step 0.01 m, total 12.56637 m3" in report.summaries[0]


def test_uncertainties_of_an_unknown_unit_are_refused(tmp_path):
    cells = [range(101), volumes(CM, decimals=2), ["1.0"] * 101]
    assert_refused(tmp_path, columns("Height (cm),Volume (L),U (kg)", *cells), "the unit kg")


def test_units_of_a_workbook(tmp_path):
    book = openpyxl.Workbook()
    for row in (["Height (cm)", "Content (kg)"], *([k, 100.0 * k] for k in range(50))):
        book.active.append(row)
    book.save(tmp_path / "table.xlsx")
    with pytest.raises(InputError, match=r"sheet Sheet, row 1, Content \(kg\): found the unit kg"):
        lint(tmp_path / "table.xlsx")


@pytest.mark.parametrize(
    "heading",
    ["Volume (net)", "Volume, total", "Volume (tank 5)", "Volume V", "Altura (H)", "Volume (1)",
     "Capacidade (produto)", "Volume tank", "Depth (from datum plate)"],
)  # fmt: skip
def test_words_that_are_no_unit(heading):
    named = heading_of(heading)
    assert named.role
    assert not named.named.is_named


def test_refusals_have_all_three_languages():
    complaint = heading_of("Volume (kg)").named.complaint
    for language, words in (("pt-BR", "uma massa; esperado"), ("es", "una masa; se esperaba")):
        assert words in say(load_words(language), complaint)


def test_cases(shared, tmp_path):
    """Tables of the shared cases, with the totals that their texts give."""
    for name, words in (
        ("imperial-gallons", "119 rows, 0 to 2.9972 m, step 0.0254 m, total 37.663901 m3"),
        ("heading-parts-of-an-inch", "241 rows, 0 to 0.762 m, step 0.003175 m"),
        ("inches-with-fractions", "241 rows, 0 to 0.762 m, step 0.003175 m, total 9.57557765 m3"),
        ("table-in-cubic-feet", "99 rows, 0 to 2.98704 m, step 0.03048 m, total 37.5362455 m3"),
    ):
        path = shared / "cases" / name / "table.csv"
        if not path.exists():
            pytest.skip("no shared cases here")
        report = lint(path)
        assert report.errors == 0
        assert words in report.summaries[0]
    with pytest.raises(InputError, match="found the unit kg, a mass"):
        lint(shared / "cases" / "table-in-kg" / "table.csv")
