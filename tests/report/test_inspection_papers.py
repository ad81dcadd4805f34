"""The papers of an inspection: what they show, in every language, whatever was inspected."""

import json
import re
import shutil
import subprocess
import tomllib
from pathlib import Path
from statistics import NormalDist

import numpy as np
import openpyxl
import pytest
from inspection_files import KINDS, TYPESET, few, hostile, inspection, plain, unjudged
from invented_language import bracketed, without_brackets
from paper_pages import LEAST_FILLED, filled, lone_headings, pages_of, sparse_pages
from paper_words import texts_in, texts_of

import tankcal
from tankcal.cli import main
from tankcal.errors import InputError
from tankcal.record.inspection import CHECKS, VERDICTS
from tankcal.report import blocks
from tankcal.report.inspection import (
    DOCUMENT,
    InspectionPaper,
    rebuild,
    tables,
    write_inspection,
)
from tankcal.report.inspection import pages as report_pages
from tankcal.report.inspection import (
    pages as wall,
)
from tankcal.report.inspection import tables as papers
from tankcal.report.inspection.pages import (
    checks,
    counts,
    courses,
    departures,
    edges,
    keep_end_together,
    levels,
    limits,
    pages,
    points,
    reading,
    result,
    settlement_blocks,
    welds,
)
from tankcal.report.pdf import pdf
from tankcal.text.shipped import DEFAULT, LANGUAGES
from tankcal.text.words import load_words

pytestmark = pytest.mark.slow  # seconds of runs and papers

LANGUAGE_OF = dict(zip(KINDS, [*LANGUAGES, "pt-BR"], strict=True))
RULES = Path(tankcal.__file__).parent / "products" / "inspection" / "rules"
PROGRAM = {"tankcal", "inspection", "mm", "xlsx"}  # and units
SPACE = "\N{NO-BREAK SPACE}"
MINUS = "\N{MINUS SIGN}"


def table_of(blocks, beginning):
    """The rows of the table whose caption begins so."""
    (one,) = (b.data for b in blocks if (b.data.get("caption") or "").startswith(beginning))
    return one["rows"]


# ---- numbers


def test_the_table_of_checks_has_the_numbers_of_the_example():
    """Published example: 16 points, S 4.81 mm at the fifth, limit 6.28 mm, U 2.40 mm: guard."""
    paper = InspectionPaper(plain())
    rows = table_of(checks(paper), "Every check")
    (row,) = (r for r in rows if r[:2] == ["Settlement: S, all points", "2026, 90.0°"])
    share = NormalDist(4.81, 2.40 / 1.96).cdf(6.28)  # the lower limit is nine u away
    assert row[2:6] == [f"+4.81{SPACE}mm", f"2.40{SPACE}mm", f"≤{SPACE}6.28{SPACE}mm{SPACE}*",
                        "CONDITIONAL PASS"]  # fmt: skip
    assert float(row[6].removesuffix(f"{SPACE}%")) == pytest.approx(100 * share, abs=0.15)


def test_an_epoch_says_plane_limits_and_verdicts():
    """The published numbers of the example, to the printed digit."""
    paper = InspectionPaper(plain())
    blocks = settlement_blocks(paper, paper.record["settlements"][1])
    said = " ".join(texts_of(blocks)).replace(SPACE, " ")
    for number in (
        *("17.48 mm", "327.7°", "1.64 mm/m", "a = 100.21 mm", "14.78 mm", f"{MINUS}9.33 mm"),
        *("R² = 0.9675", "6.28 mm for 16 points, 4.18 m apart", "8 points, it is 25.12 mm"),
    ):
        assert number in said
    verdicts = {row[0]: row[1:] for row in table_of(blocks, "2026: verdicts")}
    assert verdicts["Settlement: S, all points"][-1] == "CONDITIONAL PASS"
    assert verdicts["Settlement: S, spaced points"][-1] == "passed"
    assert verdicts["Settlement: curvature"][2:5] == [
        f"+0.380{SPACE}mm/m²", f"0.090{SPACE}mm/m²", f"≤{SPACE}0.718{SPACE}mm/m²{SPACE}*",
    ]  # fmt: skip
    of_point = {row[0]: row for row in table_of(points(paper), "2026: points")}
    published = (-0.23, 1.38, -2.69, -1.22, 4.81, -0.46, -2.35, -0.24, 1.98, 0.87, -4.26, 1.42,
                 0.84, 1.01, 0.10, -0.96)  # fmt: skip
    shown = [float(of_point[f"P{n}"][4].replace(MINUS, "-")) for n in range(1, 17)]
    assert shown == pytest.approx(published, abs=1e-9)


