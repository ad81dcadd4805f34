"""`tankcal assess`: planted nonconformities are found, and sound certificates have none."""

import json
import shutil
from dataclasses import dataclass
from datetime import date
from pathlib import Path

import pypdf
import pytest
from example_certificates import EXAMPLES, ROOT
from written_pdfs import write_pdf

from tankcal.cli import main
from tankcal.products.assess.assessing import REQUIREMENTS, assess, plain_assessment
from tankcal.products.assess.checks import LABELS, PLACEHOLDER, find_claim, find_interval
from tankcal.products.assess.evidence import CERTIFICATE
from tankcal.products.assess.paper import DOCUMENT, AssessmentPaper
from tankcal.products.assess.requirements import (
    ASSESSMENT,
    MAJOR,
    MEMORY,
    OBSERVATION,
    READ,
    SUMMARY,
)
from tankcal.report.outputs import RECORD
from tankcal.text.shipped import LANGUAGES
from tankcal.text.words import load_words

DAY = date(2026, 11, 30)
# Examples that nobody issues, not even a fictitious laboratory: drafts on purpose.
DRAFTS = ("silva-1995", "silva-1995-photos", "total-station")
COMPLETE = [name for name in EXAMPLES if name not in DRAFTS]
SOUND_ENTRIES = {
    "number": "TC-2026-017",
    "laboratory": "Laboratory of Metrology",
    "laboratory_address": "1 Example Street, Exampletown",
    "customer": "Storage Ltd",
    "customer_address": "2 Example Street, Exampletown",
    "place": "Terminal, Exampletown",
    "date_of_issue": "2026-05-20",
    "method": "Strapping from outside",
    "traceability": "Master tape M-1, certificate M 1/2026",
    "conditions": "Sunny, wind below 3 m/s",
    "condition_of_tank": "Empty and clean",
    "authorised_by": "A. Example",
}
LETTERHEAD = """[laboratory]
name = "Laboratory of Metrology"
address = ["1 Example Street, Exampletown"]

[cmc.upright]
tanks = ["vertical"]
percent = 0.03
"""


def codes_of(assessment, grave=True):
    """Codes of the nonconformities, or with `grave` false of the observations."""
    return {
        finding.text.code
        for _, finding in assessment.findings
        if (finding.grade != OBSERVATION) is grave
    }


@pytest.fixture(scope="module")
def sound(tmp_path_factory):
    """Results of a complete certificate with rule and scope, of a tank without a notice."""
    folder = tmp_path_factory.mktemp("sound")
    shutil.copytree(ROOT / "strapping", folder / "job")
    text = (folder / "job" / "job.toml").read_text(encoding="utf-8")
    head = text[: text.index("[certificate]")]
    head = head.replace("step_m = 0.01", 'step_m = 0.1\nrule = "france_2003"')
    entries = "\n".join(
        f"{key} = {value}" if key == "date_of_issue" else f'{key} = "{value}"'
        for key, value in SOUND_ENTRIES.items()
    )
    (folder / "job" / "job.toml").write_text(f"{head}[certificate]\n{entries}\n", encoding="utf-8")
    (folder / "lab.toml").write_text(LETTERHEAD, encoding="utf-8")
    results = folder / "results"
    arguments = ["run", str(folder / "job"), "--quiet", "--out", str(results)]
    assert main([*arguments, "--letterhead", str(folder / "lab.toml")]) == 0
    return results


@pytest.fixture
def planted(sound, tmp_path):
    """Function that plants a change into a copy of the record and assesses the copy."""

    def plant(change, letterhead=None, with_print=False):
        folder = tmp_path / "planted"
        folder.mkdir()
        names = (RECORD, "letterhead.json", *((CERTIFICATE,) if with_print else ()))
        for name in names:
            shutil.copy(sound / name, folder / name)
        record = json.loads((folder / RECORD).read_text(encoding="utf-8"))
        change(record)
        (folder / RECORD).write_text(json.dumps(record), encoding="utf-8")
        if letterhead:
            saved = json.loads((folder / "letterhead.json").read_text(encoding="utf-8"))
            (folder / "letterhead.json").write_text(
                json.dumps(saved | letterhead), encoding="utf-8"
            )
        return assess(folder, DAY)

    return plant


