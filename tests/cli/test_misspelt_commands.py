"""Slips on the command line: misspelt commands, results in place of a job, missing files."""

import errno
import json
import os

import pytest

from tankcal.cli import main
from tankcal.errors import reason_of
from tankcal.job.starter.book import EXAMPLES_OF_KEYS, EXAMPLES_OF_TABLES
from tankcal.messages import Message
from tankcal.products.exports.profiles import shipped_profiles
from tankcal.terminal import say_in_language, speak
from tankcal.version import install_command

OTHERS = ("pt-BR", "es")


@pytest.mark.parametrize(("typed", "meant"), [("rn", "run"), ("exprot", "export"), ("nwe", "new")])
def test_a_misspelt_command_is_named(typed, meant, capsys):
    with pytest.raises(SystemExit) as stopped:
        main([typed])
    assert stopped.value.code == 2
    assert f"found '{typed}'; did you mean '{meant}'?" in capsys.readouterr().err


def test_a_word_like_no_command_gets_the_list(capsys):
    with pytest.raises(SystemExit):
        main(["xyzzy"])
    assert "intercomparison" in capsys.readouterr().err


@pytest.mark.parametrize("saved", ["record.json", "inspection.json", "comparison.json"])
@pytest.mark.parametrize("command", ["run", "batch", "app"])
def test_results_in_place_of_a_job_are_named(command, saved, tmp_path, capsys):
    results = tmp_path / "tank" / "results"
    results.mkdir(parents=True)
    (results / saved).write_text("{}", encoding="utf-8")
    (results / "capacity.csv").write_text("x", encoding="utf-8")
    (tmp_path / "tank" / "job.toml").write_text("", encoding="utf-8")
    more = ["--out", str(tmp_path / "out")] if command == "batch" else []
    assert main([command, str(results), *more]) == 2
    line = capsys.readouterr().err.splitlines()[-1]
    assert f"holds results ({saved}), not a job" in line
    assert line.endswith(f": {tmp_path / 'tank' / 'job.toml'}")


@pytest.mark.parametrize("language", OTHERS)
@pytest.mark.parametrize("number", [errno.ENOENT, errno.EACCES, errno.ENOSPC, errno.EISDIR])
def test_errors_of_the_system_are_told_in_the_language(number, language):
    reason = reason_of(OSError(number, os.strerror(number)))
    assert str(reason) == os.strerror(number)
    speak(language)
    assert say_in_language(reason) not in ("", os.strerror(number))


@pytest.mark.parametrize("language", OTHERS)
def test_a_number_of_too_many_digits_is_told_in_the_language(language):
    with pytest.raises(ValueError, match="digits") as error:
        json.loads("9" * 5000)
    reason = reason_of(error.value)
    assert str(reason) == "a number with too many digits"
    speak(language)
    assert "digits" not in say_in_language(reason)


@pytest.mark.parametrize("language", OTHERS)
def test_a_missing_record_is_told_without_english(language, capsys):
    assert main(["export", "nowhere", "--profile", "csv", "--language", language]) == 2
    assert "No such file" not in capsys.readouterr().err


def test_texts_of_shipped_profiles_have_codes():
    for code, profile in shipped_profiles().items():
        assert profile.remark == "" or isinstance(profile.remark, Message), code
        assert profile.verified or isinstance(profile.source, Message), code


@pytest.mark.parametrize("language", OTHERS)
def test_no_example_of_a_form_is_english(language):
    from tankcal.text.words import load_words

    known = load_words(language)["input"]["examples"]
    rows = [row for table in EXAMPLES_OF_TABLES.values() for row in table]
    given = {str(one) for one in EXAMPLES_OF_KEYS.values()} | {
        str(row[key])
        for row in rows
        for key in ("name", "reason", "bar", "instrument")
        if key in row
    }
    words = ("coil", "manhole", "tape 1", "bar 1", "dent", "observer", "certificate")
    english = {one for one in given if any(word in one for word in words)}
    assert len(english) >= 7
    assert english <= known.keys()
    assert not english & {known[one] for one in english}


@pytest.mark.parametrize(("extra", "library"), [("lab", "jupyterlab"), ("clouds", "pye57")])
def test_a_remedy_names_libraries_that_the_index_has(extra, library):
    command = install_command(extra)
    assert " -m pip install " in command
    assert f'"{library}>=' in command
    assert "tankcal[" not in command
