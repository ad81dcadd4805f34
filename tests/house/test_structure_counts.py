"""The measures of the structure, on a package whose structure is written here."""

import pytest
from structure_counts import asks_for_method, list_cycles, main, measure, read_package

FILES = {
    "__init__.py": "",
    "adjust.py": '''
def solve(rows):
    """Solve.

    Parameters
    ----------
    rows : array
    """
    return _scale(rows)


def _scale(rows):
    return rows
''',
    "pipeline/__init__.py": "",
    "pipeline/wall.py": """
from typing import TYPE_CHECKING

from tankcal import adjust

if TYPE_CHECKING:
    from tankcal.pipeline.chain import run


def wall_of(job):
    if job.straps is not None and job.tank.kind != 'mesh':
        return _of_straps(job)
    return adjust.solve(job.points), _both(job), _both(job)


def _both(job):
    return job


def _of_straps(job):
    return job
""",
    "pipeline/chain.py": """
def run(job):
    from tankcal.pipeline.wall import wall_of

    return wall_of(job) if "liquid" in job.surveys else None
""",
    "survey/__init__.py": "from tankcal.survey.later import b\n",
    "survey/later.py": "# why\n\n\ndef b():\n    from tankcal import survey\n",
}


@pytest.fixture
def modules(tmp_path):
    for name, text in FILES.items():
        path = tmp_path / "tankcal" / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, encoding="utf-8")
    return read_package(tmp_path / "tankcal")


def test_imports_within_functions_count_and_those_for_types_do_not(modules):
    assert modules["tankcal.pipeline.wall"].imports == {"tankcal.adjust"}
    assert modules["tankcal.pipeline.chain"].imports == {"tankcal.pipeline.wall"}


def test_a_cycle_is_listed(modules):
    assert list_cycles(modules) == [["tankcal.survey.__init__", "tankcal.survey.later"]]


def test_each_measure(modules):
    limited, free = measure(modules)
    lines = sum(len(text.splitlines()) for text in FILES.values())
    assert limited == {
        "modules in import cycles": 2,
        "branches on a method or kind": 2,
        "modules in pipeline": 3,
        "lines in private functions called once, %": round(100 * 4 / lines, 1),
        "functions per 1000 lines": round(1000 * 7 / lines, 1),
    }
    assert free == {
        "modules": 7,
        "lines": lines,
        "modules with a single importer": 3,  # adjust, wall, later
        "comments per 1000 lines of geometry, survey, solver": round(1000 / 6),
        "public functions of the core with their parameters, %": 100,
    }


def test_a_measure_above_its_limit_fails(tmp_path, monkeypatch, capsys, modules):
    import structure_counts

    monkeypatch.setattr(structure_counts, "ROOT", tmp_path)
    monkeypatch.setattr(structure_counts, "LIMITS", tmp_path / "limits.toml")
    assert main(["--lower"]) == 0
    assert main([]) == 0
    path = tmp_path / "tankcal" / "adjust.py"
    path.write_text("import tankcal.tank\n" + path.read_text())
    (tmp_path / "tankcal" / "tank.py").write_text("import tankcal.adjust\n")
    assert main([]) == 1
    assert "modules in import cycles: 4, limit 2" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("test", "module", "class_name", "asks"),
    [
        ("job.straps is None", "tankcal.pipeline.wall", "", True),
        ("job.straps is None", "tankcal.methods.strapping.wall", "", False),
        ("job.lines is None", "tankcal.methods.strapping.wall", "", True),
        ("self.tangents is None", "tankcal.planning.model", "Design", True),
        ("self.points is None", "tankcal.geometry.sites", "Sites", False),
        ("job.points.unbound", "tankcal.pipeline.wall", "", False),
        ("not gathered.survey.points", "tankcal.survey.datum", "", False),
        ("kind != 'vertical' or form != 'liquid'", "tankcal.job.checks", "", False),
        ("kind in ('sphere', 'mesh')", "tankcal.job.checks", "", True),
        ("'radii' not in tables", "tankcal.job.checks", "", True),
    ],
)
def test_a_branch_asks_which_method_is_present(test, module, class_name, asks):
    assert asks_for_method(test, module, class_name) is asks
