"""The version: of a tag, of commits after it, without tags or git, of an archive, of a build."""

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from packaging.version import Version

import tankcal
from tankcal.version import version_of

ROOT = Path(__file__).parents[2]
pytestmark = pytest.mark.skipif(shutil.which("git") is None, reason="needs git")


def git(folder, *words):
    ours = ("-c", "user.name=t", "-c", "user.email=t@example.org", "-c", "commit.gpgsign=false")
    environment = {k: v for k, v in os.environ.items() if not k.startswith("GIT_")}
    done = subprocess.run(
        ["git", *ours, *words], cwd=folder, env=environment, capture_output=True, check=True
    )
    return done.stdout.decode().strip()


def asked(folder, **environment):
    """The version that a tree of files says it is, in a process of its own."""
    code = "from tankcal.version import find_version; print(find_version())"
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=folder, capture_output=True, text=True, check=True,
        env={**os.environ, "PYTHONPATH": str(folder), **environment},
    )  # fmt: skip
    return done.stdout.strip()


@pytest.fixture
def checkout(tmp_path):
    """A repository of one commit, with what the version is taken from."""
    folder = tmp_path / "checkout"
    (folder / "tankcal").mkdir(parents=True)
    (folder / "tankcal/__init__.py").touch()
    for name in ("tankcal/version.py", ".git_archival.txt", ".gitattributes", "pyproject.toml"):
        shutil.copy(ROOT / name, folder / name)
    (folder / ".gitignore").write_text("__pycache__/\ntankcal/VERSION\n")
    (folder / "CHANGELOG.md").write_text("# Changelog\n\n## 0.4.0 (unreleased)\n\n## 0.3.0\n")
    git(folder, "init", "-q", "-b", "main")
    commit(folder)
    return folder


def commit(folder):
    git(folder, "add", "-A")
    git(folder, "commit", "-q", "--allow-empty", "-m", "work")
    return git(folder, "rev-parse", "--short=8", "HEAD")


def test_a_tag_is_the_version(checkout):
    git(checkout, "tag", "v0.4.0")
    assert asked(checkout) == "0.4.0"


def test_commits_after_a_tag_are_told(checkout):
    git(checkout, "tag", "-a", "-m", "x", "v0.4.0")
    commit(checkout)
    head = commit(checkout)
    assert asked(checkout) == f"0.4.1.dev2+g{head}"


def test_files_that_differ_are_told(checkout):
    git(checkout, "tag", "v0.4.0")
    head = git(checkout, "rev-parse", "--short=8", "HEAD")
    with (checkout / "CHANGELOG.md").open("a") as file:
        file.write("more\n")
    assert asked(checkout) == f"0.4.1.dev0+g{head}.dirty"


def test_other_tags_are_none(checkout):
    git(checkout, "tag", "nightly")
    git(checkout, "tag", "very-old")
    assert asked(checkout).startswith("0.4.0.dev1+g")


@pytest.mark.slow
def test_a_checkout_without_tags_names_its_commit(checkout, tmp_path):
    commit(checkout)
    head = commit(checkout)
    git(tmp_path, "clone", "-q", "--depth=1", checkout.as_uri(), "shallow")
    assert asked(checkout) == f"0.4.0.dev3+g{head}"
    assert asked(tmp_path / "shallow") == f"0.4.0.dev1+g{head}"


@pytest.mark.slow
def test_without_git_or_anything_nothing_is_claimed(checkout):
    assert asked(checkout, PATH="/nowhere") == "0.4.0.dev0+unknown"
    shutil.rmtree(checkout / ".git")
    assert asked(checkout) == "0.4.0.dev0+unknown"
    (checkout / "CHANGELOG.md").unlink()
    assert asked(checkout) == "0.dev0+unknown"


def test_a_broken_repository_is_no_error(checkout):
    (checkout / ".git/HEAD").write_text("nonsense")
    assert asked(checkout) == "0.4.0.dev0+unknown"


def test_the_repository_of_a_hook_is_not_asked(checkout, tmp_path):
    git(checkout, "tag", "v0.4.0")
    git(tmp_path, "init", "-q", "other")
    assert asked(checkout, GIT_DIR=str(tmp_path / "other/.git")) == "0.4.0"


def test_a_repository_around_an_unpacked_archive_is_not_asked(checkout, tmp_path):
    git(checkout, "tag", "v0.4.0")
    inside = checkout / "build/tree"
    shutil.copytree(checkout / "tankcal", inside / "tankcal")
    assert asked(inside) == "0.dev0+unknown"


@pytest.mark.parametrize("tag", ["v0.4.0", None])
def test_an_archive_of_a_commit_knows_it(checkout, tmp_path, tag):
    if tag:
        git(checkout, "tag", tag)
    head = git(checkout, "rev-parse", "HEAD")[:8]
    git(checkout, "archive", "-o", str(tmp_path / "it.tar"), "HEAD")
    shutil.unpack_archive(tmp_path / "it.tar", tmp_path / "unpacked")
    assert asked(tmp_path / "unpacked") == ("0.4.0" if tag else f"0.4.0.dev0+g{head}")


def test_what_a_build_wrote_counts_only_without_git(checkout):
    (checkout / "tankcal/VERSION").write_text("0.3.9\n")
    assert asked(checkout).startswith("0.4.0.dev1+g")
    shutil.rmtree(checkout / ".git")
    assert asked(checkout) == "0.3.9"


def test_versions_are_in_the_order_of_the_commits():
    told = ("v0.3.0", "v0.3.0-1-g1a2b3c4d", "v0.3.0-12-g1a2b3c4d", "v0.4.0rc1",
            "v0.4.0rc1-1-g1a2b3c4d", "v0.4.0", "v0.4.0-dirty")  # fmt: skip
    versions = [Version(version_of(one)) for one in told]
    assert versions == sorted(versions)
    assert [str(one) for one in versions] == [version_of(one) for one in told]


@pytest.mark.parametrize("said", ["", "fatal: no", "v", "v1.x", "v0.1.0-2", "\n"])
def test_nonsense_is_unknown(said):
    assert version_of(said, coming="0.1.0") == "0.1.0.dev0+unknown"


def test_importing_asks_nobody():
    code = (
        "import tankcal, sys; print('subprocess' in sys.modules, 'tankcal.version' in sys.modules)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.split() == ["False", "False"]


@pytest.mark.slow
def test_the_command_says_it():
    done = subprocess.run(
        [sys.executable, "-m", "tankcal", "--version"], capture_output=True, text=True, check=True
    )
    assert done.stdout == f"tankcal {tankcal.__version__}\n"
    assert re.fullmatch(r"\d+(\.\d+)*(\.dev\d+\+\w+(\.dirty)?)?", tankcal.__version__)
