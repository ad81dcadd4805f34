"""One form for each job folder, and the choice between two forms in folders that have both."""

import openpyxl
import pytest
from filled_forms import fill_form, place_of
from job_builder import SETTINGS, job_parts

import tankcal
from tankcal.cli import main
from tankcal.errors import InputError
from tankcal.job.contract import COLUMNS
from tankcal.job.starter import write_form, write_input_workbook, write_starter
from tankcal.job.starter.writing import Form
from tankcal.products.batch.finding import find_jobs
from tankcal.products.batch.outcomes import Options
from tankcal.report.folders import default_folder
from tankcal.terminal import read_job_language
from tankcal.text.shipped import DEFAULT, LANGUAGES

BLANKS = [
    *("tank.id", "tank.nominal_diameter_m", "tank.nominal_height_m", "survey.date"),
    *("survey.side", "datum.bottom_z_m", "table.reference_temperature_c"),
]


@pytest.fixture
def both(tmp_path):
    """A folder as older versions wrote it: text files and workbook, nothing filled in."""
    write_form(tmp_path / "job", Form("vertical"))
    write_input_workbook(tmp_path / "job.xlsx")
    (tmp_path / "job.xlsx").rename(tmp_path / "job" / "job.xlsx")
    return tmp_path / "job"


def fill_book(path, tables=None):
    tables = tables or job_parts().tables
    wanted = {name: [field.name for field in COLUMNS[name]] for name in tables}
    rows = {
        name: [
            wanted[name],
            *([*row, *[""] * (len(wanted[name]) - len(row))] for row in table[1:]),
        ]
        for name, table in tables.items()
    }
    fill_form(path, {key: SETTINGS[key] for key in BLANKS}, rows)


def fill_texts(folder, tables=None):
    parts = job_parts()
    settings = folder / "job.toml"
    text = settings.read_text(encoding="utf-8")
    for key in BLANKS:
        name, value = key.partition(".")[2], parts.settings[key]
        typed = f'"{value}"' if isinstance(value, str) else repr(value)
        text = text.replace(f'\n{name} = ""', f"\n{name} = {typed}", 1)
    settings.write_text(text, encoding="utf-8")
    for name, rows in (tables or parts.tables).items():
        width = len(COLUMNS[name])
        with open(folder / f"{name}.csv", "a", encoding="utf-8") as file:
            for row in rows[1:]:
                file.write(",".join(map(str, [*row, *[""] * (width - len(row))])) + "\n")


def problems_of(path):
    with pytest.raises(InputError) as refused:
        tankcal.load(path)
    return refused.value.problems


@pytest.mark.slow
def test_a_filled_workbook_beside_blank_files_is_read(both):
    fill_book(both / "job.xlsx")
    job = tankcal.load(both)
    assert (job.tank.id, len(job.points.names)) == ("T-1", 120)
    assert [str(one) for one in job.warnings] == [
        "job.xlsx: is read; the text files beside it are not filled in"
    ]


def test_filled_files_beside_a_blank_workbook_are_read(both):
    fill_texts(both)
    job = tankcal.load(both)
    assert (job.tank.id, job.source, job.warnings) == ("T-1", "job", ())


@pytest.mark.slow
def test_two_filled_forms_that_differ_are_one_problem(both):
    fill_book(both / "job.xlsx")
    settings = both / "job.toml"
    text = settings.read_text(encoding="utf-8")
    settings.write_text(text.replace('\nid = ""', '\nid = "T-2"'), encoding="utf-8")
    [problem] = problems_of(both)
    assert "are both filled in, and differ" in str(problem)
    assert tankcal.load(both / "job.xlsx").tank.id == "T-1"  # named by the user: no doubt


@pytest.mark.slow
@pytest.mark.parametrize(("fuller", "said"), [
    ("texts", "is not read, because the text files beside it are further filled in"),
    ("book", "is read, because it is further filled in than the text files beside it"),
])  # fmt: skip
def test_of_two_forms_that_agree_the_fuller_one_is_read(both, fuller, said):
    """As after a plan: the other form has names without values, and a row that was deleted here."""
    whole, names = job_parts().tables, job_parts().tables
    names["points"] = [names["points"][0], *([row[0]] for row in names["points"][1:])]
    whole["points"] = [whole["points"][0], *whole["points"][2:]]
    fill_texts(both, whole if fuller == "texts" else names)
    fill_book(both / "job.xlsx", whole if fuller == "book" else names)
    job = tankcal.load(both)
    assert len(job.points.names) == 119
    assert [str(one) for one in job.warnings] == [f"job.xlsx: {said}"]