# ---- nonconformities planted into the record


# Observations of the sound certificate: what an assessor would ask about it.
QUESTIONS = {
    "assess_undeclared", "assess_no_register", "assess_no_reference_height", "assess_small_u",
}  # fmt: skip


@dataclass(frozen=True)
class Plant:
    """Change of a record, as key path and value (None: deleted), and the expected finding."""

    code: str
    path: tuple
    value: object = None
    grave: bool = True

    def __call__(self, record):
        *parents, last = self.path
        for key in parents:
            record = record[key]
        if self.value is None and isinstance(record, dict) and last not in ("dof", "date", "rule"):
            del record[last]
        else:
            record[last] = self.value(record[last]) if callable(self.value) else self.value


ENTRY = ("job", "certificate")
TABLE = ("capacity",)
EQUIPMENT = {
    **dict.fromkeys(
        ("description", "serial_number", "laboratory", "date", "due", "uncertainty"), ""
    ),
    "name": "T-12",
    "certificate": "7",
}
OVERRULED = {
    "each": [{
        "what": "circumferences.csv 2", "kind": "reading", "decision": "keep", "reason": "checked",
        "by": "", "date": "2026-05-05", "searched": None, "off_m": None, "w": None,
        "moved_m3": None, "is_outrageous": False, "row": 2,
    }],
    "moved_m3": None, "others": [],
}  # fmt: skip
PLANTS = [
    Plant("assess_missing", (*ENTRY, "customer")),
    Plant("assess_missing", (*ENTRY, "authorised_by"), "  "),
    Plant("assess_placeholder", (*ENTRY, "conditions"), "TBD"),
    Plant("assess_placeholder", ("job", "tank", "id"), "XXX"),
    Plant("assess_issued_early", (*ENTRY, "date_of_issue"), "2026-05-01"),
    Plant("assess_issued_late", (*ENTRY, "date_of_issue"), "2027-05-20"),
    Plant("assess_survey_order", (*ENTRY, "survey_end"), "2026-04-30"),
    Plant("assess_no_survey_date", ("job", "survey", "date"), ""),
    Plant("assess_interval", (*ENTRY, "remarks"), "Next calibration: May 2031"),
    Plant("assess_no_trace", ("strapping", "tapes"), lambda tapes: [
        tape | {"certificate": ""} for tape in tapes]),
    Plant("assess_no_trace", ("job", "equipment"), [EQUIPMENT | {"certificate": ""}]),
    Plant("assess_due", ("job", "equipment"), [EQUIPMENT | {"due": "2026-04-30"}]),
    Plant("assess_calibrated_late", ("job", "equipment"), [EQUIPMENT | {"date": "2026-06-30"}]),
    Plant("assess_no_temperature", ("job", "survey", "shell_temperature_c"), lambda _: None),
    Plant("assess_overruled", ("overrulings",), OVERRULED),
    Plant("assess_table", (*TABLE, "volume_m3", 40), lambda volume: volume - 18.0),
    Plant("assess_no_u", (*TABLE, "stated_U_m3", 30), 0.0),
    Plant("assess_k_u", (*TABLE, "stated_U_m3", 30), lambda U: 0.8 * U),
    Plant("assess_probability", ("job", "table", "coverage_probability"), 0.6827),
    Plant("assess_k_dof", (*TABLE, "dof", 30), 4.0),
    Plant("assess_factor", (*TABLE, "u_m3", 30), lambda u: 0.5 * u),
    Plant("assess_shares", ("budget", 0, "share"), lambda share: share + 0.1),
    Plant("assess_types", ("budgets", 1, "lines", 0, "type"), "A"),
    Plant("assess_not_validated", ("monte_carlo", "rows", "validated", 30), False),
    Plant("assess_two_values", ("budgets", 0, "volume_m3"), lambda volume: volume + 1.0),
    Plant("assess_verdict", ("rule", "uncertainty", 0, "from_m"), 0.0),
    Plant("assess_verdict", ("rule", "uncertainty", 0, "passed"), True),
    Plant("assess_too_large", ("rule", "rule", "largest_capacity_m3"), 1000.0),
    Plant("assess_notice", (*ENTRY, "notice"), "EXAMPLE", grave=False),
    Plant("assess_bias", ("corrections", 3, "applied"), False, grave=False),
]  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize("plant", PLANTS, ids=lambda plant: f"{plant.code} {plant.path[-1]}")
def test_a_planted_nonconformity_is_found(planted, plant):
    assert plant.code in codes_of(planted(plant), plant.grave)


