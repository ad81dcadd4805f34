"""The notebooks as their readers need them: short, with parameters, without private helpers."""

import ast
import json
import subprocess
import sys
from pathlib import Path

import pytest

FOLDER = Path(__file__).parents[2] / "notebooks"
TUTORIALS = sorted(FOLDER.glob("*.ipynb"))
ALL = [*TUTORIALS, *sorted((FOLDER / "studies").glob("*.ipynb"))]
MOST_LINES = 150
PUBLIC = (
    *("tankcal.report", "tankcal.report.planning", "tankcal.report.comparison"),
    *("tankcal.report.inspection", "tankcal.report.history", "tankcal.report.verification"),
)


def code_of(path):
    cells = json.loads(path.read_text(encoding="utf-8"))["cells"]
    return [cell for cell in cells if cell["cell_type"] == "code"]


def text_of(cell):
    return "".join(cell["source"])


@pytest.mark.parametrize("path", ALL, ids=lambda path: path.stem)
def test_parameters_cell_comes_first(path):
    """Where papermill writes its values below it: only names with plain values in it."""
    first, *others = code_of(path)
    assert "parameters" in first["metadata"].get("tags", [])
    assert not any("parameters" in cell["metadata"].get("tags", []) for cell in others)
    for statement in ast.parse(text_of(first)).body:
        assert isinstance(statement, ast.Assign)
        ast.literal_eval(statement.value)


@pytest.mark.parametrize("path", ALL, ids=lambda path: path.stem)
def test_every_parameter_is_used_and_set_once(path):
    first, *others = (ast.parse(text_of(cell).replace("\n!", "\n#")) for cell in code_of(path))
    names = {target.id for statement in first.body for target in statement.targets}
    later = [node for tree in others for node in ast.walk(tree) if isinstance(node, ast.Name)]
    assert names <= {node.id for node in later if isinstance(node.ctx, ast.Load)}
    assert not names & {node.id for node in later if isinstance(node.ctx, ast.Store)}


@pytest.mark.parametrize("path", TUTORIALS, ids=lambda path: path.stem)
def test_a_tutorial_is_short(path):
    lines = [line for cell in code_of(path) for line in text_of(cell).splitlines()]
    assert len([line for line in lines if line.strip()]) <= MOST_LINES


@pytest.mark.parametrize("path", TUTORIALS, ids=lambda path: path.stem)
def test_a_tutorial_calls_public_names_only(path):
    """No underscore, and only the public modules of the packages that make reports."""
    for cell in code_of(path):
        for node in ast.walk(ast.parse(text_of(cell))):
            if isinstance(node, ast.ImportFrom) and node.module.startswith("tankcal"):
                written = node.module in PUBLIC
                assert written or not node.module.startswith(("tankcal.report", "tankcal.record"))
                assert not any(one.name.startswith("_") for one in node.names)
            if isinstance(node, ast.Attribute):
                assert not node.attr.startswith("_"), node.attr


@pytest.mark.slow
def test_the_notebook_of_upkeep_is_executed(tmp_path):
    """By nbconvert, with its figures; all others are executed by `make notebooks`."""
    done = subprocess.run(
        [sys.executable, "-m", "nbconvert", "--to", "notebook", "--execute", "--output-dir",
         str(tmp_path), str(FOLDER / "22_upkeep.ipynb")],
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr[-2000:]
    cells = code_of(tmp_path / "22_upkeep.ipynb")
    outputs = [output for cell in cells for output in cell["outputs"]]
    assert sum("image/png" in output.get("data", {}) for output in outputs) == 2
    text = "".join("".join(output.get("text", "")) for output in outputs)
    assert "all agree" in text
    assert "leak or another loss by time" in text
