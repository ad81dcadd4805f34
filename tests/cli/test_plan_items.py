"""How many of each thing a plan has, in every language: one of each, several of each."""

import pytest
from plan_folders import PLAN
from wall_plan_folders import HITS, plan_of

from tankcal.cli import main
from tankcal.cli.planning import KINDS, describe_count
from tankcal.text.shipped import DEFAULT, LANGUAGES
from tankcal.text.words import load_words, message_sentence


@pytest.mark.slow(after=27)
@pytest.mark.parametrize("language", LANGUAGES)
@pytest.mark.parametrize("kind", KINDS)
def test_one_is_told_otherwise_than_two(language, kind):
    def said(count):
        one = describe_count(kind, count)
        if language == DEFAULT:
            return str(one)
        return message_sentence(load_words(language), str(one), one.code, one.values)

    assert said(1).startswith("1 ")
    assert said(2).startswith("2 ")
    assert said(1).removeprefix("1 ") != said(2).removeprefix("2 ")


@pytest.mark.slow
@pytest.mark.parametrize(
    ("language", "words"),
    [("en", "1 set-up, "), ("pt-BR", "1 estacionamento, "), ("es", "1 estacionamiento, ")],
)
def test_a_plan_of_one_set_up(tmp_path, capsys, language, words):
    folder = plan_of(tmp_path, HITS)
    assert main(["plan", str(folder), "--quiet", "--language", language]) == 0
    assert words in capsys.readouterr().out


@pytest.mark.slow
def test_a_plan_of_many(capsys):
    assert main(["plan", str(PLAN), "--quiet"]) == 0
    assert "photographs" in capsys.readouterr().out