@pytest.mark.slow
def test_the_unchanged_record_has_no_finding_but_the_missing_print(planted):
    """The control of the plants: none of their codes is found without a change."""
    assessment = planted(lambda record: None)
    assert codes_of(assessment) == {"assess_no_certificate"}
    assert codes_of(assessment, grave=False) == QUESTIONS


@pytest.mark.slow
def test_an_answered_question_is_no_longer_asked(planted):
    def answer(record):
        record["job"]["datum"]["reference_height_m"] = 9.1
        record["job"]["equipment"] = [EQUIPMENT]
        record["capacity"]["volume_m3"][-1] *= 0.7

    assert not codes_of(planted(answer), grave=False) & (QUESTIONS - {"assess_undeclared"})


@pytest.mark.slow
def test_type_a_needs_degrees_of_freedom(planted):
    def evaluate(record):
        for budget in (record["budget"], *(budget["lines"] for budget in record["budgets"])):
            for line in budget:
                line["type"] = "A"

    assert "assess_type_a" in codes_of(planted(evaluate))


@pytest.mark.slow
def test_a_claim_needs_a_decision_rule(planted):
    def claim(record):
        record["rule"] = None
        record["job"]["certificate"]["remarks"] = "The tank complies with OIML R 71"

    assert "assess_claim" in codes_of(planted(claim))


@pytest.mark.slow
def test_a_deviation_is_decided_again(planted):
    """U = 0.5, limit 1, deviation 0.8: in the guard band, so not accepted."""

    def decide(record):
        limit = record["rule"]["uncertainty"][0]
        record["rule"]["deviation"] = [{
            **{key: limit[key] for key in ("name", "clause", "verified", "limit", "of")},
            "limit_m3": 1.0, "side": "both", "guard": "U", "code": "conforms", "passed": True,
            "volume_m3": 100.8, "stated_m3": 100.0, "deviation_m3": 0.8, "U_m3": 0.5, "k": 2.0,
            "u_m3": 0.25, "dof": None, "high_m": 2.0, "low_m": None, "guard_m3": 0.5,
            "tolerance_m3": [99.0, 101.0], "accepted_m3": [99.5, 100.5], "probability": 0.79,
        }]  # fmt: skip

    assert "assess_decision" in codes_of(planted(decide))


@pytest.mark.slow
def test_u_below_the_capability_and_a_tank_outside_the_scope_are_found(planted, tmp_path):
    entry = {"name": "a", "tanks": ["vertical"], "from_m3": None, "to_m3": None, "percent": 0.1}
    assert "assess_below_cmc" in codes_of(planted(lambda record: None, {"cmc": [entry]}))
    shutil.rmtree(tmp_path / "planted")

    def accredit(record):
        record["job"]["certificate"]["accreditation_number"] = "CAL 0123"

    elsewhere = entry | {"tanks": ["sphere"]}
    assert "assess_outside_scope" in codes_of(planted(accredit, {"cmc": [elsewhere]}))


# ---- nonconformities planted into the print


@pytest.mark.slow
@pytest.mark.parametrize(
    ("path", "value", "section"),
    [
        ((*ENTRY, "customer"), "Somebody else", ""),
        ((*ENTRY, "date_of_issue"), "2026-06-20", ""),
        ((*TABLE, "volume_m3", 50), lambda volume: volume + 0.1, "Capacity table"),
        ((*TABLE, "stated_U_m3", 84), lambda U: U + 0.2, ""),
        (("corrections", 0, "size_m3"), lambda size: 2 * size, "Corrections"),
        (("courses", 2, "inside_radius_m"), lambda radius: radius + 0.01, "Courses"),
    ],
)
def test_a_certificate_of_another_record_is_found(planted, path, value, section):
    assessment = planted(Plant("assess_differs", path, value), with_print=True)
    assert {"assess_differs", "assess_files"} <= codes_of(assessment)
    sections = [f.section for _, f in assessment.findings if f.text.code == "assess_differs"]
    assert section in sections


