"""The version of tankcal, found when it is asked for: importing tankcal asks nothing.

A wheel and a source archive carry it in the file VERSION, which is written when they are built. A
checkout asks git, an archive of a commit (`git archive`) its `.git_archival.txt`. On a tag `v0.2.0`
it is 0.2.0. Anything else is a development version, which names its commit: 0.2.1.dev12+g1a2b3c4d,
twelve commits after that tag; `.dirty` follows where files differ from the commit. Without a tag
the number is that of the release that CHANGELOG.md is about. The build reads it here, too.
"""

import os
import re
import subprocess
import sys
from functools import cache
from pathlib import Path

_PACKAGE = Path(__file__).resolve().parent
_ROOT = _PACKAGE.parent
_DESCRIBED = re.compile(
    r"(?:v(?P<tag>\d+(?:\.\d+)*(?:(?:a|b|rc)\d+)?)(?:-(?P<count>\d+)-g)?)?"
    r"(?P<commit>[0-9a-f]{7,40})?(?P<dirty>-dirty)?"
)
_HEADING = re.compile(r"^## (\d+(?:\.\d+)*)", re.MULTILINE)
_GIT_S = 30  # longer than any answer of git takes


@cache
def find_version():
    """The version of this tankcal, as packages write it (PEP 440).

    Returns
    -------
    str
        "0.2.0" of a release; of anything else one such as "0.2.1.dev12+g1a2b3c4d"; the number ends
        in "+unknown" where nothing says which commit this is.

    Examples
    --------
    >>> import tankcal
    >>> find_version() == tankcal.__version__
    True
    """
    if (_ROOT / ".git").exists() and (_ROOT / "pyproject.toml").exists():
        return _version_of_checkout(_ROOT)
    if (_PACKAGE / "VERSION").exists():
        return (_PACKAGE / "VERSION").read_text(encoding="utf-8").strip()
    return _version_of_archive(_ROOT)


def version_of(described, *, count=0, coming="0"):
    """The version of a commit that git describes.

    Parameters
    ----------
    described : str
        As `git describe --tags --always --dirty` prints it; "" where nothing is known.
    count : int
        Commits up to this one, where no tag is among them.
    coming : str
        The release that is prepared, where there is no tag.

    Returns
    -------
    str

    Examples
    --------
    >>> version_of("v0.2.0"), version_of("v0.2.0-12-g1a2b3c4d-dirty")
    ('0.2.0', '0.2.1.dev12+g1a2b3c4d.dirty')
    >>> version_of("1a2b3c4d", count=957, coming="0.1.0"), version_of("v0.3.0rc1-2-g1a2b3c4d")
    ('0.1.0.dev957+g1a2b3c4d', '0.3.0rc2.dev2+g1a2b3c4d')
    """
    found = _DESCRIBED.fullmatch(described.strip())
    if found is None or not (found["tag"] or found["commit"]):
        return f"{coming}.dev0+unknown"
    tag, dirty = found["tag"], ".dirty" if found["dirty"] else ""
    if tag and not dirty and int(found["count"] or 0) == 0:
        return tag
    if tag:
        coming, count = _next_after(tag), int(found["count"] or 0)
    local = f"g{found['commit']}" if found["commit"] else "unknown"
    return f"{coming}.dev{count}+{local}{dirty}"


def _next_after(tag):
    """The number after a release: its last part is one more."""
    head, last = re.fullmatch(r"(.*?)(\d+)", tag).groups()
    return f"{head}{int(last) + 1}"


def _version_of_checkout(root):
    described = _ask_git(
        root, "describe", "--tags", "--long", "--always", "--dirty", "--abbrev=8", "--match=v[0-9]*"
    )
    count = 0
    if described and not described.startswith("v"):
        count = int(_ask_git(root, "rev-list", "--count", "HEAD") or 0)
    return version_of(described, count=count, coming=_coming_release(root))


def _version_of_archive(root):
    """Of a tree without git: what `git archive` left in it, if it was made so."""
    try:
        told = (root / ".git_archival.txt").read_text(encoding="utf-8")
    except OSError:
        told = ""
    keys = dict(line.split(": ", 1) for line in told.splitlines() if ": " in line)
    named = [keys.get("describe", ""), keys.get("commit", "")[:8]]
    described = next((one for one in named if one and "$" not in one), "")
    return version_of(described, coming=_coming_release(root))


def _coming_release(root):
    """The release that the changelog begins with."""
    try:
        found = _HEADING.search((root / "CHANGELOG.md").read_text(encoding="utf-8"))
    except OSError:
        found = None
    return found[1] if found else "0"


def _ask_git(root, *words):
    """What git says of the repository at `root`, and of no other one; "" where it cannot."""
    other = ("GIT_DIR", "GIT_WORK_TREE", "GIT_INDEX_FILE")  # of a hook that runs us
    environment = {name: value for name, value in os.environ.items() if name not in other}
    ours = ("-c", f"safe.directory={root}")  # a container often has another owner
    ours_alone = {"GIT_OPTIONAL_LOCKS": "0", "GIT_CEILING_DIRECTORIES": str(root.parent)}
    try:
        done = subprocess.run(
            ["git", *ours, "-C", str(root), *words],
            env=environment | ours_alone,
            stdin=subprocess.DEVNULL,
            capture_output=True,
            timeout=_GIT_S,
            check=True,
        )
    except (OSError, subprocess.SubprocessError):
        return ""
    return done.stdout.decode("utf-8", errors="replace").strip()


def install_command(extra):
    """Command that installs the libraries of an extra beside this tankcal.

    It names the libraries, which the package index holds, and not tankcal, which it does not: so
    the command works in a clone, from a wheel and in a container.

    Parameters
    ----------
    extra : str
        Such as "app", of pyproject.toml.

    Returns
    -------
    str
        For the shell of any system.
    """
    from importlib.metadata import PackageNotFoundError, requires

    mark = re.compile(rf"""extra\s*==\s*['"]{extra}['"]""")
    try:
        needed = [one.partition(";")[0].strip() for one in requires("tankcal") if mark.search(one)]
    except PackageNotFoundError:  # run from its sources, which no pip has installed
        needed = [f"{_ROOT}[{extra}]"]
    names = " ".join(f'"{one}"' for one in needed)
    return f"{sys.executable} -m pip install {names}"
