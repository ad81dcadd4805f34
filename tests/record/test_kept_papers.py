"""Kept records of the shipped examples give the same files again, whatever the libraries are.

What is compared is what a reader reads: every byte of the CSV files, every cell of the workbook
with its number format, every text and number of the papers before their pages are set. The bytes
of PDF, HTML and figures also tell the version of typst, XlsxWriter and matplotlib.

Write what is expected anew, for a change that is meant:

    PYTHONPATH=tests/support python tests/record/test_kept_papers.py
"""

import hashlib
import json
import lzma
import sys
import tempfile
from pathlib import Path

import openpyxl
import pytest
from paper_cells import paper_blocks

from tankcal.record import VERSION, load, migrated
from tankcal.report import outputs
from tankcal.report.notebook import TEMPLATES

KEPT = Path(__file__).parents[1] / "records"
ALL = sorted(KEPT.glob("*/*.json.xz"))
QUICK = "silva-1995.json.xz"


def fingerprint(content):
    text = content if isinstance(content, bytes) else json.dumps(content, default=str).encode()
    return hashlib.sha256(text).hexdigest()[:16]


def without_drawings(found):
    """Blocks without the drawings that matplotlib made of their numbers."""
    if isinstance(found, dict):
        return {
            key: without_drawings(one) for key, one in found.items() if key not in ("svg", "png")
        }
    return [without_drawings(one) for one in found] if isinstance(found, list) else found


def cells_of(sheet):
    return [
        (cell.coordinate, cell.value, cell.number_format)
        for row in sheet.iter_rows()
        for cell in row
        if cell.value is not None
    ]


def fingerprints(path, folder):
    """{file, or part of one: SHA-256} of what `tankcal report` makes of a kept record."""
    source = folder / "record.json"
    source.write_bytes(lzma.decompress(path.read_bytes()))
    outputs.rebuild(source, folder / "out")
    assert (folder / "out" / "record.json").read_bytes() == source.read_bytes()
    found = {one.name: fingerprint(one.read_bytes()) for one in (folder / "out").glob("*.csv")}
    (workbook,) = (folder / "out").glob("*.xlsx")
    for sheet in openpyxl.load_workbook(workbook):
        found[f"{workbook.name}: {sheet.title}"] = fingerprint(cells_of(sheet))
    part = ""
    parts = {}
    for block in paper_blocks(source, TEMPLATES):
        part = block["part"] if block["kind"] == "document" else part
        parts.setdefault(part, []).append(without_drawings(block))
    return found | {f"paper: {name}": fingerprint(blocks) for name, blocks in parts.items()}


def expected(path):
    """What is kept beside a record."""
    return path.with_name(path.name.replace(".json.xz", ".sha256.json"))


@pytest.mark.slow
@pytest.mark.parametrize(
    "path",
    [one if one.name == QUICK else pytest.param(one, marks=pytest.mark.study) for one in ALL],
    ids=lambda path: f"{path.parent.name}-{path.name}",
)
def test_a_kept_record_gives_the_same_files_again(path, tmp_path, monkeypatch):
    monkeypatch.setattr(outputs, "build", lambda *_: None)
    found = fingerprints(path, tmp_path)
    kept = json.loads(expected(path).read_text(encoding="utf-8"))
    changed = sorted(one for one in kept.keys() | found.keys() if kept.get(one) != found.get(one))
    assert changed == []


def test_a_record_of_each_example_is_kept_of_this_version():
    names = {path.name.removesuffix(".json.xz") for path in ALL if path.parent.name == str(VERSION)}
    assert names == {"silva-1995", "silva-1995-photos", "total-station"}


@pytest.mark.slow
@pytest.mark.parametrize("path", ALL, ids=lambda path: f"{path.parent.name}-{path.name}")
def test_a_kept_record_of_an_example_is_read(path, tmp_path):
    source = tmp_path / "record.json"
    source.write_bytes(lzma.decompress(path.read_bytes()))
    record = json.loads(source.read_text(encoding="utf-8"))
    assert load(source) == migrated(record, "record.json")


if __name__ == "__main__":
    outputs.build = lambda *_: None
    for one in ALL:
        with tempfile.TemporaryDirectory() as place:
            text = json.dumps(fingerprints(one, Path(place)), indent=1, sort_keys=True)
        expected(one).write_text(text + "\n", encoding="utf-8")
        sys.stdout.write(f"{expected(one)}\n")