@pytest.mark.slow
def test_a_lost_page_is_found(sound, tmp_path):
    shutil.copytree(sound, tmp_path / "results")
    path = tmp_path / "results" / CERTIFICATE
    writer = pypdf.PdfWriter()
    for page in pypdf.PdfReader(path).pages[:-1]:
        writer.add_page(page)
    writer.write(path)
    found = codes_of(assess(tmp_path / "results", DAY))
    assert {"assess_no_end", "assess_page_number", "assess_differs"} <= found


@pytest.mark.slow
def test_the_print_of_a_draft_is_found(sound, tmp_path):
    """The record was completed after printing: title, number and rule are those of the draft."""
    shutil.copytree(sound, tmp_path / "draft")
    record = json.loads((tmp_path / "draft" / RECORD).read_text(encoding="utf-8"))
    del record["job"]["certificate"]["number"]
    record["rule"] = None
    for name in ("SHA256SUMS", CERTIFICATE):
        (tmp_path / "draft" / name).unlink()
    (tmp_path / "draft" / RECORD).write_text(json.dumps(record), encoding="utf-8")
    assert main(["report", str(tmp_path / "draft"), "--quiet", "--out", str(tmp_path / "p")]) == 0
    shutil.copytree(sound, tmp_path / "results")
    shutil.copy(tmp_path / "p" / CERTIFICATE, tmp_path / "results" / CERTIFICATE)
    found = codes_of(assess(tmp_path / "results", DAY))
    expected = {"assess_title", "assess_no_number", "assess_rule_unnamed", "assess_statement"}
    assert expected <= found


@pytest.mark.slow
def test_a_rule_that_nobody_read_must_not_be_printed(planted):
    def forget(record):
        record["rule"]["verified"] = False

    assert "assess_rule_unread" in codes_of(planted(forget, with_print=True))


@pytest.mark.slow
def test_the_sound_certificate_has_no_nonconformity(sound, capsys):
    assert main(["assess", str(sound), "--json"]) == 0
    answer = json.loads(capsys.readouterr().out)
    assert answer["exit_status"] == 0
    assert {finding["code"] for finding in answer["findings"]} == QUESTIONS
    outcomes = {row["code"]: row["outcome"] for row in answer["requirements"]}
    assert set(outcomes.values()) == {"met", "observed"}  # every requirement was checked


# ---- certificates without nonconformity


@pytest.mark.slow
@pytest.mark.parametrize("name", COMPLETE)
def test_complete_examples_have_no_nonconformity(name, tmp_path):
    """Each in one of three languages, and once more as a PDF of another laboratory."""
    language = LANGUAGES[COMPLETE.index(name) % len(LANGUAGES)]
    results = tmp_path / "results"
    assert main(["run", str(ROOT / name), "--quiet", "--no-papers", "--out", str(results)]) == 0
    printed = tmp_path / "printed"
    arguments = ["--quiet", "--language", language, "--out", str(printed)]
    assert main(["report", str(results), *arguments]) == 0
    assessment = assess(printed, DAY)
    assert [
        str(finding.text) for _, finding in assessment.findings if finding.grade != OBSERVATION
    ] == []
    assert assessment.language == language
    writer = pypdf.PdfWriter()
    for page in pypdf.PdfReader(printed / CERTIFICATE).pages:
        writer.add_page(page)
    writer.write(tmp_path / "alone.pdf")
    alone = assess(tmp_path / "alone.pdf", DAY)
    assert [
        str(finding.text) for _, finding in alone.findings if finding.grade != OBSERVATION
    ] == []


def test_ten_examples_are_complete():
    assert len(COMPLETE) >= 10


# ---- the certificate of another laboratory