@pytest.mark.slow
def test_two_forms_of_the_same_content_are_read_as_text(both):
    fill_book(both / "job.xlsx")
    fill_texts(both)
    assert tankcal.load(both).source == "job"


def test_two_blank_forms_are_told_once_and_as_text(both):
    columns = [one.column for one in problems_of(both) if one.file == "job.toml"]
    assert sorted(columns) == sorted(BLANKS)


@pytest.mark.slow
@pytest.mark.parametrize("language", LANGUAGES)
def test_a_form_filled_in_another_language_is_recognised(tmp_path, language):
    """Words of choices and flags of the form do not count as typed."""
    write_form(tmp_path / "job", Form("horizontal", None, language), workbook=True)
    book = openpyxl.load_workbook(tmp_path / "job" / "job.xlsx")
    place_of(book["job"], "tank.id").value = "TQ-7"
    book.save(tmp_path / "job" / "job.xlsx")
    assert all(one.book == "job.xlsx" for one in problems_of(tmp_path / "job"))


# ---- a folder with a workbook alone


@pytest.mark.slow
def test_a_folder_with_a_workbook_alone_is_a_job(tmp_path, capsys):
    folder = tmp_path / "tk-21"
    fill_book(write_input_workbook(folder))
    assert tankcal.load(folder).tank.id == "T-1"
    found = find_jobs([str(tmp_path)], Options(steps=("run",)))
    assert [(one.label, one.source) for one in found] == [("tk-21", str(folder / "job.xlsx"))]
    assert main(["run", str(folder), "--no-papers", "--quiet"]) == 0
    assert (folder / "results" / "record.json").is_file()
    assert default_folder(folder) == default_folder(folder / "job.xlsx") == folder / "results"
    assert default_folder(folder / "TK-2.xlsx") == folder / "TK-2-results"


# ---- tankcal new


@pytest.mark.slow
def test_new_writes_one_form_and_exchanges_an_untouched_one(tmp_path, capsys):
    folder = tmp_path / "tk 1"
    arguments = ["new", str(folder), "--survey", "strapping"]
    assert main(arguments) == 0
    assert not list(folder.glob("*.xlsx"))
    printed = capsys.readouterr().out.splitlines()
    assert printed[-1] == f"  tankcal new '{folder}' --survey strapping --workbook"
    assert main([*arguments, "--workbook"]) == 0
    assert sorted(path.name for path in folder.iterdir()) == ["field-sheets.pdf", "job.xlsx"]
    assert main(arguments) == 0
    assert not list(folder.glob("*.xlsx"))


@pytest.mark.slow(after=2)
@pytest.mark.parametrize("change", ["typed", "another file", "another form"])
def test_new_keeps_what_the_user_typed(tmp_path, change, capsys):
    folder = tmp_path / "tk"
    write_starter(folder, "sphere" if change == "another form" else "vertical")
    if change == "typed":
        (folder / "points.csv").write_text("point,x_m,y_m,z_m\nP1,1,2,3\n")
    if change == "another file":
        (folder / "notes.txt").write_text("mine")
    before = {path.name: path.read_bytes() for path in folder.iterdir()}
    assert main(["new", str(folder), "--workbook"]) == 2
    assert {path.name: path.read_bytes() for path in folder.iterdir()} == before
    assert "is left as it is" in capsys.readouterr().err


@pytest.mark.slow
@pytest.mark.parametrize(("locale", "language"), [("pt_BR.UTF-8", "pt-BR"), ("es_ES.UTF-8", "es"),
                                                  ("C.UTF-8", "en")])  # fmt: skip
def test_new_follows_the_language_of_the_environment(tmp_path, monkeypatch, capsys, locale,
                                                     language):  # fmt: skip
    monkeypatch.setenv("LANG", locale)
    refused = {
        "pt-BR": "não está vazia e fica como estava",
        "es": "no está vacía y queda como estaba",
        "en": "is not empty, and is left as it is",
    }[language]
    for name, more in (("text", []), ("book", ["--workbook"])):
        folder = tmp_path / name
        assert main(["new", str(folder), *more]) == 0
        assert (read_job_language(folder) or DEFAULT) == language
        capsys.readouterr()
        (folder / "mine.txt").write_text("mine")
        assert main(["new", str(folder), *more]) == 2
        assert refused in capsys.readouterr().err
    note = (tmp_path / "text" / "points.csv").read_text(encoding="utf-8").splitlines()
    assert note[-1].startswith("point,x_m" if language == "en" else "point;x_m")
    assert main(["new", str(tmp_path / "other"), "--language", "en"]) == 0
    assert 'language = ""' in (tmp_path / "other" / "job.toml").read_text(encoding="utf-8")
