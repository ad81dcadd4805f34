"""The words: every code that a record may hold has its sentence."""

import marshal
import re
import sys
from hashlib import sha256
from pathlib import Path

import pytest

from tankcal.errors import TankcalError
from tankcal.text.words import _parse_once, load_words, sentence

FORMAT = (Path(__file__).parents[2] / "docs" / "record-format.md").read_text(encoding="utf-8")
ANY_VALUE = 2.5


def promised_choices():
    """(code, value) of every choice that docs/record-format.md promises."""
    paragraph = FORMAT.split("Choice codes and their values:")[1].split("\n## ")[0]
    paragraph = re.sub(r"\s+", " ", paragraph)
    promised = []
    for code, values in re.findall(r"`(\w+)` \(([^)]*)\)", paragraph):
        texts = re.findall(r'"([^"]+)"', values)
        promised += [(code, text) for text in texts]
        if re.sub(r'"[^"]+"|[| ,]|or', "", values):  # a number or a list is promised too
            promised.append((code, ANY_VALUE))
    return promised


def promised_codes(beginning):
    """The codes in backquotes of the sentence that begins so, up to the full stop."""
    rest = FORMAT.split(beginning)[1].split(".\n")[0].split(". ")[0]
    return re.findall(r"`([a-z_]+)`", rest)


def test_record_format_page_names_what_is_tested():
    assert {"zero", "coverage", "not_in_budget", "snooping"} <= {c for c, _ in promised_choices()}
    codes = "plate paint temperature tilt head bottom deadwood roof liquid"
    assert promised_codes("Correction codes:") == codes.split()


@pytest.mark.slow(after=1)
@pytest.mark.parametrize(("code", "value"), promised_choices())
def test_every_choice_has_a_sentence(code, value):
    text = sentence(load_words("en"), "choices", code, value)
    assert text.endswith(".")
    assert not text.startswith(f"{code}:")
    assert "{" not in text
    if value == ANY_VALUE:
        assert "2.5" in text or "250" in text


@pytest.mark.parametrize(
    ("group", "beginning"),
    [("corrections", "Correction codes:"), ("reasons", "Reasons of rejection:")],
)
def test_every_code_has_words(group, beginning):
    codes = promised_codes(beginning)
    assert codes
    assert set(codes) <= set(load_words("en")[group])


WORDS = {
    "language": {"marks": {"decimal": "."}},
    "choices": {
        "share": "A share of {value}.",
        "zero": {"bottom": "From the bottom."},
        "left_out": {"none": "Nothing.", "other": "Without {value}."},
    },
}


@pytest.mark.parametrize(
    ("code", "value", "text"),
    [
        ("share", 0.1 + 0.2, "A share of 0.3."),
        ("zero", "bottom", "From the bottom."),
        ("zero", "moon", "zero: moon"),
        ("left_out", [], "Nothing."),
        ("left_out", None, "Nothing."),
        ("left_out", ["paint", "scale"], "Without paint, scale."),
        ("unheard_of", None, "unheard_of"),
        ("unheard_of", 3, "unheard_of: 3"),
    ],
)
def test_sentence_fills_in_the_value_and_hides_nothing(code, value, text):
    assert sentence(WORDS, "choices", code, value) == text


def test_a_value_with_braces_stays_as_it_is():
    assert sentence(WORDS, "choices", "left_out", ["{value}"]) == "Without {value}."


def test_a_language_without_words_is_said():
    with pytest.raises(TankcalError, match=r"'tlh'; shipped: .*en"):
        load_words("tlh")


def test_words_are_the_callers_own():
    words = load_words("en")
    words["choices"].clear()
    assert load_words("en")["choices"]


def test_stored_words_are_those_of_their_file(tmp_path, monkeypatch):
    monkeypatch.setattr(sys, "dont_write_bytecode", False)
    monkeypatch.setattr(sys, "pycache_prefix", None)
    file, folder = tmp_path / "xx.toml", tmp_path / "__pycache__"

    def parsed():
        return marshal.loads(_parse_once.__wrapped__(file))

    file.write_text("[page]\nnumber = 'No.'\n", encoding="utf-8")
    assert parsed() == {"page": {"number": "No."}}
    (stored,) = folder.iterdir()
    other = marshal.dumps({"page": {"number": "stored"}})
    stored.write_bytes(sha256(file.read_bytes() + other).digest() + other)
    assert parsed() == {"page": {"number": "stored"}}  # not parsed again
    for damaged in (b"", stored.read_bytes()[:-1], bytes(32) + other):
        stored.write_bytes(damaged)
        assert parsed() == {"page": {"number": "No."}}
    file.write_text("[page]\nnumber = 'N'\n", encoding="utf-8")
    assert parsed() == {"page": {"number": "N"}}
    stored.unlink()
    folder.rmdir()
    folder.write_text("no folder")  # as in an installation without the right to write
    assert parsed() == {"page": {"number": "N"}}