FOREIGN = [
    "CERTIFICATE OF CALIBRATION No. 4711      Page 1 of 1",
    "Laboratory: Nordic Tank Survey Ltd.   Customer: Oil Depot AS, Place: Harbour 3",
    "Tank T-5   Method: ISO 7507-1   Date: 2025-03-04   Conditions: 12 C",
    "Traceability: tape 17, certificate 88   Reference temperature 15 C",
    "Capacity 1369.66 m3 with U = 0.56 m3, k = 2, expanded uncertainty",
    "The results relate only to this tank. Not to be reproduced except in full.",
    "Authorised by: N. Example",
]


def foreign(tmp_path, *more, dropped="", rows=None):
    lines = [line for line in FOREIGN if not dropped or dropped not in line]
    words = [(40, 800 - 14 * k, line) for k, line in enumerate([*lines, *more])]
    top = 660 - 14 * len(more)
    words += [(40, top, "height_m"), (140, top, "volume_m3")]
    for k, (height, volume) in enumerate(rows or [(j / 10, 16.3 * j) for j in range(12)], 1):
        words += [(40, top - 12 * k, f"{height:.2f}"), (140, top - 12 * k, f"{volume:.2f}")]
    return assess(write_pdf([words], tmp_path / "foreign.pdf"), DAY)


@pytest.mark.slow
def test_a_complete_foreign_certificate_has_no_finding(tmp_path):
    assert foreign(tmp_path).findings == []


@pytest.mark.slow
@pytest.mark.parametrize(
    ("more", "dropped", "code"),
    [
        ((), "Traceability", "assess_not_found"),
        ((), "Authorised", "assess_not_found"),
        (("The tank complies with OIML R 71.",), "", "assess_claim"),
        (("Valid until 4 March 2035",), "", "assess_interval"),
        (("At 8.000 m: U = 0.5634 m3",), "", "assess_digits"),
        (("Volume 1369.7 m3 with U = 0.56 m3",), "", "assess_decimals"),
    ],
)
def test_a_planted_line_of_a_foreign_certificate_is_found(tmp_path, more, dropped, code):
    assert codes_of(foreign(tmp_path, *more, dropped=dropped)) == {code}


@pytest.mark.slow
def test_a_wrong_digit_of_a_foreign_table_is_found(tmp_path):
    rows = [(k / 10, 16.3 * k + 20 * (k == 6)) for k in range(12)]
    assert codes_of(foreign(tmp_path, rows=rows)) == {"assess_table"}


# As laboratories of Brazil and Mexico write, with tables in layouts of their own.
PORTUGUESE = [
    "METROTANQUE Serviços de Metrologia Ltda.  CERTIFICADO Nº MT-0457/2025  Página 1/2",
    "Contratante: Distribuidora Exemplo, Santos/SP   Objeto: tanque vertical TQ-4501",
    "Local da calibração: Terminal de Santos   Data da calibração: 12/03/2025",
    "Procedimento: PT-012, cintamento externo   Condições ambientais: costado a 27,4 °C",
    "Padrões utilizados: trena TR-07, certificado RBC 1234/2024, validade: 05/2026",
    "Capacidade na altura de 5,99 m: 611,41 m³ ± 0,61 m³. Temperatura de referência: 20 °C.",
    "A incerteza expandida é a incerteza padrão combinada multiplicada por k = 2,00, que para uma",
    "distribuição normal corresponde a uma probabilidade de abrangência de aproximadamente 95 %.",
    "Os resultados referem-se exclusivamente ao item calibrado. A reprodução só é permitida na",
    "íntegra. Os resultados são rastreáveis ao SI. Signatário autorizado: Eng. José Exemplo",
]
SPANISH = [
    "AFOROS Y METROLOGÍA S.A. de C.V., acreditación V-00 vigente   Informe núm. 118   Hoja 1 de 3",
    "CERTIFICADO DE CALIBRACIÓN   Solicitante: Refinadora Ejemplo   Tanque: TV-2003",
    "Lugar: patio de tanques, Veracruz   Fecha de calibración: 2025-02-17",
    "Método: triangulación óptica interna   Condiciones: temperatura ambiente 31 °C",
    "Patrones: estación total trazable al CENAM, certificado CNM-CC-740-111/2024",
    "Referida a 20 °C. Volumen: 611.41 m³, con una incertidumbre expandida U = 0.55 m³, k = 2",
    "Este informe solo ampara al tanque descrito y no debe reproducirse parcialmente.",
    "Aprobó: Ing. María Ejemplo, signataria autorizada",
]
SECTION_M2 = 102.07  # area of both tanks


