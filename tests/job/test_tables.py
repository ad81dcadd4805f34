"""Raw tables from CSV, TOML and workbooks. The truth is what the test wrote into the file."""

import io
import zipfile

import openpyxl
import pytest
from job_builder import job_parts, write_book

from tankcal.job.field_values import read_value
from tankcal.job.fields import Field, Refused
from tankcal.job.folder import parsed_toml, read_csv, read_folder, read_toml
from tankcal.job.sheets import read_workbook
from tankcal.job.tables import MAX_PROBLEMS_PER_FILE, BadCell, Log, nearest, shown
from tankcal.messages import Message
from tankcal.text.words import MESSAGES, load_words


def csv_table(text, separator=",", decimal="."):
    log = Log()
    data = text.encode() if isinstance(text, str) else text
    return read_csv("a.csv", data, separator, decimal, log), log.problems


def test_rows_keep_the_numbers_that_an_editor_shows():
    text = '# a comment, with commas\r\n\r\nname,x_m\r\nA,1\r\n,,\r\n# off\r\n"B, b",2,\r\n'
    table, problems = csv_table(text)
    assert not problems
    assert table.headings == ("name", "x_m")
    assert (table.heading_row, table.row_numbers) == (3, (4, 7))
    assert table.rows == (("A", "1"), ("B, b", "2"))


@pytest.mark.parametrize("start", [b"", b"\xef\xbb\xbf"])
@pytest.mark.parametrize("end", [b"\n", b"\r\n", b"\r"])
def test_byte_order_mark_and_line_ends(start, end):
    table, problems = csv_table(start + end.join([b"name", "é".encode(), b"B"]))
    assert not problems
    assert table.rows == (("é",), ("B",))


def test_spaces_before_quotation_marks_are_ignored():
    table, problems = csv_table(b'"a", "b"\n"1", "x, y"\n')
    assert not problems
    assert (table.headings, table.rows) == (("a", "b"), (("1", "x, y"),))


@pytest.mark.parametrize("blanks", [" ", "  \u00a0 "])
def test_blanks_behind_quotation_marks_are_ignored(blanks):
    text = f'"a"{blanks},b,"c"{blanks}\n"x, ""y"""{blanks},"1" ,2{blanks}\n'
    table, problems = csv_table(text.encode())
    assert not problems
    assert (table.headings, table.rows) == (("a", "b", "c"), (('x, "y"', "1", "2"),))


@pytest.mark.parametrize(
    ("data", "row", "words"),
    [
        (b"", None, "empty"),
        (b"\n,,\n# only a comment\n", None, "empty"),
        (b"a,b\n1,\0\n", 2, "zero byte"),
        ("a,b\n1,2\né,\x01\n".encode("latin-1"), 3, "not UTF-8"),
        ("a,b\n".encode("utf-16")[:-1], 1, "not UTF-8"),
        (b'a,b\n"1,2\n3,4\n', 2, "quotation marks"),
        (b"a,b\n1,2\n3\n", 3, "1 cells, expected 2"),
        (b"a,b\n1,2,3\n", 2, "3 cells, expected 2 as in the heading; for decimal commas"),
        (b"a,b,a\n1,2,3\n", 1, "is given twice"),
        (b"a,,b\n1,2,3\n", 1, "column 2 has no heading"),
    ],
)
def test_unreadable_csv_files(data, row, words):
    _, (problem,) = csv_table(data)
    assert (problem.file, problem.row) == ("a.csv", row)
    assert words in problem.expected


def test_one_bad_row_does_not_hide_the_others():
    table, problems = csv_table('a,b\n1,2\n"3,4\n5\n6,7\n')
    assert [problem.row for problem in problems] == [3, 4]
    assert table.row_numbers == (2, 5)
    assert table.skipped == 2


def test_settings_know_their_rows():
    log = Log()
    text = '# note\n[tank]\nid = "T"\n\n[ "table" ]\nstep_m = 0.01\n[a.b]\nc = 1\n'
    settings, sections = read_toml("job.toml", text.encode(), log)
    assert not log.problems
    assert (settings["tank"]["id"].raw, settings["tank"]["id"].row) == ("T", 3)
    assert (settings["table"]["step_m"].raw, settings["table"]["step_m"].row) == (0.01, 6)
    assert sections == {"tank": 2, "table": 5, "a": None, "a.b": 7}


