"""The input workbook: it says how it is filled in, and filled in by hand it is the same job."""

import datetime
import shutil

import openpyxl
import pytest
from filled_forms import (
    fill_form,
    first_row,
    headings_of,
    place_of,
    saved_by_libreoffice,
)
from job_builder import SETTINGS, assert_same_job, job_parts, write_folder
from openpyxl.utils import get_column_letter
from spoilt import problems_of

import tankcal
from tankcal.cli import main
from tankcal.errors import InputError
from tankcal.job import load
from tankcal.job.contract import (
    COLUMNS,
    KEYS,
    KINDS,
    REGISTER_KEYS,
    REQUIRED_TABLES,
    SURVEYS,
    columns_of,
)
from tankcal.job.field_values import read_value
from tankcal.job.sheets import is_read
from tankcal.job.starter import write_input_workbook
from tankcal.job.starter.book import (
    EXAMPLES_OF_KEYS,
    EXAMPLES_OF_TABLES,
    LONGEST_LIST,
    LONGEST_MESSAGE,
    LONGEST_TITLE,
    rule_of,
)
from tankcal.job.starter.texts import TABLE_NOTES, english_notes, split_unit, texts_in
from tankcal.job.starter.writing import STRAPPED, Form
from tankcal.record import record_of
from tankcal.text.shipped import LANGUAGES
from tankcal.text.words import load_words

FORMS = [
    *((kind, None) for kind in KINDS),
    *(("vertical", survey) for survey in SURVEYS),
    *((kind, "liquid") for kind in KINDS if kind != "vertical"),
]
FORMS_IN_LANGUAGES = [  # as a study: each form in each language
    pytest.param(*form, language, marks=() if is_sampled else pytest.mark.study)
    for form in FORMS
    for language in LANGUAGES
    for is_sampled in (language == "en" or form == ("vertical", "photos"),)
]


def keys_of(words, path=""):
    """Every key of a dict of dicts, dotted."""
    for key, value in words.items():
        if isinstance(value, dict):
            yield from keys_of(value, f"{path}{key}/")
        else:
            yield f"{path}{key}"


@pytest.fixture(scope="module")
def filled(tmp_path_factory):
    """A workbook of a vertical tank, filled in like the job of job_builder, and that job."""
    folder = tmp_path_factory.mktemp("filled")
    parts = job_parts(noise_mm=2.0, sd_mm=1.5, uncertainty=[("datum", 1.0, "mm")])
    for row in parts.tables["points"][1:]:
        row[1:4] = [round(value, 6) for value in row[1:4]]  # LibreOffice saves 15 digits
    path = write_input_workbook(folder / "form.xlsx")
    fill_form(path, parts.settings, parts.tables)
    return path, write_folder(folder / "job", parts)


@pytest.fixture
def form(filled, tmp_path):
    """A copy of that workbook to be spoilt, and the job."""
    path, job = filled
    return shutil.copy(path, tmp_path / "form.xlsx"), job


# ---- the words


@pytest.mark.slow(after=1)
@pytest.mark.parametrize("language", LANGUAGES[1:])
def test_a_language_has_every_text_and_every_note(language):
    english, words = load_words("en")["input"], load_words(language)["input"]
    assert "notes" not in english  # they stand beside the contract
    assert set(keys_of(words)) == set(keys_of(english | {"notes": english_notes()}))
    assert all(text.strip() for text in words["notes"]["columns"].values())


@pytest.mark.parametrize("language", LANGUAGES)
def test_the_texts_fit_the_program(language):
    """Every form can be written, and the reader passes over what explains."""
    texts = texts_in(language)
    for name in ("name", "inputs_name"):
        assert not is_read(texts.of("cover", name))
    assert len(texts.of("expected", "title")) <= LONGEST_TITLE
    for fields in (*KEYS.values(), *COLUMNS.values(), *REGISTER_KEYS.values()):
        for field in fields:
            assert len(texts.expectation(field)) <= LONGEST_MESSAGE
            assert "{" not in texts.expectation(field)
    for table in TABLE_NOTES:
        assert all(texts.heading(field) for field in COLUMNS[table])


@pytest.mark.parametrize("name", EXAMPLES_OF_KEYS)
def test_an_example_of_a_key_may_be_typed_as_it_is(name):
    section, _, key = name.rpartition(".")
    fields = KEYS.get(section) or REGISTER_KEYS[section]
    read_value(next(field for field in fields if field.name == key), EXAMPLES_OF_KEYS[name])


@pytest.mark.parametrize("table", TABLE_NOTES)
def test_an_example_of_a_table_may_be_typed_as_it_is(table):
    fields = {field.name: field for field in COLUMNS[table]}
    for example in EXAMPLES_OF_TABLES[table]:
        for name, value in example.items():
            read_value(fields[name], value)
        needed = {field.name for field in fields.values() if field.required}
        assert needed <= example.keys()


