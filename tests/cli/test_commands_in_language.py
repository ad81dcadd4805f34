"""Commands without a job speak the language that is asked for: plans and findings of lint."""

import ast
import re
from pathlib import Path

import pytest
from conftest import EXAMPLE
from exported_records import lying, record_with, rows

import tankcal
from tankcal.cli import main
from tankcal.record import save

OTHERS = ("pt-BR", "es")
ENGLISH = re.compile(
    r"\b(the|expected|found|missing|blank|row|sheet|with|is|of|are|stands|rows|and|or|points"
    r"|targets|observations|change|drop|add)\b"
)
# names of the files that are read, and what stands in them
OF_FILES = r"'[^']*'|tankcal|sensor width|#Focal Length mm assuming a sensor width of"


def told(capsys):
    found = capsys.readouterr()
    return [*found.err.splitlines(), *found.out.splitlines()]


def english(lines):
    return [line for line in lines if ENGLISH.search(re.sub(OF_FILES, "", line))]


TABLE = """height_m,volume_m3
0.00,0.00
0.01,1.00
0.02,2.00
0.03,3.00
0.04,9.00
0.05,5.00
0.06,6.00
0.06,6.00
0.07,7,000
0.08,8.0
0.09,9.00
0.10,x1
0.13,13.00
0.12,12.00
0.14,14.00
0.15,15.00
0.19,19.00
0.20,20.00
0.21,-21.00
"""


@pytest.mark.slow(after=1)
@pytest.mark.parametrize("language", OTHERS)
def test_findings_are_reported_in_the_language(tmp_path, capsys, monkeypatch, language):
    path = tmp_path / "t.csv"
    path.write_text(TABLE)
    assert main(["lint", str(path), "--language", language, "--nominal-volume", "200"]) == 2
    lines = told(capsys)
    assert len(lines) > 6
    assert english(lines) == []
    monkeypatch.setenv("LANG", f"{language[:2]}.UTF-8")
    main(["lint", str(path), "--nominal-volume", "200"])
    assert told(capsys) == lines


@pytest.mark.slow(after=1)
@pytest.mark.parametrize("language", OTHERS)
@pytest.mark.parametrize("text", ["", "a\n", "height_m,volume_m3\n0,0\n1,1\n", "1;2\n3;4\n"])
def test_missing_table_is_reported_in_the_language(tmp_path, capsys, language, text):
    path = tmp_path / "t.csv"
    path.write_text(text)
    assert main(["lint", str(path), "--language", language]) == 2
    assert english(told(capsys)) == []


@pytest.mark.parametrize("language", OTHERS)
def test_a_plan_is_reported_in_its_language(tmp_path, capsys, language):
    for path in (EXAMPLE.parent / "plan-silva").iterdir():
        text = path.read_text(encoding="utf-8")
        if path.name == "plan.toml":
            text = text.replace("distance_m = 10.0", "distance_m = 0.01")
            text = text.replace("generatrices = 24", "generatrices = 2.5\nlevel = 2")
            text += f'\n[table]\nlanguage = "{language}"\n' if "[table]" not in text else ""
            text = text.replace("[table]", f'[table]\nlanguage = "{language}"', 1)
        (tmp_path / path.name).write_text(text, encoding="utf-8")
    assert main(["plan", str(tmp_path), "--quiet"]) == 2
    lines = told(capsys)
    assert lines
    assert english(lines) == []


@pytest.mark.slow(after=1)
@pytest.mark.parametrize("language", OTHERS)
@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("a.txt", "nothing\n"),
        ("cameras.txt", "1 OPENCV 4000 3000 1 2\n1 THING 10 10 3\n"),
        ("a.xml", "<calibration><projection>fisheye</projection></calibration>"),
        ("a.yml", "%YAML:1.0\ncamera_matrix: 3\n"),
        ("a.ior", "Ck 100\nXh x\nXh 1\nZZ 3\n"),
        ("a.cam", "Pix4D camera calibration file 0\nF 5\nF 5\nQ 1\n"),
    ],
)
def test_a_camera_that_cannot_be_read_is_told_in_the_language(
    tmp_path, capsys, language, name, text
):
    path = tmp_path / name
    path.write_text(text)
    asked = ["camera", "convert", str(path), "--to", "opencv", "--language", language]
    assert main(asked) == 2
    lines = told(capsys)
    assert lines
    assert english(lines) == []


ROOMS = ("planning", "products/linter", "camera/formats", "calibration", "report/planning",
         "report/camera", "cli")  # fmt: skip
TOLD_BY = {"Problem", "InputError", "SolutionError", "problem", "warning", "warn", "print", "say",
           "complain", "step", "part", "tell", "progress"}  # fmt: skip


@pytest.mark.slow
def test_rooms_report_only_messages():
    """A text of several words that is handed to a teller of the user's is a `message`."""
    plain = []
    for room in ROOMS:
        for path in (Path(tankcal.__file__).parent / room).rglob("*.py"):
            for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
                if not isinstance(node, ast.Call):
                    continue
                name = getattr(node.func, "id", getattr(node.func, "attr", ""))
                if name in TOLD_BY:
                    plain += [
                        f"{path.name}:{one.lineno}: {text_of(one)}"
                        for one in node.args
                        if WORDS.search(re.sub(NO_SENTENCES, "", text_of(one)))
                    ]
    assert plain == []


NO_SENTENCES = r"sensor width|tankcal run|^ *tankcal .*"  # a key of a file, commands
WORDS = re.compile(r"[a-z]{2,}[ ;,:]+[a-z]{2,}")


def text_of(node):
    """The words of a text that stands in the source as it is; "" for anything else."""
    if isinstance(node, ast.Constant) and isinstance(node.value, str):
        return node.value
    if isinstance(node, ast.JoinedStr):
        return "".join(
            text_of(one) if isinstance(one, ast.Constant) else "{}" for one in node.values
        )
    return ""


@pytest.mark.slow
@pytest.mark.parametrize(
    "command", [["compare", "RECORD", "RECORD", "--quiet"], ["verify", "FOLDER"], ["read-table",
     "RECORD"], ["export", "FOLDER", "--profile", "nobody"]]
)  # fmt: skip
def test_the_language_of_a_record_is_spoken(tmp_path, capsys, command):
    """That of its job, where none is asked for; in English where --language says so."""
    record = record_with(*rows(lying, 2.4, 0.05))
    record["job"]["table"]["language"] = "pt-BR"
    save(record, tmp_path / "record.json")
    places = {"RECORD": str(tmp_path / "record.json"), "FOLDER": str(tmp_path)}
    given = [places.get(one, one) for one in command]
    main(given)
    theirs = told(capsys)
    main([*given, "--language", "en"])
    ours = told(capsys)
    assert english(ours)
    assert len(theirs) == len(ours)
    assert theirs != ours