def wide_page():
    """A table of decimetres by centimetres, in litres with a point between thousands."""
    cells = [["dm", *map(str, range(10))]]
    cells += [
        [
            str(d),
            *(f"{round(SECTION_M2 * (10 * d + c) * 10):,}".replace(",", ".") for c in range(10)),
        ]
        for d in range(60)
    ]
    return [
        (40 + 48 * k, 800 - 12 * row, cell)
        for row, line in enumerate(cells)
        for k, cell in enumerate(line)
    ]


def block_pages():
    """A table in two blocks of columns, each of which continues on the next page."""
    pages = []
    for page in range(2):
        words = [
            (40 + 80 * k, 800, name) for k, name in enumerate(["Altura (m)", "Volumen (m3)"] * 2)
        ]
        for line in range(50):
            for block in range(2):
                height = (100 * block + 50 * page + line) / 100
                words += [(40 + 160 * block, 788 - 12 * line, f"{height:.2f}")]
                words += [(120 + 160 * block, 788 - 12 * line, f"{SECTION_M2 * height:.3f}")]
        pages.append(words)
    return pages


def in_language(lines, pages, path, *more, dropped=""):
    kept = [line for line in lines if not dropped or dropped not in line]
    head = [(40, 800 - 14 * k, line) for k, line in enumerate([*kept, *more])]
    return assess(write_pdf([head, *pages], path), DAY)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("lines", "pages"), [(PORTUGUESE, [wide_page()]), (SPANISH, block_pages())], ids=["pt", "es"]
)
def test_a_complete_certificate_in_other_words_has_no_finding(lines, pages, tmp_path):
    assert in_language(lines, pages, tmp_path / "foreign.pdf").findings == []


@pytest.mark.slow
@pytest.mark.parametrize(
    ("more", "dropped", "code"),
    [
        (("O tanque atende ao Regulamento Técnico.",), "", "assess_claim"),
        (("Estado do costado: bom. Próxima", "calibração: março de 2035"), "", "assess_interval"),
        (("Na altura de 3 m: U = 0,5634 m³",), "", "assess_digits"),
        ((), "Contratante", "assess_not_found"),
        ((), "Local da", "assess_not_found"),
        ((), "referem-se exclusivamente", "assess_not_found"),
    ],
)
def test_a_planted_line_of_a_portuguese_certificate_is_found(tmp_path, more, dropped, code):
    path = tmp_path / "foreign.pdf"
    assert codes_of(in_language(PORTUGUESE, [wide_page()], path, *more, dropped=dropped)) == {code}


# ---- words, sources, documents


@pytest.mark.parametrize(
    "text",
    ["TBD", "xxx", "???", "-", "n/a", "N.A.", "<name>", "[address]", "A preencher", "Por definir",
     "to be filled in"],
)  # fmt: skip
def test_placeholders(text):
    assert PLACEHOLDER.fullmatch(text)


@pytest.mark.parametrize("text", ["None: simulated", "T 12/2026", "A. Example", "Xanthi", "TBX-7"])
def test_facts_are_no_placeholders(text):
    assert not PLACEHOLDER.fullmatch(text)


def test_claims_and_intervals_are_found_in_three_languages():
    assert all(map(find_claim, ("It complies with R 71", "Está conforme", "Cumple con la norma")))
    assert all(map(find_interval, ("Valid until 2031", "Válido até 2031", "Válido hasta 2031")))
    assert not find_claim("Measured in accordance with ISO 7507-1")
    assert not find_interval("Recalibration in 10 years by Portaria 103/2022")
    assert not find_interval("Next calibration in 5 years, as the customer requested")
    assert not find_interval("Trena TR-07, certificado RBC 1234/2024, validade: 05/2026")