@pytest.mark.parametrize(
    ("name", "stem", "unit"),
    [
        ("height_m", "height", "m"),
        ("tilt_mm_per_m", "tilt", "mm/m"),
        ("K1_mm-2", "K1", "mm⁻²"),
        ("s_arcsec", "s", "″"),
        ("end_a", "end_a", ""),
        ("volume_m3", "volume", "m³"),
    ],
)
def test_the_unit_of_a_name(name, stem, unit):
    assert split_unit(name) == (stem, unit)


# ---- the sheets


@pytest.mark.slow
@pytest.mark.parametrize(("kind", "survey", "language"), FORMS_IN_LANGUAGES)
def test_empty_form_reports_only_what_is_missing(tmp_path, kind, survey, language):
    """Property: explanations and examples, in any language, are not read."""
    path = write_input_workbook(tmp_path / "tank.xlsx", kind, survey, language)
    form, blanks = Form(kind, survey, language), []
    for section, fields in form.keys.items():
        blanks += [f"{section}.{f.name}" for f in fields if form.is_to_fill_in(section, f)]
    problems = problems_of(path)
    told = [one.column for one in problems if one.file == "sheet job"]
    assert set(blanks) <= set(told)
    assert set(told) - set(blanks) <= {"horizontal.diameter_m", "sphere.diameter_m"}
    book = openpyxl.load_workbook(path)
    for one in problems:
        if one.file == "sheet job":
            cell = book["job"][one.cell]
            assert cell.value is None
            assert cell.coordinate == place_of(book["job"], one.column).coordinate
            assert (cell.fill.fgColor.rgb == "FFFFF2CC") == (one.column in blanks)
    others = {one.file: one.expected.split(";")[0] for one in problems if one.file != "sheet job"}
    empty = {"points": "no rows" if survey is None else "missing sheet", "courses": "no rows"}
    empty = {f"sheet {name}": empty[name] for name in REQUIRED_TABLES.get(kind, ())}
    if survey in STRAPPED:  # in place of the points
        empty["sheet circumferences"] = empty.pop("sheet points") and "no rows"
    if survey == "tangents":
        empty["sheet tangents"] = empty.pop("sheet points") and "no rows"
    if survey == "wall-hits":
        empty["sheet wall_hits"] = empty.pop("sheet points") and "no rows"
    if survey == "cloud":
        empty["sheet clouds"] = empty.pop("sheet points") and "nothing filled in"
    if survey == "liquid" and kind == "vertical":
        empty["sheet liquid"] = empty.pop("sheet points") and "no rows"
    if survey == "radii":
        empty["sheet radii"] = empty.pop("sheet points") and "no rows"
    assert others == empty


@pytest.mark.slow
@pytest.mark.parametrize(("kind", "survey"), FORMS)
def test_every_column_has_its_heading_unit_note_example_and_rule(tmp_path, kind, survey):
    path = write_input_workbook(tmp_path / "tank.xlsx", kind, survey)
    book, form, texts = openpyxl.load_workbook(path), Form(kind, survey), texts_in("en")
    for table in form.tables:
        sheet = book[table]
        columns, row = headings_of(sheet)
        assert list(columns) == [field.name for field in columns_of(table, kind)]
        assert sheet.freeze_panes == f"C{row + 1}"
        assert (sheet.page_setup.paperSize, sheet.page_setup.fitToHeight) == (9, 0)
        above = [[cell.value for cell in line] for line in sheet.iter_rows(max_row=row - 1)]
        assert all(line[0].startswith("#") for line in above)
        rules = {str(rule.sqref): rule for rule in sheet.data_validations.dataValidation}
        for field in columns_of(table, kind):
            column = columns[field.name] - 1
            said = [line[column] for line in above]
            assert field.note in said
            assert texts.heading(field) in said
            letter, start = get_column_letter(column + 1), first_row(sheet)
            rule = rules.get(f"{letter}{start}:{letter}1048576")
            given = form.choices(table, field)
            assert (rule is None) == (rule_of(field, given, "A1", texts) is None)
            if rule is not None:
                assert (rule.errorStyle or "stop", rule.error) == ("stop", texts.expectation(field))
            if field.kind == "choice":
                assert rule.formula1 == f'"{",".join(given)}"'
                assert len(rule.formula1) <= LONGEST_LIST + 2
            example = sheet.cell(row + 1, column + 1)
            assert example.value is None or example.font.italic