BROKEN_TOML = (
    "id = [T-1]", 'id = "T', "id = 'T", "id 1", "= 1", "[tank\nid = 1", "[[tank]\n", "id = [1, 2",
    "id = {a = 1", 'id = "1" 2', 'id = "C:\\dir"', 'id = "\\uZZZZ"', 'id = "\\ud800"',
    "id = 2026-02-30",
    "id = 1\nid = 2", "a = {b = 1}\na.c = 2", "a = {b = 1, b = 2}", "id = \"a\x01b\"", "id", "id =",
    "[]", "[a.]", "[a]\n[a]\n", "a = 1\n[a]\n", 'id = """a', "x = [[" + "[" * 3000, "\x01",
)  # fmt: skip


@pytest.mark.slow(after=24)
@pytest.mark.parametrize("language", ["pt-BR", "es"])
@pytest.mark.parametrize("text", BROKEN_TOML, ids=range(len(BROKEN_TOML)))
def test_every_error_of_toml_is_told_in_the_language(text, language):
    log = Log()
    assert parsed_toml("job.toml", text.encode(), log) is None
    reason = log.problems[0].expected.values.get("reason")
    assert isinstance(reason, Message), text
    words = load_words(language)
    assert any(reason.code in words[group] for group in MESSAGES)


@pytest.mark.parametrize(
    ("text", "row", "words"),
    [
        ("[tank]\nid = [T-1]\n", 2, "a text needs quotation marks"),
        ("[tank]\nid = 1\nid = 2\n", 3, "given twice"),
        ("id = 1\n", 1, "is in no [section]"),
        ("x = " + "[" * 3000, None, "too deeply nested"),
        ("x = 1" + "0" * 5000, 1, "more than 4000 characters"),
    ],
)
def test_settings_that_cannot_be_read(text, row, words):
    log = Log()
    settings, _ = read_toml("job.toml", text.encode(), log)
    (problem,) = log.problems
    assert problem.row == row
    assert words in problem.expected
    assert not settings


def test_decimal_commas_in_settings_are_reported_one_by_one():
    log = Log()
    text = (
        'x = """\na = 1,5\n"""\r\n[table]\r\nstep_m = 0,01  # cm\r\nlow_m=-1,5e-1\nlist = [1,5]\n'
    )
    settings, _ = read_toml("job.toml", text.encode(), log)
    told = [(problem.row, problem.expected) for problem in log.problems[:2]]
    assert told == [
        (5, "found 'step_m = 0,01'; expected a decimal point, as in every .toml file"),
        (6, "found 'low_m=-1,5e-1'; expected a decimal point, as in every .toml file"),
    ]
    assert "is in no [section]" in log.problems[2].expected  # x: what else is wrong is told
    found = {key: (value.raw, value.row) for key, value in settings["table"].items()}
    assert found == {"step_m": (0.01, 5), "low_m": (-0.15, 6), "list": ([1, 5], 7)}


def test_texts_without_quotation_marks_are_reported_one_by_one():
    """The first of them hid all the others, and did not name itself."""
    log = Log()
    text = "[tank]\nid = TQ-101 # tag\nside = inside\ndate = 31/05/2024\nz = 10 m\nyear = 1987\n"
    settings, _ = read_toml("job.toml", text.encode(), log)
    assert [(problem.row, problem.expected) for problem in log.problems] == [
        (2, 'found TQ-101; expected "TQ-101", with quotation marks'),
        (3, 'found inside; expected "inside", with quotation marks'),
        (4, "found 31/05/2024; expected a date as year-month-day, such as 2024-05-31"),
        (5, "found 10 m; expected a number alone, without unit, or a text in quotation marks"),
    ]
    assert settings["tank"]["year"].raw == 1987


def test_a_file_of_nothing_but_decimal_commas_ends():
    log = Log()
    text = "".join(f"x{number} = 1,5\n" for number in range(1000))
    assert read_toml("job.toml", text.encode(), log) == (None, {})
    assert len(log.problems) == MAX_PROBLEMS_PER_FILE