def test_a_ratio_is_to_be_at_least_its_limit_and_has_no_sign():
    found = plain()
    one = next(c for c in found["checks"] if c["code"] == "settlement_cosine")
    paper = InspectionPaper(found)
    assert (paper.value(one), paper.limit(one)) == ("0.9611", f"≥{SPACE}0.9{SPACE}*")


def test_probabilities_keep_away_from_certainty():
    paper, one = InspectionPaper(plain()), plain()["checks"][0]
    said = [paper.probability(one | {"probability": p}) for p in (1.0, 0.8849, 1e-9, None)]
    assert said == [f">{SPACE}99.9{SPACE}%", f"88.5{SPACE}%", f"<{SPACE}0.1{SPACE}%", None]


def test_courses_are_ranges_of_what_was_saved():
    """Property: each from the arrays of the file by another way."""
    found = plain()
    rows = {row["course"]: row for row in tables.course_rows(found)}
    departure = np.array(found["generatrices"]["departure_mm"])
    course = np.array(found["generatrices"]["course"])
    for number, row in rows.items():
        assert row["plumb_least"] == departure[course == number].min()
        assert row["plumb_most"] == departure[course == number].max()
    worst = max(found["levels"][3]["departure_mm"], key=abs)
    assert rows[4]["round_worst"] == worst
    assert "banding" not in rows[6]
    assert set(rows) == {1, 2, 3, 4, 5, 6}


def test_levels_have_the_limit_of_their_height():
    found = plain()
    rows = tables.level_rows(found)
    assert [row["limit"] for row in rows] == [19.0] + [57.0] * 5
    found["checks"] = [one for one in found["checks"] if one["code"] != "roundness_high"]
    assert [row["limit"] for row in tables.level_rows(found)] == [19.0] + [None] * 5


def test_shown_levels_are_the_low_one_the_worst_and_the_highest():
    found = plain()
    level = found["levels"][0]
    found["levels"] = [
        level | {"height_m": 0.3 + n, "departure_mm": [0.5 * n if n != 7 else 30.0, 1.0, 1.0],
                 "azimuth_deg": [0.0, 120.0, 240.0], "U_mm": [1.0, 1.0, 1.0]}
        for n in range(20)
    ]  # fmt: skip
    heights = [one["height_m"] for one in wall.select_levels(found)]
    assert len(heights) == wall.MOST_LEVELS
    assert {0.3, 7.3, 19.3} <= set(heights)


def test_the_largest_gaps_come_first_and_open_ones_never():
    found = plain()
    found["gaps"][0]["gap_mm"] = None
    sizes = [abs(one["gap_mm"]) for one in tables.select_largest_gaps(found, "peaking")]
    known = [o["gap_mm"] for o in found["gaps"][1:] if o["kind"] == "peaking"]
    assert sizes == sorted(map(abs, known), reverse=True)[: tables.MOST_GAPS]


# ---- what is said


def test_sections_in_which_nothing_is_known_are_left_out():
    found = plain()
    closed = [one | {"gap_mm": None, "U_mm": None} for one in found["gaps"]]
    assert welds(InspectionPaper(found))
    assert welds(InspectionPaper(found | {"gaps": closed})) == []
    assert courses(InspectionPaper(found | {"gaps": closed}))
    nothing = {"gaps": closed, "levels": [], "generatrices": None}
    assert courses(InspectionPaper(found | nothing)) == []


def test_how_many_checks_came_out_how():
    assert counts(InspectionPaper(plain())) == (
        "1 check beyond its limit; 1 beyond its limit by less than U; 2 within their limits by "
        "less than U; 20 passed"
    )
    assert counts(InspectionPaper(unjudged())) == "5 without a limit"
    assert counts(InspectionPaper(few())) == "6 not determined; 4 passed"
    assert counts(InspectionPaper(plain() | {"checks": []})) == "no check was possible"


def test_a_largest_reading_is_shown_beside_its_estimate():
    paper = InspectionPaper(plain())
    said = settlement_blocks(paper, paper.record["settlements"][1])
    rows = {row[0]: row for row in table_of(said, "2026: verdicts")}
    assert rows["Settlement: S, all points"][2:4] == [f"+5.31{SPACE}mm", f"+4.81{SPACE}mm"]
    old = plain()
    for one in old["checks"]:
        one |= {"reading": None, "U_reading": None}
    said = settlement_blocks(InspectionPaper(old), old["settlements"][1])
    assert table_of(said, "2026: verdicts")[1][2] == f"+4.81{SPACE}mm"


