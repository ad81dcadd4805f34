"""What is handed out: workflows, changes of a release, citation, page of the package, container."""

import re
import shlex
import shutil
import subprocess
import tomllib
from pathlib import Path

import pytest

from tankcal.cli import _options, _parser_in_english

ROOT = Path(__file__).parents[2]
WORKFLOWS = sorted((ROOT / ".github/workflows").glob("*.yml"))
FORMS = sorted((ROOT / ".github/ISSUE_TEMPLATE").glob("[0-9]*.yml"))
SHOWN = ("README.md", "PACKAGE.md", "docs/comece-aqui.md", "docs/start.md", "docs/how-to.md",
         "docs/coming-from.md")  # fmt: skip
MARKS = {"...", "JOBS...", "NAME"}


def loaded(path):
    yaml = pytest.importorskip("yaml")
    return yaml.safe_load(path.read_text(encoding="utf-8"))


@pytest.mark.parametrize("path", WORKFLOWS, ids=lambda path: path.stem)
def test_workflows_use_actions_of_one_version_and_no_secret(path):
    text = path.read_text(encoding="utf-8")
    used = re.findall(r"uses: (\S+)", text)
    assert used
    assert [one for one in used if not re.search(r"@v\d+\.\d+\.\d+$", one)] == []
    assert "secrets." not in text
    assert loaded(path)["permissions"] == {"contents": "read"}
    for job in loaded(path)["jobs"].values():
        assert job["timeout-minutes"] <= 150


def test_only_the_publisher_may_ask_the_index_to_trust_it():
    jobs = loaded(ROOT / ".github/workflows/release.yml")["jobs"]
    trusted = {name for name, job in jobs.items() if "id-token" in job.get("permissions", {})}
    assert trusted == {"publish"}
    assert jobs["publish"]["environment"] == "pypi"
    assert jobs["publish"]["needs"] == "build"
    assert not any("run" in step and "pip" in step["run"] for step in jobs["publish"]["steps"])


def test_commands_of_the_workflows_are_there():
    text = "".join(path.read_text(encoding="utf-8") for path in WORKFLOWS)
    scripts = set(re.findall(r"\.ci/\w+", text))
    assert scripts == {".ci/run", ".ci/changes"}
    assert all((ROOT / one).stat().st_mode & 0o111 for one in (*scripts, ".ci/wheel"))
    targets = set(re.findall(r"\bmake (\w+)", text))
    makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
    assert targets == {"wheel"}
    assert re.search(r"^wheel:.*\n\t\.ci/wheel \$\(TAG\)$", makefile, re.MULTILINE)


@pytest.mark.skipif(shutil.which("bash") is None, reason="bash is not installed")
def test_changes_of_a_release(tmp_path):
    (tmp_path / ".ci").mkdir()
    shutil.copy(ROOT / ".ci/changes", tmp_path / ".ci/changes")
    (tmp_path / "CHANGELOG.md").write_text(
        "# Changelog\n\n## 0.10.0 (unreleased)\n\nnew\n\n## 0.1.0 2027-01-01\n\n- old\n\n- more\n"
    )

    def changes(version):
        return subprocess.run(
            ["bash", ".ci/changes", version], cwd=tmp_path, capture_output=True, text=True
        )

    assert changes("0.10.0").stdout == "new\n"
    assert changes("0.1.0").stdout == "- old\n\n- more\n"
    missing = changes("0.1")
    assert (missing.returncode, missing.stdout) == (2, "")
    assert "0.1" in missing.stderr


def test_changelog_begins_with_a_release():
    text = (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
    assert re.match(r"# Changelog\n\n## \d+\.\d+\.\d+( \(unreleased\)| \d{4}-\d\d-\d\d)?\n", text)


def test_citation_is_that_of_the_package():
    cited = loaded(ROOT / "CITATION.cff")
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    assert cited["cff-version"] == "1.2.0"
    assert cited["license"] == project["license"]
    assert cited["authors"] == [{"name": project["authors"][0]["name"]}]
    assert not {"doi", "identifiers", "url", "repository-code"} & cited.keys()  # none is known


def test_page_of_the_package_stands_alone():
    text = (ROOT / "PACKAGE.md").read_text(encoding="utf-8")
    assert "](" not in text  # the index knows no file beside it
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    named = set(re.findall(r"`tankcal\[(\w+)\]`", text))
    assert named <= project["optional-dependencies"].keys()
    assert len(named) >= 3


@pytest.mark.parametrize("path", FORMS, ids=lambda path: path.stem)
def test_issue_forms_are_forms(path):
    form = loaded(path)
    assert {"name", "description", "body"} <= form.keys()
    fields = [one for one in form["body"] if one["type"] != "markdown"]
    assert len({one["id"] for one in fields}) == len(fields)
    for one in fields:
        assert one["type"] in ("textarea", "input")
        assert one["attributes"]["label"]


def test_stages_of_the_container_are_those_it_names():
    text = (ROOT / "Containerfile").read_text(encoding="utf-8")
    stages = re.findall(r"^FROM (\S+) AS (\S+)$", text, re.MULTILINE)
    names = [name for _, name in stages]
    assert len(names) == len(re.findall("^FROM ", text, re.MULTILINE))
    assert names[-1] == "runtime"  # what is built when no target is named
    for index, (base, _) in enumerate(stages):
        assert base == "${BASE}" or base in names[:index]
    assert set(re.findall(r"--from=(\S+)", text)) <= set(names)
    assert re.findall(r"^USER (.*)$", text, re.MULTILINE)[-1] != "root"


def commands_in(page):
    """Command lines of tankcal in the indented blocks of a page, without what is said of them."""
    for line in (ROOT / page).read_text(encoding="utf-8").splitlines():
        found = re.match(r" {4}(?:\S+[/\\])?tankcal (.*)", line)
        if found and not re.search(r"[*$>]", line):
            yield re.split(r" {3,}|  +#", found[1])[0]


@pytest.mark.parametrize("page", SHOWN)
def test_commands_that_pages_show_are_understood(page, capsys):
    lines = list(commands_in(page))
    assert lines
    for line in lines:
        try:
            options = _options(shlex.split(line))
        except SystemExit:
            pytest.fail(f"tankcal {line}: {capsys.readouterr().err}")
        assert options.command


def test_values_in_the_tables_of_the_first_pages_are_there():
    parser, _ = _parser_in_english()
    new = parser._subparsers._group_actions[0].choices["new"]
    choices = {one.option_strings[0]: one.choices for one in new._actions if one.choices}
    for page in ("docs/comece-aqui.md", "docs/start.md"):
        text = (ROOT / page).read_text(encoding="utf-8")
        found = re.findall(r"(--survey|--kind|--language) ([\w-]+)", text)
        assert len(found) > 5
        assert [pair for pair in found if pair[1] not in choices[pair[0]]] == []
