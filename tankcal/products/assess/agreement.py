"""Agreement of the printed certificate with its record, and of all files with each other.

The certificate is set again from the record, and each of its texts is searched in the PDF. So each
value of the record must be printed as the record states it: number, dates, headline, every row of
every table, every assumption. A certificate printed by another version of tankcal may use other
sentences; its labels with values, tables and results are compared, not its sentences.
"""

from tankcal import __version__
from tankcal.messages import message
from tankcal.products.assess.evidence import compact
from tankcal.products.assess.requirements import Finding
from tankcal.report.outputs import RECORD
from tankcal.report.verification import verify
from tankcal.report.verified_files import INPUT_CODES

_VALUES = ("key_values", "result", "table", "columns_table", "masthead", "hash_code")
LONGEST_TEXT = 90  # letters of a missing text in a finding


def check_print(evidence):
    """Yield each section of the certificate that lacks texts of the record."""
    is_same_version = evidence.record["tankcal"] == __version__
    body, heading = evidence.certificate.body, ""
    for block in evidence.blocks:
        if block["kind"] == "heading":
            heading = block["text"]
        if block["kind"] not in _VALUES and not is_same_version:
            continue
        texts = list(_texts_of(block))
        missing = [text for text in texts if compact(text) not in body]
        if missing:
            text = message(
                "assess_differs",
                "{count} of {all} texts of the record are not printed as recorded, such as: {text}",
                count=len(missing), all=len(texts), text=missing[0][:LONGEST_TEXT],
            )  # fmt: skip
            yield Finding(text, file=evidence.certificate.name, section=heading)


def check_files(evidence):
    """Yield disagreements of hashes and embedded files, as `tankcal verify` finds them."""
    for problem in verify(evidence.source, hashes_only=True).problems:
        if getattr(problem.expected, "code", "") in INPUT_CODES:
            continue  # input files are not part of a certificate
        text = message("assess_files", "{problem}", problem=problem.expected)
        yield Finding(text, file=problem.file or RECORD)


def _texts_of(block):
    """Yield the texts of a block, as they follow each other in the PDF."""
    kind = block["kind"]
    if kind == "key_values":
        yield from (f"{name} {value}" for name, value in block["items"] if value)
    elif kind in ("table", "columns_table"):
        formulas = {*block.get("formulas", ())}
        for row in block["rows"]:
            # A typeset formula has no text to compare: the cells around it are compared.
            for cells in _split_at(row, formulas):
                yield " ".join(map(str, cells))
    elif kind == "result":
        yield from (block["label"], block["text"], block["note"])
    elif kind == "masthead":
        yield from (block["title"], block["subtitle"], block["number"])
    elif kind == "hash_code":
        yield from (block["text"], block["code"])
    elif kind == "list":
        yield from block["items"]
    elif kind == "signature":
        yield from block["labels"]
    elif kind in ("paragraph", "notice", "heading", "end"):
        yield block["text"]


def _split_at(row, formulas):
    """Yield the runs of cells between the columns of formulas."""
    cells = []
    for column, cell in enumerate(row):
        if column in formulas:
            yield cells
            cells = []
        else:
            cells.append(cell)
    yield cells