@pytest.mark.parametrize("language", LANGUAGES)
def test_a_file_of_version_1_keeps_its_verdicts_and_its_rule(language):
    """Before version 2 each figure beyond its limit was failed."""
    new = plain()
    old = {key: one for key, one in new.items() if key != "decision"}
    old |= {"format": "tankcal-inspection/1"}
    old["checks"] = [
        {key: value for key, value in one.items() if key not in ("reading", "U_reading")}
        | ({"verdict": "failed"} if one["verdict"] == "guard_band_beyond" else {})
        for one in new["checks"]
    ]
    paper = InspectionPaper(old, language)
    words = paper.words["texts"]
    said = texts_of(checks(paper))
    rule = words["decision_simple_beyond"].partition("{k}")[2]
    assert any(rule in text for text in said)
    assert not any(words["decision"].partition("{k}")[2] in text for text in said)
    assert sum(paper.verdict(one) == paper.words["verdicts"]["failed"]
               for one in paper.record["checks"]) == 2  # fmt: skip


def test_how_the_tank_was_built_is_said_unless_an_earlier_epoch_takes_it_out():
    built = "The deviations include the as-built shape of the tank"
    assert any(built in text for text in texts_of(reading(InspectionPaper(few()))))
    assert not any(built in text for text in texts_of(reading(InspectionPaper(plain()))))


def test_limits_that_were_not_read_are_marked():
    paper = InspectionPaper(plain())
    assert all(row[4].endswith("*") for row in table_of(checks(paper), "Every check"))
    assert {row[3] for row in table_of(limits(paper), "The source")} == {"NO"}
    assert any("NOT read" in text for text in texts_of(result(paper)))
    read = InspectionPaper(few())
    assert not any("*" in text for text in texts_of(checks(read)))
    assert {row[3] for row in table_of(limits(read), "The source")} == {"yes"}


@pytest.mark.parametrize("language", LANGUAGES)
def test_it_is_no_part_of_the_capacity_certificate(language):
    paper = InspectionPaper(unjudged(), language)
    assert result(paper)[1].data["text"] == paper.words["texts"]["not_of_certificate"]


@pytest.mark.parametrize("language", LANGUAGES)
def test_every_code_has_words(language):
    words = InspectionPaper(plain(), language).words
    assert set(CHECKS) <= set(words["checks"])
    assert set(VERDICTS) <= set(words["verdicts"])
    assert {f"{v}_{n}" for v in VERDICTS for n in ("one", "many")} <= set(words["counted"])
    assert set(words["methods"]) == {"points", "straps", "lines", "hits", "tangents", "scan"}
    assert set(words["nominal_sources"]) == {"drawing", "mean", "none"}
    assert {"as_found", "unloaded"} <= set(words["states"])
    assert "" not in {text for group in ("checks", "verdicts", "remarks") for text in
                      words[group].values()}  # fmt: skip


@pytest.mark.parametrize("language", [one for one in LANGUAGES if one != DEFAULT])
def test_languages_have_the_same_words(language):
    def keys(words):
        return {k: keys(v) if isinstance(v, dict) else None for k, v in words.items()}

    assert keys(load_words(language)["inspection"]) == keys(load_words(DEFAULT)["inspection"])


def test_every_remark_of_an_inspection_has_words():
    """Codes as the modules that compute give them; one without words comes with its values."""
    told = re.compile(r"remark|undetermined\(|_no_figure\(")
    lines = [
        re.sub(r'unit="\w*"', "", line)
        for path in RULES.parent.glob("*.py")
        for line in path.read_text(encoding="utf-8").splitlines()
        if told.search(line) and "Field(" not in line
    ]
    named = {code for line in lines for code in re.findall(r'"([a-z_]+)"(?!:|\])', line)}
    named -= {"remark", "remark_values", *CHECKS}
    assert named <= set(load_words(DEFAULT)["inspection"]["remarks"])


@pytest.mark.parametrize("language", LANGUAGES)
def test_every_remark_takes_any_values(language):
    """A place without a value is a dash, a code without words comes with its values."""
    paper, one = InspectionPaper(plain(), language), plain()["checks"][0]
    for code in paper.words["remarks"]:
        said = paper.remark(one | {"remark": code, "remark_values": {}})
        assert said
        assert "{" not in said
    unheard = one | {"remark": "unheard", "remark_values": {"x": 2.0, "y": None, "z": ["a", True]}}
    assert paper.remark(unheard).startswith("unheard: x 2, y –, z a, ")