def test_only_clauses_that_were_read_are_cited_as_read():
    """The documents whose text was read, by the project's notes; the rule carries its own flag."""
    read = {(r.document, r.clause) for r in REQUIREMENTS if r.basis == READ}
    assert read == {
        ("ISO/IEC 17025:2017", "7.8.6"), ("ILAC-G8:09/2019", "4.2"), ("JCGM 101:2008", "8"),
        *(("JCGM 100:2008", clause) for clause in ("5.2", "5.1.3", "4.2, 4.3", "4.3")),
    }  # fmt: skip
    assert {r.basis for r in REQUIREMENTS} == {READ, SUMMARY, MEMORY}


PLACES = {
    "certificate.number": ("Certificate number", "Número do certificado", "Número del certificado"),
    "capacity.U_m3": ("Capacity table: U", "Tabela volumétrica: U", "Tabla de capacidad: U"),
    "budgets[1]": ("Uncertainty budget 2", "Balanço de incerteza 2", "Balance de incertidumbre 2"),
    "instruments.tape": ("Measuring equipment: tape", "Equipamentos de medição: tape",
                         "Equipos de medición: tape"),
    "volume_m3, 12": ("volume_m3, 12",) * 3,
}  # fmt: skip


def test_the_place_of_a_finding_has_the_label_of_the_form():
    plain = {
        "format": ASSESSMENT.format, "tankcal": "1", "notice": "", "source": "x", "tank": None,
        "day": "2026-11-30", "number": None, "laboratory": None, "software": None,
        "language": None, "requirements": [], "findings": [],
    }  # fmt: skip
    for place, language in enumerate(("en", "pt-BR", "es")):
        paper = AssessmentPaper(plain, language)
        for section, names in PLACES.items():
            finding = {"file": RECORD, "page": None, "section": section}
            assert paper.place(finding) == f"{RECORD}, {names[place]}"


@pytest.mark.parametrize("language", LANGUAGES)
def test_every_requirement_and_remedy_has_words(language):
    words = load_words(language)["assess"]
    assert set(words["requirements"]) == {requirement.code for requirement in REQUIREMENTS}
    assert set(words["labels_of_text"]) == set(LABELS)
    codes = set()
    for path in Path("tankcal/products/assess").glob("*.py"):
        parts = path.read_text(encoding="utf-8").split('"assess_')[1:]
        codes |= {f"assess_{part.split(chr(34))[0]}" for part in parts}
    assert set(words["remedies"]) == codes - {"assess_nothing", "assess_no_table"}


@pytest.mark.slow
@pytest.mark.parametrize("language", LANGUAGES)
def test_the_document_states_every_finding(planted, language, tmp_path):
    plain = plain_assessment(planted(Plant("", (*ENTRY, "customer"))))
    written = DOCUMENT.write(plain, tmp_path / "out", language)
    assert [path.name for path in written] == [
        "assessment.json", "findings.csv", "assessment.xlsx", "assessment.pdf", "SHA256SUMS",
    ]  # fmt: skip
    reader = pypdf.PdfReader(tmp_path / "out" / "assessment.pdf")
    text = "".join(page.extract_text() for page in reader.pages)
    compacted = "".join(text.split()).replace("-", "")
    paper = AssessmentPaper(plain, language)
    assert plain["findings"][0]["grade"] == MAJOR
    for finding in plain["findings"]:
        for part in (paper.sentence(finding), paper.remedy(finding)):
            assert part
            assert "".join(part.split()).replace("-", "") in compacted
    assert DOCUMENT.load(tmp_path / "out" / "assessment.json") == plain


@pytest.mark.slow
def test_the_command_has_exit_status_2_for_a_nonconformity(sound, tmp_path, capsys):
    shutil.copy(sound / RECORD, tmp_path / RECORD)
    assert main(["assess", str(tmp_path), "--language", "pt-BR"]) == 2
    out = capsys.readouterr().out
    assert out.startswith("não conformidade maior: certificate.pdf")
    assert out.splitlines()[-1].startswith("Não conformidades maiores: 1;")


def test_a_folder_without_record_is_refused_in_one_line(tmp_path, capsys):
    assert main(["assess", str(tmp_path)]) == 2
    assert "contains no record.json" in capsys.readouterr().err
