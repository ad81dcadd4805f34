"""`--help` and usage errors in the user's language."""

import argparse
import os
import re
import subprocess
import sys

import numpy as np
import pytest

from tankcal.cli import _parser, main, translate_parser
from tankcal.terminal import speak
from tankcal.text.shipped import DEFAULT, LANGUAGES
from tankcal.text.words import load_words

OTHERS = [one for one in LANGUAGES if one != DEFAULT]
ENGLISH = re.compile(r"\b(the|where|write|with|default|found|expected|arguments|show)\b")
LOCALES = {"pt-BR": "pt_BR.UTF-8", "es": "es_MX.UTF-8"}


@pytest.fixture
def in_language(monkeypatch):
    return lambda language: monkeypatch.setenv("LANG", LOCALES[language])


def parsers_of(parser):
    """A parser and those of all its commands."""
    yield parser
    for action in parser._actions:
        if isinstance(action, argparse._SubParsersAction):
            for one in action.choices.values():
                yield from parsers_of(one)


def arguments(parser):
    return {one.dest for one in parser._actions if one.help is not None and one.dest != "help"}


@pytest.fixture(scope="module")
def english():
    speak("en")
    return {one.prog.removeprefix("tankcal "): one for one in parsers_of(_parser())}


@pytest.mark.parametrize("language", OTHERS)
def test_help_texts_and_their_words_match(english, language):
    known = dict(load_words(language)["help"])
    shared = known.pop("shared").keys()
    del known["argparse"], known["metavars"]
    assert known.keys() == english.keys()
    taken = set()
    for name, parser in english.items():
        texts = {"line": name != "tankcal", "about": parser.description, "ending": parser.epilog}
        needed = {key for key, value in texts.items() if value}
        own = known[name].keys()
        assert needed <= own <= needed | arguments(parser)
        assert arguments(parser) - own <= shared
        taken |= arguments(parser) - own
    assert taken == set(shared)


@pytest.mark.parametrize("language", OTHERS)
def test_no_english_is_left_in_any_help(language):
    speak("en")
    parser = _parser()
    translate_parser(parser, load_words(language)["help"])
    texts = [
        text
        for one in parsers_of(parser)
        for text in (one.description, one.epilog, *(action.help for action in one._actions))
        if text is not None and "this help" not in text
    ]
    assert len(texts) > 80
    assert [text for text in texts if ENGLISH.search(text)] == []


@pytest.mark.parametrize("language", OTHERS)
def test_names_of_values_are_translated(language):
    """Symbols of units and counts are the same in all languages; words are not."""
    speak("en")
    parser = _parser()
    translate_parser(parser, load_words(language)["help"])
    symbols = {
        "N",
        "S",
        "K",
        "M",
        "M3",
        "MM",
        "UM",
        "PX",
        "GB",
        "GPA",
        "MPA",
        "ARCSEC",
        "HEX",
        "ID",
    }
    symbols |= {"ALPHA", "I|II|LOW,RANGE", "COLUMNSxROWS,START,START,STEP"}
    names = set()
    for one in parsers_of(parser):
        for action in one._actions:
            if action.nargs != 0 and action.choices is None:
                names |= set(np.atleast_1d(action.metavar or action.dest.upper()))
    assert names - symbols <= set(load_words(language)["help"]["metavars"].values())


@pytest.mark.slow(after=1)
@pytest.mark.parametrize(
    ("command", "portuguese", "spanish"),
    [
        (["run"], "erro: faltam argumentos obrigatórios: SERVIÇO",
         "error: faltan argumentos obligatorios: SERVICIO"),
        (["run", "x", "--of"], "erro: argumentos desconhecidos: --of",
         "error: argumentos desconocidos: --of"),
        (["new", "x", "--kind", "cubo"], "erro: argumento --kind: encontrado 'cubo'; esperado ",
         "error: argumento --kind: se encontró 'cubo'; se esperaba uno de "),
        (["plan", "x", "--simulate", "1.5"],
         "argumento --simulate: encontrado '1.5'; esperado um número inteiro de 2 a 1000000",
         "argumento --simulate: se encontró '1.5'; se esperaba un número entero de 2 a 1000000"),
        (["run", "x", "--no-papers", "--letterhead", "y"], "não permitido junto com o argumento",
         "no se permite junto con el argumento"),
    ],
)  # fmt: skip
def test_usage_errors_in_the_users_language(in_language, capsys, command, portuguese, spanish):
    for language, expected in (("pt-BR", portuguese), ("es", spanish)):
        in_language(language)
        with pytest.raises(SystemExit) as left:
            main(command)
        assert left.value.code == 2
        error = capsys.readouterr().err
        assert error.startswith("uso: tankcal ")
        assert expected in error


def test_the_words_of_argparse_are_english_again_afterwards(in_language, capsys):
    in_language("pt-BR")
    assert main([]) == 0
    assert "opções:" in capsys.readouterr().out
    assert "options:" in argparse.ArgumentParser().format_help()


@pytest.mark.slow
def test_help_in_another_language_loads_nothing_heavy():
    code = (
        "import sys; from tankcal.cli import main\n"
        "try: main(['run', '--help'])\n"
        "except SystemExit: pass\n"
        "heavy = {'numpy', 'scipy', 'pandas', 'matplotlib', 'openpyxl', 'nbformat'}\n"
        "sys.exit(len(heavy & set(sys.modules)))"
    )
    done = subprocess.run(
        [sys.executable, "-c", code],
        stdout=subprocess.PIPE,
        env=os.environ | {"LC_ALL": "pt_BR.UTF-8", "PYTHONIOENCODING": "utf-8"},
        encoding="utf-8",
    )
    assert done.returncode == 0
    assert "calcula-o e grava os resultados" in done.stdout
