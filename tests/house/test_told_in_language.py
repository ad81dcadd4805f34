"""The terminal speaks the job's language, and a form's own words for choices are read."""

import re

import pytest
from job_builder import write_book, write_workbook
from survey_builder import survey_parts

import tankcal
from tankcal.cli import main
from tankcal.errors import InputError, Problem
from tankcal.job.contract import KEYS
from tankcal.job.field_values import read_value
from tankcal.job.fields import Field, Refused
from tankcal.job.starter import write_input_workbook, write_starter
from tankcal.job.tables import in_book
from tankcal.messages import Message
from tankcal.record import record_of
from tankcal.terminal import read_job_language, say_in_language, speak
from tankcal.text.shipped import nearest_language
from tankcal.text.words import load_words, meant, translate_record, word_of

OTHERS = ("pt-BR", "es")
ENGLISH = re.compile(r"\b(the|expected|found|missing|blank|row|sheet|with|number|is|of)\b")


@pytest.mark.slow
@pytest.mark.parametrize("language", OTHERS)
@pytest.mark.parametrize("kind", ["vertical", "horizontal", "sphere", "mesh"])
def test_an_empty_form_is_refused_in_its_language(tmp_path, capsys, language, kind):
    write_starter(tmp_path / "job", kind, None, language)
    sheet = {"pt-BR": "aba", "es": "hoja"}[language]
    book = write_input_workbook(tmp_path / "book" / "job.xlsx", kind, None, language)
    for source in (book, tmp_path / "job"):
        assert read_job_language(source) == language
        assert main(["run", str(source), "--out", str(tmp_path / "out")]) == 2
        lines = [line.partition(": ")[2] for line in capsys.readouterr().err.splitlines()[1:]]
        assert len(lines) > 3
        assert [line for line in lines if ENGLISH.search(line)] == []
        if source.suffix:
            assert all(line.startswith(f"job.xlsx, {sheet} ") for line in lines)


def test_terminal_language_defaults_to_environment(monkeypatch):
    problem = Problem("points.csv", "x", 12)
    speak()
    assert say_in_language(problem.text) == "points.csv, row 12: x"
    monkeypatch.setenv("LANG", "pt_BR.UTF-8")
    speak()
    assert say_in_language(problem.text) == "points.csv, linha 12: x"
    assert nearest_language("es_MX") == "es"
    assert nearest_language("tlh") is None


@pytest.mark.parametrize(
    ("file", "placed"),
    [
        ("points.csv", "t.xlsx, sheet points, row 3: x"),
        ("job.toml", "t.xlsx, sheet job, row 3: x"),
        ("sheet courses", "t.xlsx, sheet courses, row 3: x"),
        ("tank.stl", "tank.stl, row 3: x"),
    ],
)
def test_a_problem_of_a_workbook_names_it(file, placed):
    assert str(in_book(Problem(file, "x", 3), "t.xlsx")) == placed


@pytest.mark.slow
def test_warnings_of_a_workbook_name_it_and_its_words_are_read(tmp_path):
    settings = {
        "survey.side": "fora",
        "table.language": "pt-BR",
        "table.monte_carlo": "não",
        "tank.nominal_volume_m3": 10.0,
    }
    path = write_workbook(tmp_path / "tanque.xlsx", settings=settings)
    job = tankcal.load(path)
    assert (job.survey.side, job.table.monte_carlo) == ("outside", False)
    result = tankcal.run(job)
    (told,) = (one for one in result.warnings if "nominal_volume" in str(one.column))
    assert str(told).startswith("tanque.xlsx, sheet job, tank.nominal_volume_m3: ")
    assert read_job_language(path) == "pt-BR"
    record = translate_record(load_words("pt-BR"), record_of(result))
    assert {one["file"] for one in record["warnings"]} <= {"aba job", "aba uncertainty"}
    speak("pt-BR")
    assert say_in_language(told.text).startswith(
        "tanque.xlsx, aba job, tank.nominal_volume_m3: a capac"
    )


CHOICES = [field.choices for fields in KEYS.values() for field in fields if field.kind == "choice"]


def test_each_word_of_a_form_means_one_choice():
    for language in OTHERS:
        for choices in CHOICES:
            for choice in choices:
                word = word_of(language, choice)
                assert word in choices or meant(word, choices) == choice


@pytest.mark.parametrize(
    ("word", "value"),
    [("sim", True), ("Não", False), ("nao", False), ("sí", True), ("NO", False), ("true", True)],
)
def test_yes_and_no_of_a_form(word, value):
    assert read_value(Field("x", "flag", ""), word) is value


@pytest.mark.parametrize(
    ("word", "value"),
    [("fora", "outside"), ("Dentro", "inside"), ("fuera", "outside"), ("por fora", "outside")],
)
def test_sides_of_a_form(word, value):
    assert read_value(Field("x", "choice", "", choices=("outside", "inside")), word) == value


def test_unknown_word_is_refused_with_expected_ones():
    with pytest.raises(Refused) as told:
        read_value(Field("x", "choice", "", choices=("outside", "inside")), "talvez")
    assert isinstance(told.value.text, Message)
    speak("pt-BR")
    assert say_in_language(told.value.text) == "encontrado 'talvez'; esperado 'fora' ou 'dentro'"


@pytest.mark.parametrize(("language", "said"), [("pt-BR", "aba"), ("es", "hoja")])
def test_a_sheet_inside_a_text_is_named_in_words(tmp_path, language, said):
    """A register that is not there, told of the sheet that refers to it."""
    parts = survey_parts()
    del parts.registers["instruments"]
    with pytest.raises(InputError) as error:
        tankcal.load(write_book(tmp_path / "t.xlsx", parts))
    speak(language)
    told = [say_in_language(one.text) for one in error.value.problems]
    assert any(f", {said} instruments: " in line and f" {said} setups " in line for line in told)
    assert [line for line in told if "sheet " in line] == []
