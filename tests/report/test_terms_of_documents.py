"""Documents of the examples use the terms of the VIM and names, no keys and no idioms of programs.

Certificate, working papers, workbook and digital certificate are read in three languages. Texts of
the job, which a laboratory writes, are not judged.
"""

import json
import re
from xml.etree import ElementTree

import openpyxl
import pytest
from example_certificates import EXAMPLES, input_texts, record_of_example
from paper_cells import paper_blocks, texts

from tankcal import record as records
from tankcal.report import workbook
from tankcal.report.dcc import certificate_xml
from tankcal.text.shipped import LANGUAGES
from tankcal.text.words import load_words

# Qualitative terms used as quantities, "error" for uncertainty, true values: VIM 2.11 to 2.19.
# The lower limit of accurate capacity is a term of legal metrology; JCGM 101 has a tolerance.
WRONG = {
    "en": r"accura(?:cy|te)\b(?! capacity)|precis(?:ion|e)\b|reliab|error (?:ellips|bar)"
    r"|true value|probable error|margin of error|\bsds\b|(?-i:Parameters \()",
    "es": r"exactitud|precisi[óo]n|precis[oa]s?\b|fiab|elips\w* de error|valor verdadero"
    r"|margen de error|(?-i:Parámetros \()",
    "pt": r"exatid[ãa]o|acur[áa]ci|precis(?:ão|[oa]s?\b)|confiabil|elips\w* de erro"
    r"|valor verdadeiro|margem de erro|(?-i:Parâmetros \()",
}
KEY = r"(?-i:(?<![\w./:-])[a-z][a-z0-9]*(?:_[a-z0-9]+)+(?![\w.(]))"  # such as course_heights
PAIR = r"^\d+[.,]\d+ / \d+$"  # two numbers that a heading must explain
NO_WORDS = re.compile(r"^(?:[\w./ -]+\.\w{2,5}|sha256:\w+)$")  # names of files


def shown_texts(block):
    """The texts of a block, without the name of its kind."""
    return texts({key: value for key, value in block.items() if key != "kind"})


def wrong(found, language, allowed):
    """Texts with a wrong term, a key or a bare pair, without those that the job contains."""
    expression = re.compile(f"{WRONG[language[:2]]}|{KEY}|{PAIR}", re.IGNORECASE)
    return sorted(
        {
            f"{match[0]!r} in {text[:120]!r}"
            for text in found
            if len(text) < 5000 and not NO_WORDS.match(text)
            for match in expression.finditer(text)
            if match[0] not in allowed and "=" not in text[match.end() : match.end() + 2]
        }
    )


def cells(path):
    return [
        cell.value
        for sheet in openpyxl.load_workbook(path)
        for row in sheet.iter_rows()
        for cell in row
        if isinstance(cell.value, str) and not cell.value.startswith("=")
    ]


@pytest.mark.slow
@pytest.mark.parametrize("language", LANGUAGES)
@pytest.mark.parametrize("name", EXAMPLES)
def test_documents_use_the_terms_of_the_vim(name, language, tmp_path):
    record = record_of_example(name)
    in_language = {**record, "job": {**record["job"], "report": {"language": language}}}
    path = tmp_path / "record.json"
    records.save(in_language, path)
    workbook.write(records.load(path), tmp_path / "capacity.xlsx")
    root = ElementTree.fromstring(certificate_xml(record, "0" * 64))
    content = [one for one in root.iter() if one.get("lang") in (language[:2], None)]
    found = [text for block in paper_blocks(path) for text in shown_texts(block)]
    found += cells(tmp_path / "capacity.xlsx")
    found += [one.text for one in content if one.tag.endswith("content") and one.text]
    assert len(found) > 300
    assert wrong(found, language, input_texts(name) + json.dumps(record["job"])) == []


@pytest.mark.parametrize("language", LANGUAGES)
def test_the_words_of_documents_use_the_terms_of_the_vim(language):
    words = load_words(language)
    groups = ("choices", "certificate", "dcc", "labels", "captions", "texts", "table_headings")
    groups += ("headings", "verdicts", "observations", "overrulings", "inputs")
    shown = [text for group in groups for text in texts(words[group])]
    found = [re.sub(r"\{[^}]*\}", "", text) for text in shown]
    assert wrong(found, language, "") == []


def test_the_expression_finds_what_assessors_refuse():
    shown = ["accuracy 2 mm", "12.6 / 18", "Parameters (TS)", "not in U: liquid_density"]
    assert len(wrong(shown, "en", "")) == 4
    assert wrong(["Lower limit of accurate capacity", "points_cov.npz"], "en", "") == []
