"""Document of an assessment: assessment.json, CSV files, workbook and report for the file."""

import re
from typing import ClassVar

from tankcal.products.assess.requirements import ASSESSMENT, GRADES, MAJOR, MINOR, RULE
from tankcal.report import blocks
from tankcal.report.plain import words_with_part
from tankcal.report.saved_document import SavedDocument, SavedPaper, bearable
from tankcal.report.tables import Column, Table
from tankcal.text.naming import split_unit
from tankcal.text.shipped import DEFAULT
from tankcal.text.words import load_words, message_sentence

RECORD_PARTS = {"budgets": "budget", "instruments": "equipment"}  # parts with another heading


class AssessmentPaper(SavedPaper):
    """Formatter of a `saved.AssessmentFile` in a language.

    Parameters
    ----------
    assessment : dict
        Plain data; checked against its schema.
    language : str, optional
        Element of languages.LANGUAGES; None: English.
    letterhead : letterhead.Letterhead, optional
        Letterhead of the assessing body.
    """

    kind, file = "assessment", ASSESSMENT.file
    attached: ClassVar[dict] = {ASSESSMENT.file: "assessment"}

    def __init__(self, assessment, language=None, letterhead=None):
        super().__init__(words_with_part(load_words(language or DEFAULT), "assess"))
        self.saved = self.record = ASSESSMENT.migrated(assessment, ASSESSMENT.file)
        self.letterhead = letterhead.data() if letterhead else None

    def subject(self):
        """Number of the certificate or tank; otherwise the assessed file."""
        record = self.record
        return bearable(record["number"] or record["tank"] or record["source"])

    def date(self):
        """Day of the assessment."""
        return self.record["day"]

    def sentence(self, finding):
        """Return the facts of a finding in the language."""
        return bearable(
            message_sentence(self.words, finding["text"], finding["code"], finding["values"])
        )

    def remedy(self, finding):
        """Return the remedy of a finding."""
        return self.words["remedies"].get(finding["code"], "")

    def source(self, row):
        """Return document, clause and basis of a requirement or finding."""
        document = self.word("bases.rule") if row["document"] == RULE else row["document"]
        named = bearable(f"{document}, {row['clause']}" if row["clause"] else document)
        return f"{named} ({self.words['bases'][row['basis']]})"

    def place(self, finding):
        """Return file, page and section of a finding."""
        page = self.word("texts.page", page=finding["page"]) if finding["page"] else ""
        section = self._name_section(finding["section"])
        return bearable(", ".join(filter(None, (finding["file"], page, section))))

    def _name_section(self, section):
        """Name of a section: label of a setting, or heading of a part of the record."""
        labels = self.words["desk"]["labels"] | self.words["labels_of_text"]
        part, *steps = re.findall(r"[^.[\]]+", section) or [""]
        heading = self.words["headings"].get(RECORD_PARTS.get(part, part))
        if section in labels or heading is None:
            return labels.get(section, section)
        if part == "budgets":  # counted from 1
            return f"{heading} {int(steps[0]) + 1}"
        return f"{heading}: {split_unit(steps[0])[0]}" if steps else heading

    def verdict(self):
        """Return the sentence on the number of findings of each grade."""
        counts = {
            grade: sum(finding["grade"] == grade for finding in self.record["findings"])
            for grade in GRADES
        }
        name = "verdict_none" if not counts[MAJOR] + counts[MINOR] else "verdict"
        return self.word(f"texts.{name}", **counts)

    def lines(self):
        """Return each finding as a line for the terminal (list of str)."""
        return [
            self.word(
                "texts.line",
                grade=self.words["grades"][finding["grade"]], place=self.place(finding),
                text=self.sentence(finding), source=self.source(finding),
                remedy=self.remedy(finding),
            )
            for finding in self.record["findings"]
        ]  # fmt: skip