def test_settings_are_no_csv_in_words_about_their_encoding():
    log = Log()
    assert read_toml("plan.toml", 'owner = "João"\n'.encode("latin-1"), log) == (None, {})
    (problem,) = log.problems
    assert problem.row == 1
    assert problem.expected.endswith("not UTF-8; save the file as UTF-8 text")


@pytest.mark.parametrize("end", ["\n", "\r\n", "\r"])
def test_toml_with_the_line_ends_of_any_system(end):
    text = end.join(["# a comment", "[table]", 'unit = "m3"', "step_m = 0.01", "step_mm = 1,5", ""])
    log = Log()
    settings, sections = read_toml("job.toml", text.encode(), log)
    step = settings["table"]["step_m"]
    assert (step.raw, step.row) == (0.01, 4)
    assert sections == {"table": 2}
    assert [problem.row for problem in log.problems] == [5]


def test_deeply_nested_settings_are_unknown_sections():
    settings, _ = read_toml("job.toml", b"a." * 1500 + b"a = 1", Log())
    assert list(settings) == ["a", "a.a", "a.a.a"]


def test_files_carry_size_and_digest(tmp_path):
    (tmp_path / "job.toml").write_bytes(b"")
    raw = read_folder(tmp_path, Log())
    # published: SHA-256 of no bytes at all (FIPS 180-4)
    empty = "e3b0c44298fc1c149afbf4c8996fb92427ae41e4649b934ca495991b7852b855"
    assert raw.files == (("job.toml", empty, 0),)


NUMBER = Field("x_m", "number", "", low=-1e6, high=1e6)


@pytest.mark.parametrize(
    ("text", "decimal", "value"),
    [
        ("1.25", ".", 1.25),
        ("1,25", ",", 1.25),
        (" -.5e1 ", ".", -5.0),
        ("+7.", ".", 7.0),
        ("12", ",", 12.0),
        ("1,25", ".", 1.25),
        ("1.25", ",", 1.25),
        ("-0,234", ".", -0.234),
        ("1234.567", ",", 1234.567),
        ("1,234", ",", 1.234),
    ],
)
def test_numbers_as_text(text, decimal, value):
    assert read_value(NUMBER, text, decimal) == value


@pytest.mark.parametrize(
    ("text", "decimal", "words"),
    [
        ("1,250", ".", "[csv] decimal"),
        ("1.250", ",", "with a decimal comma"),
        ("1.000,5", ",", "expected a number"),
        ("1_000", ".", "expected a number"),
        ("１２", ".", "expected a number"),
        ("nan", ".", "expected a number"),
        ("Infinity", ".", "expected a number"),
        ("1e999", ".", "infinite"),
        ("1e7", ".", "another unit"),
        ("0x10", ".", "expected a number"),
        ("1" * 70, ".", "expected a number"),
        ("1.25", None, "stored as a number"),
        ("one", None, "the text 'one'"),
        (True, None, "the truth value True"),
        (10**400, None, "a number of very many digits"),
        (BadCell("the cell shows '#N/A'"), None, "#N/A"),
    ],
)
def test_numbers_that_are_refused(text, decimal, words):
    with pytest.raises(Refused) as caught:
        read_value(NUMBER, text, decimal)
    assert words in str(caught.value)


@pytest.mark.parametrize(
    "text", ["T-1", "Tanque São João (2)", "_7", "(A)", "Резервуар 5", "A.1", "x" * 64]
)
def test_tank_ids_that_are_good(text):
    assert read_value(Field("id", "tank id", ""), text) == text


@pytest.mark.parametrize(
    "text", ["..", "a..b", "-x", ".x", "=1", "a/b", "a\\b", "a\nb", "x" * 65, "a\u202eb", "~x", "#"]
)
def test_tank_ids_that_are_refused(text):
    with pytest.raises(Refused):
        read_value(Field("id", "tank id", ""), text)


@pytest.mark.parametrize("text", ["P1", "12/3 #4", "_x", "Ünal (a)", "1.10"])
def test_names_that_are_good(text):
    assert read_value(Field("point", "name", ""), text) == text


