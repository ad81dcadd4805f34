"""The pages: links lead somewhere, code that they name is there, the README is short and true."""

import ast
import doctest
import re
import string
import tomllib
from importlib import import_module
from pathlib import Path

import pytest
from line_references import PAGE, definition_line, references
from page_sessions import FENCE

ROOT = Path(__file__).parents[2]
PAGES = sorted(
    [
        *ROOT.glob("*.md"),
        *ROOT.glob("docs/*.md"),
        *ROOT.glob("docs/studies/*.md"),
        *ROOT.glob("examples/*/*.md"),
    ]
)
LINK = re.compile(r"\]\(([^()\s]+)\)")
NAME = re.compile(r"`(tankcal(?:\.\w+)+)")
FILE = re.compile(r"`((?:tankcal|tests|report_templates|docs)/[\w./*-]*)`")
PAST = ("CHANGELOG.md",)  # names what was there then
FORMATS = (".toml", ".json", ".pdf", ".xlsx", ".ipynb")
WITH_EXAMPLES = sorted(
    ".".join(path.relative_to(ROOT).with_suffix("").parts).removesuffix(".__init__")
    for path in ROOT.glob("tankcal/**/*.py")
    if ">>> " in path.read_text(encoding="utf-8")
)


def test_modules_of_the_reference_are_there():
    """`docs/stage.py` names them; the site fails without one, and is made last of all."""
    named = re.search(
        r"^REFERENCE = .*?^}", (ROOT / "docs/stage.py").read_text(), re.M | re.S
    ).group()
    names = {}
    exec(named, names)
    assert [m for group in names["REFERENCE"].values() for m in group if not is_there(m)] == []


def anchors(page):
    """The anchors of a page's headings, as git hosts make them."""
    headings = re.findall(r"^#+ (.+)$", page.read_text(encoding="utf-8"), flags=re.M)
    kept = (re.sub(r"[^\w\s-]", "", heading.replace("`", "")) for heading in headings)
    return {re.sub(r"\s", "-", heading.strip().lower()) for heading in kept}


def is_there(name):
    """Whether a dotted name is a module, or an attribute of one."""
    parts = name.split(".")
    for length in range(len(parts), 0, -1):
        try:
            found = import_module(".".join(parts[:length]))
        except ImportError:
            continue
        for part in parts[length:]:
            if not hasattr(found, part):
                return False
            found = getattr(found, part)
        return True
    return False


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_links_lead_somewhere(page):
    lost = []
    for goal in LINK.findall(page.read_text(encoding="utf-8")):
        if re.match(r"[a-z]+:", goal):
            continue
        file, _, anchor = goal.partition("#")
        target = (page.parent / file).resolve() if file else page
        if not target.exists() or (anchor and anchor not in anchors(target)):
            lost.append(goal)
    assert lost == []


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_names_of_code_are_there(page):
    if page.name in PAST:
        pytest.skip("names what was there then")
    text = page.read_text(encoding="utf-8")
    assert [n for n in NAME.findall(text) if not n.endswith(FORMATS) and not is_there(n)] == []
    assert [path for path in FILE.findall(text) if not any(ROOT.glob(path.rstrip("/")))] == []


def test_limitations_are_short_and_linked():
    """At most 60 bullets of at most 25 words, each linked to its page, with a remedy after it."""
    text = (ROOT / "docs/limits.md").read_text(encoding="utf-8")
    bullets = re.findall(r"^- (.+)$", text, flags=re.M)
    assert 40 < len(bullets) <= 60
    for bullet in bullets:
        assert re.match(r"\[.+?\]\([^)]+\): .+\. .+\.$", bullet), bullet
        words = LINK.sub("", bullet).split()
        assert len(words) <= 25, bullet


def test_readme_is_short():
    assert len((ROOT / "README.md").read_text(encoding="utf-8").splitlines()) <= 90


@pytest.mark.parametrize("page", ["README.md"])
def test_examples_of_pages_print_as_shown(page, monkeypatch):
    monkeypatch.chdir(ROOT)
    found = doctest.testfile(str(ROOT / page), module_relative=False)
    assert found.attempted >= 3
    assert found.failed == 0


@pytest.mark.parametrize("module", WITH_EXAMPLES)
def test_examples_of_docstrings_print_as_shown(module, monkeypatch):
    monkeypatch.chdir(ROOT)
    found = doctest.testmod(import_module(module))
    assert found.attempted > 0
    assert found.failed == 0


def test_the_page_of_the_structure_lists_every_layer():
    """docs/house.md names each package of the contract, in its order."""
    settings = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    layers = settings["tool"]["importlinter"]["contracts"][0]["layers"]
    text = (ROOT / "docs/house.md").read_text(encoding="utf-8").split("## Layers")[1]
    rows = [line for line in text.splitlines() if line.startswith("| ") and "`" in line]
    listed = [set(re.findall(r"`(\w+)(?:/|\.py)", line.split("|")[2])) for line in rows]
    named = [set(re.findall(r"\w+", layer)) for layer in layers if layer != "__main__"]
    row_of = {package: row for row, packages in enumerate(listed) for package in packages}
    assert set().union(*named) <= row_of.keys()
    order = [max(row_of[package] for package in layer) for layer in named]
    assert order == sorted(order)


def test_first_page_lists_every_page():
    listed = set(LINK.findall((ROOT / "docs/index.md").read_text(encoding="utf-8")))
    assert {page.name for page in ROOT.glob("docs/*.md")} - {"index.md"} <= listed
    studies = set(LINK.findall((ROOT / "docs/studies/index.md").read_text(encoding="utf-8")))
    assert {page.name for page in ROOT.glob("docs/studies/*.md")} - {"index.md"} <= studies


def printed_patterns():
    """Patterns of the lines that tankcal prints: from messages that have words and values."""
    for path in ROOT.glob("tankcal/**/*.py"):
        text = path.read_text(encoding="utf-8")
        if "message(" not in text:
            continue
        for node in ast.walk(ast.parse(text)):
            is_message = isinstance(node, ast.Call) and getattr(node.func, "id", "") == "message"
            if not is_message or not isinstance(getattr(node.args[1], "value", None), str):
                continue
            parts = list(string.Formatter().parse(node.args[1].value))
            words = re.findall("[a-z]{2,}", "".join(literal for literal, *_ in parts))
            if len(words) > 1 and any(field is not None for _, field, *_ in parts):
                pattern = ".+?".join(re.escape(literal) for literal, *_ in parts)
                yield pattern + (".+" if parts[-1][1] is not None else "")


@pytest.mark.slow
def test_output_of_a_command_is_shown_by_a_session_alone():
    """Figures in a block without a session become wrong when a number of an example changes."""
    printed = [re.compile(one) for one in printed_patterns()]
    assert len(printed) > 1000
    stale = []
    for page in PAGES:
        text = FENCE.sub("", page.read_text(encoding="utf-8")) if page.name not in PAST else ""
        for line in re.findall(r"^    +(\S.*\d.*)$", text, flags=re.M):
            stale += [f"{page.name}: {line}" for one in printed if one.search(line)][:1]
    assert stale == []


def test_line_references_are_those_of_the_definitions():
    """`python tests/line_references.py` writes them anew."""
    found = references(PAGE.read_text(encoding="utf-8"))
    assert len(found) >= 12
    assert found == [(path, definition_line(path, name), name) for path, _, name in found]
