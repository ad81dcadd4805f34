"""Certificates of the shipped examples: records, blocks of the certificate and its XML.

EXAMPLES                                  names of the examples with a capacity table
record_of_example(name)                   record as plain data, without Monte Carlo
certificate_blocks(name, language)        data of the blocks of the certificate
input_texts(name)                         every text file of the example
"""

import tempfile
from functools import cache
from pathlib import Path

from paper_cells import of_part

import tankcal
from tankcal import record as records
from tankcal.record import record_of
from tankcal.report.blocks import MIME
from tankcal.report.notebook import TEMPLATES, execute, join_templates, set_parameters
from tankcal.report.papers import parts_without_content

ROOT = Path("examples")
EXAMPLES = sorted(path.parent.name for path in ROOT.glob("*/job.toml"))
TEXT_FILES = (".toml", ".csv")


@cache
def record_of_example(name):
    """The record of an example as `record.load` reads it, computed without Monte Carlo."""
    record = record_of(tankcal.run(tankcal.load(ROOT / name), simulated=False))
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "record.json"
        records.save(record, path)
        return records.load(path)


@cache
def certificate_blocks(name, language):
    """The data of every block of the certificate of an example in a language."""
    record = record_of_example(name)
    notebook = join_templates("record.json", parts_without_content(record), TEMPLATES[:1])
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "record.json"
        records.save(record, path)
        set_parameters(notebook, {"RECORD": str(path), "LANGUAGE": language})
        cells = execute(notebook, Path(folder))["cells"]
    shown = [output["data"] for cell in cells for output in cell["outputs"] if "data" in output]
    return of_part([data[MIME] for data in shown if MIME in data], "certificate")


def input_texts(name):
    """The text of all input files of an example."""
    files = (path for path in (ROOT / name).rglob("*") if path.suffix in TEXT_FILES)
    return "\n".join(path.read_text(encoding="utf-8") for path in sorted(files))