def test_a_remark_says_its_values_in_their_units():
    paper, one = InspectionPaper(plain(), "es"), plain()["checks"][0]
    values = {"low_m": 0.3, "high_m": 11.6171, "mm_per_m": 2.4698, "one_in": 404.9, "over_m": 11.9}
    said = paper.remark(one | {"remark": "plumb_between", "remark_values": values})
    assert said.replace(SPACE, " ") == (
        "Medido entre 0,30 m y 11,62 m: 2,47 mm/m, pendiente de 1:405; el valor es el "
        "de esta pendiente en 11,90 m."
    )
    said = paper.remark(one | {"remark": "gap_partly_seen", "remark_values": {"seen": 0.734}})
    assert "en 73 % de la longitud" in said.replace(SPACE, " ")


@pytest.mark.parametrize("path", sorted(RULES.glob("*.toml")), ids=lambda path: path.stem)
def test_texts_of_shipped_rules_are_known_in_every_language(path):
    """English words are those of the file, so that other languages have them in their place."""
    rule = tomllib.loads(path.read_text(encoding="utf-8"))["rule"]
    known = load_words(DEFAULT)["inspection"]["rule_texts"][path.stem]
    assert known == {key: rule[key] for key in ("source", "remark")}
    found = plain()
    found["rule"] |= {key: rule[key] for key in ("name", "source", "remark")} | {"file": path.name}
    said = InspectionPaper(found, "pt-BR").record["rule"]
    assert said["remark"] != rule["remark"]
    found["rule"] |= {"remark": "Ours"}
    assert InspectionPaper(found, "pt-BR").record["rule"]["remark"] == "Ours"


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
def test_every_text_is_of_the_words(kind, monkeypatch):
    """An invented language: what stands outside its brackets is the user's, or a number."""
    english, found = load_words("en"), KINDS[kind]()
    words = bracketed(english) | {"language": english["language"]}
    monkeypatch.setattr(papers, "load_words", lambda _: words)
    own = texts_in(found) | texts_in(english["language"]["dates"])
    parts = {part for one in own for part in re.split(r"…|(?<=\w{3})(?=\w)", one)}
    for text in texts_of(pages(InspectionPaper(found))):
        rest = without_brackets(text)
        for word in re.findall(r"[^\W\d_]{4,}", rest):
            known = word.lower() in PROGRAM or any(word in one for one in own | parts)
            assert known, text


# ---- files


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    """Folder of the papers of each kind, each in another language."""
    folder = tmp_path_factory.mktemp("inspected")
    for kind, language in LANGUAGE_OF.items():
        write_inspection(KINDS[kind](), folder / kind, language)
    return folder


def text_of_pdf(path):
    if not shutil.which("pdftotext"):
        pytest.skip("pdftotext (poppler) is not on this machine")
    command = ["pdftotext", "-layout", str(path), "-"]
    said = subprocess.run(command, capture_output=True, check=True, encoding="utf-8").stdout
    return " ".join(said.replace(SPACE, " ").split())


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
def test_pages_are_filled(written, kind):
    shown = pages_of(written / kind / "inspection.pdf")
    headings = set(load_words(LANGUAGE_OF[kind])["inspection"]["headings"].values())
    assert 2 <= len(shown) <= 10
    assert sparse_pages(shown) == []
    assert filled(shown[-1]) >= LEAST_FILLED
    assert lone_headings(shown, headings) == []


ENDINGS = {"courses": (departures, levels, courses), "edges": (edges,), "points": (points,)}


@pytest.mark.slow
@pytest.mark.parametrize("ending", ENDINGS)
def test_no_page_is_nearly_empty_whatever_comes_before(tmp_path, ending):
    """Each document of one PDF has two lines more above than the one before."""
    paper, made = InspectionPaper(plain()), []
    end = [block for part in ENDINGS[ending] for block in part(paper)]
    for above in range(10, 50, 2):
        lines = [blocks.paragraph(f"line {n}") for n in range(above)]
        made += [blocks.document(title="T", footer=""), *keep_end_together([*lines, *end])]
    path = tmp_path / "made.pdf"
    path.write_bytes(pdf([block.data for block in made]))
    shown = pages_of(path)
    headings = set(load_words("en")["inspection"]["headings"].values())
    assert lone_headings(shown, headings) == []
    after = [page for page in shown if not any(line.text.startswith("line ") for line in page)]
    assert min(map(filled, after)) >= LEAST_FILLED