@pytest.mark.parametrize("text", ["=A1", "+A1", "-A1", "@A1", "#1", "(A)", "a'b", "a,b", "a\tb"])
def test_names_that_could_be_formulas_are_refused(text):
    with pytest.raises(Refused):
        read_value(Field("point", "name", ""), text)


def test_messages_show_one_printable_line():
    log = Log()
    log.problem("a\nb.csv", f"found {shown('x' * 500)}\x1b[31m\u2028", 1, "c\rd")
    assert str(log.problems[0]) == f"a?b.csv, row 1, c?d: found '{'x' * 57}...'?[31m?"


def test_nearest_name():
    assert nearest("nominal_diametre_m", ["nominal_diameter_m", "id"]) == (
        " (did you mean nominal_diameter_m?)"
    )
    assert nearest("zzz", ["id"]) == ""


# workbooks


def book_problems(path):
    log = Log()
    raw = read_workbook(path, log)
    return raw, log.problems


def rewritten(path, change):
    """The same workbook with each part changed by change(name, content)."""
    packed = io.BytesIO()
    with (
        zipfile.ZipFile(path) as old,
        zipfile.ZipFile(packed, "w", zipfile.ZIP_DEFLATED) as new,
    ):
        for name in old.namelist():
            new.writestr(name, change(name, old.read(name)))
    path.write_bytes(packed.getvalue())
    return path


@pytest.fixture
def book(tmp_path):
    return write_book(tmp_path / "job.xlsx", job_parts())


def test_a_workbook_gives_the_same_tables(book):
    raw, problems = book_problems(book)
    assert not problems
    assert raw.settings["tank"]["id"].raw == "T-1"
    assert raw.settings["tank"]["id"].row == 2
    points = raw.tables["points"]
    assert (points.file, points.decimal, points.row_numbers[0]) == ("sheet points", None, 2)
    assert points.headings == ("point", "x_m", "y_m", "z_m")
    assert len(points.rows) == 120


def test_blank_and_comment_rows_of_a_sheet(tmp_path):
    parts = job_parts()
    rows = parts.tables["points"]
    parts.tables["points"] = [["# surveyed in May"], [], *rows[:3], [None], ["# off", 1], *rows[3:]]
    raw, problems = book_problems(write_book(tmp_path / "job.xlsx", parts))
    assert not problems
    assert raw.tables["points"].heading_row == 3
    assert raw.tables["points"].row_numbers[:4] == (4, 5, 8, 9)


@pytest.mark.slow
def test_formatted_blank_rows_and_a_wrong_dimension_cost_nothing(book):
    # property: neither what the sheet declares nor cells with a format only are read
    def fill(name, content):
        if name != "xl/worksheets/sheet2.xml":
            return content
        row = b'<row r="%d"><c r="A%d" s="0"/></row>'
        blank = b"".join(row % (number, number) for number in range(200, 10**5))
        content = content.replace(b"A1:D121", b"A1:XFD1048576")
        return content.replace(b"</sheetData>", blank + b"</sheetData>")

    raw, problems = book_problems(rewritten(book, fill))
    assert not problems
    assert len(raw.tables["points"].rows) == 120


def test_cells_without_a_value_are_not_blank(book):
    workbook = openpyxl.load_workbook(book)
    sheet = workbook["courses"]
    sheet["D1"], sheet["D2"], sheet["D3"], sheet["D4"] = "paint_mm", "=0.1+0.2", "#N/A", 0.3
    workbook.save(book)  # openpyxl stores no results of formulas
    raw, problems = book_problems(book)
    assert not problems
    paint = [row[3] for row in raw.tables["courses"].rows]
    assert isinstance(paint[0], BadCell)
    assert "formula without its result" in paint[0].complaint
    assert "#N/A" in paint[1].complaint
    assert paint[2:] == [0.3, None, None]