def test_rules_hold_numbers_to_the_bounds_of_the_contract():
    texts = texts_in("en")
    fields = {field.name: field for field in COLUMNS["courses"]}
    assert rule_of(fields["height_m"], (), "C10", texts)["value"] == (
        "=AND(ISNUMBER(C10),C10>0,C10<=50)"
    )
    paint = rule_of(fields["paint_mm"], (), "E10", texts)
    assert (paint["minimum"], paint["maximum"], paint["error_type"]) == (0, 10, "stop")
    assert paint["error_message"] == "Expected: a number from 0 to 10 (mm)."
    offset = next(one for one in REGISTER_KEYS["instruments"] if one.name == "u_offset_mm")
    assert rule_of(offset, (), "C7", texts)["value"] == (
        '=OR(C7="free",IF(ISNUMBER(C7),AND(ISNUMBER(C7),C7>=0,C7<=10000.0),FALSE))'
    )


@pytest.mark.slow
def test_the_language_of_the_form_is_that_of_the_papers(tmp_path):
    path = write_input_workbook(tmp_path / "tank.xlsx", language="pt-BR")
    fill_form(path, SETTINGS, job_parts().tables)
    assert load(path).table.language == "pt-BR"
    book = openpyxl.load_workbook(path)
    assert book["courses"]["B1"].value == "Anéis"
    assert "fundo" in [cell.value.lower() for cell in book["bottom"][1] if cell.value]


@pytest.mark.slow
def test_the_same_form_has_the_same_bytes(tmp_path):
    one = write_input_workbook(tmp_path / "a.xlsx", survey="photos").read_bytes()
    assert write_input_workbook(tmp_path / "b.xlsx", survey="photos").read_bytes() == one


# ---- where it is written


def test_a_path_of_a_workbook_or_of_a_folder(tmp_path, capsys):
    assert main(["new", str(tmp_path / "x" / "tank.xlsx"), "--workbook", "--kind", "sphere"]) == 0
    assert [path.name for path in (tmp_path / "x").iterdir()] == ["tank.xlsx"]
    assert main(["new", str(tmp_path / "y"), "--workbook"]) == 0
    assert [path.name for path in (tmp_path / "y").iterdir()] == ["job.xlsx"]
    assert f"tankcal run {tmp_path / 'y'}\n" in capsys.readouterr().out


def test_nothing_is_written_over(tmp_path, capsys):
    path = tmp_path / "tank.xlsx"
    path.write_bytes(b"mine")
    assert main(["new", str(path), "--workbook"]) == 2
    assert main(["new", str(tmp_path), "--workbook"]) == 2
    assert path.read_bytes() == b"mine"
    error = capsys.readouterr().err
    assert "tank.xlsx: exists; expected the name of a new workbook" in error
    assert "is not empty" in error


def test_another_language_is_refused(tmp_path):
    with pytest.raises(ValueError, match="found 'fr'; expected one of en, pt-BR, es"):
        write_input_workbook(tmp_path / "tank.xlsx", language="fr")


# ---- filled in


@pytest.mark.slow
@pytest.mark.parametrize("by_way_of", [pytest.param((), marks=pytest.mark.study), ("ods",)])
def test_saved_by_libreoffice_it_is_the_same_job_and_record(form, tmp_path, by_way_of):
    """Second method: the same values in text files."""
    path, folder = form
    book = openpyxl.load_workbook(path)
    place_of(book["job"], "survey.date").value = datetime.date(2024, 5, 31)
    book.save(path)
    workbook, of_files = load(saved_by_libreoffice(path, tmp_path, by_way_of)), load(folder)
    assert_same_job(of_files, workbook)
    records = [record_of(tankcal.run(job)) for job in (of_files, workbook)]
    for record in records:
        for own in ("files", "source"):
            record.pop(own, None)
            record["job"].pop(own, None)
    assert records[0]["capacity"] == records[1]["capacity"]
    assert records[0].keys() == records[1].keys()


@pytest.mark.slow
def test_a_mark_before_a_row_switches_it_off(form):
    path, _ = form
    book = openpyxl.load_workbook(path)
    points = book["points"]
    points.cell(first_row(points) + 2, 1).value = "# doubtful"
    book.save(path)
    assert len(load(path).points.names) == 119


def spoilt(form, change):
    """Problems of the form after change(book)."""
    path, _ = form
    book = openpyxl.load_workbook(path)
    change(book)
    book.save(path)
    return problems_of(path)


TEXT_NUMBERS = {
    "12,5": "type 12,5 again without quotation marks or apostrophe",
    "12.5": "type 12.5 again without quotation marks or apostrophe",
    "１２．５": "type 12.5 again",
    "'12.5": "type 12.5 again",
    "12 m": "type 12 alone, the unit is in the heading",
    "12,5m": "type 12,5 alone, the unit is in the heading",
    "1.234,5": "without marks between thousands",
    "twelve": "expected a number",
}