@pytest.mark.slow
def test_a_pdf_says_what_was_found(written):
    said = text_of_pdf(written / "plain" / "inspection.pdf")
    for text in (
        *("Inspection of shell and bottom", "Tank T-12", "1 check beyond its limit"),
        *("EXAMPLE", "CONDITIONAL PASS", "FAILED", "not part of the capacity certificate"),
        *("2026 - 2019", "Change from 2019 to 2026", "88.5 %", "not read in the text"),
        *("121.8°", "+26.9 mm", "≤ 119 mm *"),
    ):
        assert text in said
    portuguese = text_of_pdf(written / "few" / "inspection.pdf")
    assert "Inspeção de costado e fundo" in portuguese
    assert "0,718 mm/m²" in portuguese


@pytest.mark.slow
def test_texts_of_users_are_never_set(written):
    """Markup of a typesetter, a spreadsheet or a browser comes out letter by letter."""
    said = text_of_pdf(written / "hostile" / "inspection.pdf")
    assert TYPESET in said
    assert "=1+1 $x$ 2019" in said
    assert "@SUM(A1)" in said
    assert "<script>alert(1)</script>" in said


@pytest.mark.slow
def test_a_pdf_is_archival_and_holds_what_it_was_made_from(written):
    pypdf = pytest.importorskip("pypdf")
    folder = written / "plain"
    pdf = pypdf.PdfReader(folder / "inspection.pdf")
    metadata = pdf.trailer["/Root"]["/Metadata"].get_object().get_data().decode("utf-8")
    assert re.search(r"pdfaid:part(>|=\")3", metadata)
    assert re.search(r"pdfuaid:part(>|=\")1", metadata)
    held = {name: content[0] for name, content in pdf.attachments.items()}
    names = ("inspection.json", "inspection.xlsx")
    assert held == {name: (folder / name).read_bytes() for name in names}
    assert json.loads(held["inspection.json"]) == plain()


def test_a_workbook_has_numbers_as_numbers(tmp_path):
    found = plain()
    report_pages.write_sheets(InspectionPaper(found, "pt-BR"), tmp_path / "i.xlsx")
    book = openpyxl.load_workbook(tmp_path / "i.xlsx")
    assert book.sheetnames == ["Verificações", "Verticalidade", "Circularidade", "Soldas",
                               "Recalque", "Borda"]  # fmt: skip
    rows = list(book["Verificações"].iter_rows(values_only=True))
    place = next(n for n, row in enumerate(rows) if row[0] == "Verificação")
    heads, figures_ = rows[place], rows[place + 1 : place + 1 + len(found["checks"])]
    for key, heading in (("value", "Valor"), ("U", "U"), ("k", "k"), ("probability", "P, %")):
        column = heads.index(heading)
        shown = [np.nan if row[column] in (None, "–") else row[column] for row in figures_]
        saved = [np.nan if one[key] is None else one[key] for one in found["checks"]]
        np.testing.assert_allclose(shown, saved, rtol=1e-12)
    assert {row[heads.index("Lido no texto")] for row in figures_} == {"NÃO"}
    gaps = list(book["Soldas"].iter_rows(min_row=5, values_only=True))
    assert [row[4] for row in gaps] == pytest.approx([o["gap_mm"] for o in found["gaps"]])


def test_a_workbook_says_the_warnings_and_prints_headings_again(tmp_path):
    """What is not judged stands beside the verdicts; long tables have headings on every page."""
    found = plain()
    found["warnings"] = [{"file": "job", "row": None, "column": None, "code": "levels_odd",
                          "text": "a warning of its own", "values": {}}]  # fmt: skip
    flat = found["gaps"][0] | {"kind": "banding", "gap_mm": None, "U_mm": None, "azimuth_deg": 0.0}
    found["gaps"] = [*found["gaps"], flat]
    paper = InspectionPaper(found)
    report_pages.write_sheets(paper, tmp_path / "i.xlsx")
    book = openpyxl.load_workbook(tmp_path / "i.xlsx")
    checks_ = [row[0] for row in book["Checks"].iter_rows(values_only=True)]
    assert paper.warning(found["warnings"][0]) in checks_
    for sheet in book:
        row = int(sheet.print_title_rows.split(":")[0].strip("$"))
        head = max(t.ref for t in sheet.tables.values()) if len(sheet.tables) == 1 else None
        assert any(t.ref.startswith(f"A{row}:") for t in sheet.tables.values())
        assert head is None or head.startswith(f"A{row}:")
    (*_, last) = book["Welds"].iter_rows(values_only=True)
    assert last[3] in (None, "–")