@pytest.mark.slow(after=1)
@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda name, content: content.replace(b"<sst", b"<!DOCTYPE x><sst", 1), "DOCTYPE"),
        (lambda name, content: content.replace(b"<sst", b"<!ENTITY x><sst", 1), "DOCTYPE"),
        (lambda name, content: content.replace(b"UTF-8", b"cp037", 1), "encoding"),
        (lambda name, content: content.decode().encode("utf-16"), "encoding"),
        (lambda name, content: content + b" " * 2_000_000, "more than 300 times"),
        (lambda name, content: content + b" " * 9_000_000, "expected at most 100 MB"),
        (lambda name, content: b"", "damaged"),
    ],
)
def test_workbooks_that_are_refused(book, change, words):
    raw, (problem,) = book_problems(rewritten(book, change))
    assert raw is None
    assert problem.file == "job.xlsx"
    assert words in problem.expected


def test_macros_are_refused(book):
    with zipfile.ZipFile(book, "a") as archive:
        archive.writestr("xl/vbaProject.bin", b"x")
    raw, (problem,) = book_problems(book)
    assert raw is None
    assert "macros" in problem.expected


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (b"", "not an Excel workbook"),
        (b"point,x_m\n", "not an Excel workbook"),
        (b"PK\x03\x04" + b"\0" * 100, "not an Excel workbook"),
        (
            b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1" + b"\0" * 512,
            "old .xls or a workbook with a password",
        ),
    ],
)
def test_files_that_are_no_workbook(tmp_path, content, words):
    path = tmp_path / "job.xlsx"
    path.write_bytes(content)
    raw, (problem,) = book_problems(path)
    assert raw is None
    assert words in problem.expected


def test_another_archive_is_no_workbook(tmp_path):
    path = tmp_path / "job.xlsx"
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("content.xml", "<office/>")
    _, (problem,) = book_problems(path)
    assert problem.expected == "not an Excel workbook (.xlsx)"


def test_the_sheet_job(tmp_path):
    parts = job_parts()
    path = write_book(tmp_path / "job.xlsx", parts)
    workbook = openpyxl.load_workbook(path)
    sheet = workbook["job"]
    sheet.append(["tank", "id", "again"])
    sheet.append(["[tank]", "owner", 12])
    sheet.append([None, "location", "x"])
    sheet.append(["survey", None, None])
    last = sheet.max_row
    workbook.save(path)
    raw, problems = book_problems(path)
    assert [(problem.row, problem.column) for problem in problems] == [
        (last - 3, "tank.id"),
        (last - 1, "section"),
    ]
    assert raw.settings["tank"]["owner"].raw == 12


@pytest.mark.parametrize("data", [b"# note; of the starter\na,b\n", b"a,b", b"a,b\n\n# c\n"])
def test_a_heading_of_commas_with_nothing_below_is_read_in_a_job_of_semicolons(data):
    log = Log()
    table = read_csv("t.csv", data, ";", ",", log)
    assert log.problems == []
    assert (table.headings, table.rows) == (("a", "b"), ())


@pytest.mark.parametrize(
    ("data", "declared"), [(b"a,b\n1,2\n", (";", ",")), (b"a;b\n1;2\n", (",", "."))]
)
def test_the_heading_says_which_separator_there_is(data, declared):
    log = Log()
    table = read_csv("t.csv", data, *declared, log)
    assert (table.headings, table.rows, log.problems) == (("a", "b"), (("1", "2"),), [])


def test_a_list_in_a_cell_is_no_separator():
    table, problems = csv_table('a,b\n"1; 2; 3",4\n"5; 6; 7",8\n')
    assert (problems, table.rows) == ([], (("1; 2; 3", "4"), ("5; 6; 7", "8")))


STANDARDS = Field("standard", "choice", "", choices=("asme", "din_28011", "din_28013"))


@pytest.mark.parametrize("text", ["DIN 28011", "din-28011", "DIN_28011", " Din28011 "])
def test_a_choice_is_meant_by_its_letters_and_digits(text):
    assert read_value(STANDARDS, text) == "din_28011"


@pytest.mark.parametrize("text", ["DIN 2801", "28011", "DIN"])
def test_a_part_of_a_choice_is_refused_with_the_choices(text):
    with pytest.raises(Refused, match="'asme' or 'din_28011' or"):
        read_value(STANDARDS, text)


def test_codes_of_one_letter_are_not_guessed():
    with pytest.raises(Refused):
        read_value(Field("unit", "choice", "", choices=("m3", "L", "mm")), "l")