FINDINGS = Table(
    "assessment_findings",
    (
        Column("number", decimals=0, csv="number", sheet=True, width=6),
        Column("grade", words="grades", csv="grade", sheet=True, width=16),
        Column("place", text=AssessmentPaper.place, sheet=True, csv="place", width=30),
        Column("text", text=AssessmentPaper.sentence, sheet=True, csv="text", width=60),
        Column("source", text=AssessmentPaper.source, sheet=True, csv="source", width=36),
        Column("remedy", text=AssessmentPaper.remedy, sheet=True, csv="remedy", width=60),
    ),
    rows=lambda assessment: [
        {"number": number} | finding for number, finding in enumerate(assessment["findings"], 1)
    ],
)
REQUIREMENTS = Table(
    "assessment_requirements",
    (
        Column("code", words="requirements", sheet=True, width=60, csv="code"),
        Column("source", text=AssessmentPaper.source, sheet=True, width=40, csv="source"),
        Column("outcome", words="outcomes", sheet=True, width=16, csv="outcome"),
    ),
    rows=lambda assessment: assessment["requirements"],
)


def pages(paper, folder=None, whole=False):
    """Blocks of the report of an `AssessmentPaper`."""
    return [
        *paper.head(folder),
        paper.facts(_facts(paper)),
        blocks.result(paper.word("labels.verdict"), paper.verdict()),
        *_findings(paper),
        blocks.with_next(paper.heading("requirements")),
        paper.show(REQUIREMENTS),
        paper.heading("limits"),
        blocks.listing(paper.words["standing"].values()),
        blocks.with_next(
            blocks.signature([paper.word("labels.assessor")], paper.word("dcc.sign_here"))
        ),
        blocks.end_mark(paper.word("texts.end")),
    ]


def _facts(paper):
    record = paper.record
    return [
        ("source", bearable(record["source"])),
        ("day", paper.day(record["day"])),
        *((key, record[key] and bearable(record[key])) for key in ("tank", "number", "laboratory")),
        ("software", record["software"] and f"tankcal {record['software']}"),
    ]


def _findings(paper):
    if not paper.record["findings"]:
        return []
    shown = []
    for number, finding in enumerate(paper.record["findings"], 1):
        title = f"{number}. {paper.words['grades'][finding['grade']]}: {paper.place(finding)}"
        shown += [
            blocks.with_next(blocks.heading(title, 2)),
            paper.facts([
                ("text", paper.sentence(finding)),
                ("source_of", paper.source(finding)),
                ("remedy", paper.remedy(finding)),
            ]),
        ]  # fmt: skip
    return [blocks.with_next(paper.heading("findings")), *shown]


def write_workbook(paper, path):
    """Write the workbook of an `AssessmentPaper`; equal data give equal bytes."""
    from tankcal.report.workbook.book import workbook_head
    from tankcal.report.workbook.sections import write_workbook as write

    record = paper.record
    head = workbook_head(
        record["tankcal"], tank=paper.subject(), date=record["day"], notice="",
        laboratory=paper.letterhead["name"] if paper.letterhead else "",
    )  # fmt: skip
    write(paper, path, "assessment", head, _sheets)


def _sheets(book):
    """Yield the content of each sheet, in order."""
    from tankcal.report.workbook.sections import Facts, Sentences, SheetContent, cell_table

    paper = book.paper
    facts = [(paper.label(key), value, None) for key, value in _facts(paper) if value]
    texts = [paper.verdict(), *paper.words["standing"].values()]
    yield SheetContent(
        "assessment", [Facts(facts), Sentences(texts)], landscape=False, widths=(42, 58)
    )
    for code, table in (
        ("assessment_findings", FINDINGS),
        ("assessment_requirements", REQUIREMENTS),
    ):
        yield SheetContent(code, [cell_table(book, table)], tab="result")


DOCUMENT = SavedDocument(
    ASSESSMENT,
    AssessmentPaper,
    lambda: (pages, write_workbook),
    tables={"findings.csv": FINDINGS},
    has_page=False,
)