def test_no_text_of_a_user_is_a_formula(tmp_path):
    report_pages.write_sheets(InspectionPaper(hostile()), tmp_path / "i.xlsx")
    cells = [c for s in openpyxl.load_workbook(tmp_path / "i.xlsx") for row in s for c in row]
    assert [cell.value for cell in cells if cell.data_type == "f"] == []
    assert any(str(cell.value).startswith("=1+1 $x$") for cell in cells)
    assert any("=HYPERLINK" in str(cell.value) for cell in cells)


def test_a_workbook_of_little_has_no_empty_sheets(tmp_path):
    report_pages.write_sheets(InspectionPaper(unjudged()), tmp_path / "i.xlsx")
    assert openpyxl.load_workbook(tmp_path / "i.xlsx").sheetnames == ["Checks", "Settlement"]


@pytest.mark.slow
def test_the_dataclass_and_its_plain_data_give_the_same_bytes(written, tmp_path):
    write_inspection(inspection(), tmp_path / "i", LANGUAGE_OF["plain"])
    for name in DOCUMENT.files:
        assert (tmp_path / "i" / name).read_bytes() == (written / "plain" / name).read_bytes()


@pytest.mark.slow
def test_papers_are_made_again_from_the_file_alone(written, tmp_path, capsys):
    """The same bytes in the same language; another language by --language."""
    folder = tmp_path / "i"
    shutil.copytree(written / "few", folder)
    before = {path.name: path.read_bytes() for path in folder.iterdir()}
    assert main(["report", str(folder), "--language", LANGUAGE_OF["few"], "--quiet"]) == 0
    assert {path.name: path.read_bytes() for path in folder.iterdir()} == before
    assert main(["report", str(folder / "inspection.json"), "--language", "es", "--quiet"]) == 0
    assert "Inspección de envolvente" in text_of_pdf(folder / "inspection.pdf")
    assert (folder / "inspection.json").read_bytes() == before["inspection.json"]


def test_a_folder_of_others_stays(tmp_path):
    (tmp_path / "mine.txt").write_text("mine", encoding="utf-8")
    with pytest.raises(InputError, match="mine"):
        write_inspection(plain(), tmp_path)
    assert [path.name for path in tmp_path.iterdir()] == ["mine.txt"]


def test_a_failure_leaves_earlier_results(tmp_path, monkeypatch):
    """All or nothing: the workbook is written last of all but the PDF, and fails."""
    (tmp_path / "i").mkdir()
    (tmp_path / "i" / "inspection.json").write_text("earlier", encoding="utf-8")

    def fails(paper, path):
        raise OSError("no room")

    monkeypatch.setattr(report_pages, "write_sheets", fails)
    with pytest.raises(OSError, match="no room"):
        write_inspection(plain(), tmp_path / "i")
    assert [path.name for path in tmp_path.iterdir()] == ["i"]
    assert [path.name for path in (tmp_path / "i").iterdir()] == ["inspection.json"]
    assert (tmp_path / "i" / "inspection.json").read_text(encoding="utf-8") == "earlier"


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("{", "cannot be read"),
        ("[]", "format"),
        ('{"format": "tankcal-record/1"}', "format"),
        ('{"format": "tankcal-inspection/1"}', "not what a file of that version holds"),
        ('{"format": "tankcal-inspection/2"}', "without"),
    ],
)
def test_what_is_no_inspection_is_refused(tmp_path, text, said):
    path = tmp_path / "inspection.json"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(InputError, match=said):
        rebuild(path, tmp_path / "out")
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("change", ["levels", "tank"])
def test_a_damaged_inspection_is_told_in_one_line(tmp_path, change):
    found = few()
    if change == "levels":
        found["levels"][0]["U_mm"] = [1.0]
    else:
        found["generatrices"]["departure_mm"] = [[1.0]]
    path = tmp_path / "inspection.json"
    path.write_text(json.dumps(found), encoding="utf-8")
    with pytest.raises(InputError, match="lacks the content") as told:
        rebuild(path, tmp_path / "out")
    assert len(told.value.problems) == 1
    assert [one.name for one in tmp_path.iterdir()] == ["inspection.json"]