@pytest.mark.slow
def test_a_number_typed_as_text(form):
    def change(book):
        sheet = book["points"]
        for row, text in enumerate(TEXT_NUMBERS, first_row(sheet)):
            sheet.cell(row, 3).value, sheet.cell(row, 3).number_format = text, "@"

    problems = spoilt(form, change)
    for problem, (text, words) in zip(problems, TEXT_NUMBERS.items(), strict=True):
        place, _, said = str(problem).partition(": ")
        assert place == f"form.xlsx, sheet points, cell C{problem.row}, x_m"
        assert said.startswith(f"found the text '{text}'; expected a number")
        assert words in said


def set_cell(sheet, cell, value, number_format=None):
    def change(book):
        book[sheet][cell] = value
        if number_format:
            book[sheet][cell].number_format = number_format

    return change


def hide_row(book):
    book["points"].row_dimensions[12].hidden = True
    book["points"].row_dimensions[13].hidden = True


def hide_column(book):
    book["points"].column_dimensions["E"].hidden = True


def hide_sheet(book):
    book["uncertainty"].sheet_state = "hidden"


def merge(book):
    book["courses"].merge_cells("C11:C12")


def retitle(title):
    def change(book):
        book["deadwood"].title = title

    return change


MISTAKES = [
    (set_cell("courses", "C12", "#REF!"), "sheet courses, cell C12, height_m", "shows '#REF!'"),
    (
        set_cell("courses", "C12", "=1+0.9"),
        "sheet courses, cell C12, height_m",
        "without its result",
    ),
    (
        set_cell("courses", "C12", 0.19, "0.0%"),
        "sheet courses, cell C12, height_m",
        "found the percentage 19 %; expected a number above 0, at most 50 without percent format"
        " (the cell holds 0.19)",
    ),
    (
        set_cell("courses", "C12", datetime.date(2024, 12, 5)),
        "sheet courses, cell C12, height_m",
        "found the date 2024-12-05",
    ),
    (set_cell("courses", "C12", True), "sheet courses, cell C12, height_m", "truth value"),
    (set_cell("courses", "C7", "course"), "sheet courses, cell C7, course", "is given twice"),
    (set_cell("courses", "E7", "pant_mm"), "sheet courses, cell E7, pant_mm", "mean paint_mm?"),
    (set_cell("points", "A14", "x"), "sheet points, cell A14", "expected nothing there, or #"),
    (merge, "sheet courses, row 11", "the cells C11:C12 are merged"),
    (hide_row, "sheet points, row 12", "the rows 12 to 13 are hidden"),
    (hide_column, "sheet points", "column E is hidden"),
    (hide_sheet, "sheet uncertainty", "the sheet is hidden"),
    (retitle("dedwood"), "form.xlsx", "unknown sheet 'dedwood' (did you mean deadwood?)"),
    (retitle("Corpos"), "form.xlsx", "name it '# notes' to keep it"),
]


@pytest.mark.slow
@pytest.mark.parametrize(("change", "place", "words"), MISTAKES)
def test_each_mistake_names_its_sheet_and_cell(form, change, place, words):
    told = [str(problem) for problem in spoilt(form, change)]
    here = [
        line
        for line in told
        if line.removeprefix("form.xlsx, ").startswith(f"{place}: ") and words in line
    ]
    assert len(here) == 1, told


@pytest.mark.slow
@pytest.mark.parametrize(
    ("value", "words"),
    [
        ("31/05/2024", "found '31/05/2024'; expected a date such as 2024-05-31"),
        ("31 de maio", "expected a date"),
        (45443, "found 45443; expected a date such as 2024-05-31: give the cell a date format"),
    ],
)
def test_a_date_that_is_none(form, value, words):
    def change(book):
        cell = place_of(book["job"], "survey.date")
        cell.value, cell.number_format = value, "General"

    (problem,) = spoilt(form, change)
    assert problem.column == "survey.date"
    assert problem.cell == f"C{problem.row}"
    assert words in problem.expected


@pytest.mark.slow
def test_all_mistakes_come_in_one_run(form):
    def change(book):
        set_cell("courses", "D11", "12 mm")(book)
        set_cell("points", "C13", None)(book)
        merge(book)
        retitle("dedwood")(book)
        place_of(book["job"], "survey.side").value = "outsid"

    told = "\n".join(str(problem) for problem in spoilt(form, change))
    for words in (
        "sheet courses, cell D11, thickness_mm: found the text '12 mm'",
        "sheet points, cell C13, x_m: blank; expected a number",
        "C11:C12 are merged",
        "unknown sheet 'dedwood'",
        "survey.side: found 'outsid'; expected 'outside' or 'inside' (did you mean outside?)",
    ):
        assert words in told


def test_a_blank_form_is_no_job(tmp_path):
    path = write_input_workbook(tmp_path / "tank.xlsx")
    with pytest.raises(InputError, match=r"sheet job, cell C7, tank\.id: blank"):
        load(path)
