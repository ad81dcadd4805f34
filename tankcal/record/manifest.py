"""SHA256SUMS: the hash of every file of a folder of results, as `sha256sum -c` reads them.

The first lines say what made the files: with the same programs and packages on the same kind of
machine the same record gives the same bytes.
"""

import hashlib
import platform
import re
from dataclasses import dataclass, field
from pathlib import Path

import tankcal
from tankcal.errors import InputError, Problem
from tankcal.messages import message

FILE = "SHA256SUMS"
FILLED_IN = "job"  # folder of an empty job in the folder of a plan: a crew fills it in
MOST_BYTES = 10_000_000
PACKAGES = (  # those whose version shows in the bytes of some paper
    *("numpy", "scipy", "matplotlib", "xlsxwriter", "mistune", "typst", "segno"),
    "pypdf",  # where there is a field to sign in
)
_MADE = "# made by "
_LANGUAGE = "# language asked for: "
_ROW = re.compile(r"([0-9a-f]{64}) [ *](.+)")


@dataclass(frozen=True)
class Manifest:
    """What a SHA256SUMS says.

    Attributes
    ----------
    digests : dict
        {path below the folder, with slashes: SHA-256 of that file}.
    made_by : str
        Program, packages and machine that made the files; "" where it does not say.
    language : str or None
        That the papers were asked in; None: that of the job, or nothing is said.
    sha256 : str
        Of the manifest itself.
    """

    digests: dict = field(default_factory=dict)
    made_by: str = ""
    language: str | None = None
    sha256: str = ""


def maker():
    """Program, packages and kind of machine that make files now, one line."""
    packages = [f"{name} {_version(name)}" for name in PACKAGES]
    of_python = f"python {platform.python_version()}"
    machine = f"{platform.system()} {platform.machine()}"
    return ", ".join([f"tankcal {tankcal.__version__}", of_python, *packages, machine])


def _version(name):
    from importlib import metadata  # takes as long to load as the rest of a command's help

    try:
        return metadata.version(name)
    except metadata.PackageNotFoundError:
        return "-"


def files_below(folder):
    """Sorted paths, below a folder and with slashes, of the files that a manifest lists.

    Neither itself, nor hidden files, nor the empty job of a plan, which is to be filled in. Links
    to folders are not followed.
    """
    folder, found, left = Path(folder), [], [Path(folder)]
    while left:
        for path in left.pop().iterdir():
            if path.name.startswith("."):
                continue
            if path.is_dir():
                if not path.is_symlink() and path.name != FILLED_IN:
                    left.append(path)
            elif path != folder / FILE:
                found.append(path.relative_to(folder).as_posix())
    return sorted(found)


def digest_of(path):
    """SHA-256 of a file of any size."""
    with open(path, "rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()


def write_manifest(folder, language=None):
    """Write SHA256SUMS of everything that lies in a folder.

    Parameters
    ----------
    folder : path
    language : str, optional
        That the papers were asked in; None: that of the job.

    Returns
    -------
    Path

    Examples
    --------
    >>> import tempfile
    >>> from pathlib import Path
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     size = Path(folder, "a.txt").write_bytes(b"abc")
    ...     text = write_manifest(folder).read_text()
    ...     read_manifest(folder).digests["a.txt"][:8], text.splitlines()[-1][:8]
    ('ba7816bf', 'ba7816bf')
    """
    folder = Path(folder)
    rows = [f"{_MADE}{maker()}", f"{_LANGUAGE}{language or '-'}"]
    rows += [f"{digest_of(folder / name)}  {name}" for name in files_below(folder)]
    path = folder / FILE
    path.write_text("\n".join([*rows, ""]), encoding="utf-8", newline="\n")
    return path


def read_manifest(folder):
    """The Manifest of a folder; None where it has none.

    Raises
    ------
    InputError
        For a file that is no list of hashes.
    OSError
        For one that cannot be read.
    """
    path = Path(folder) / FILE
    if not path.is_file():
        return None
    try:
        content = path.read_bytes() if path.stat().st_size <= MOST_BYTES else b"\xff"
        rows = content.decode("utf-8").splitlines()
    except ValueError:
        raise InputError(Problem(FILE, _no_list())) from None
    digests, made_by, language, problems = {}, "", None, []
    for number, row in enumerate(rows, 1):
        match = _ROW.fullmatch(row)
        if row.startswith(_MADE):
            made_by = row.removeprefix(_MADE)
        elif row.startswith(_LANGUAGE):
            said = row.removeprefix(_LANGUAGE)
            language = None if said == "-" else said
        elif match:
            digests[match[2]] = match[1]
        elif row.strip() and not row.startswith("#"):
            problems.append(Problem(FILE, _no_list(), number))
    if problems or not digests:
        raise InputError(problems[:1] or [Problem(FILE, _no_list())])
    return Manifest(digests, made_by, language, hashlib.sha256(content).hexdigest())


def _no_list():
    return message(
        "verify_no_manifest",
        "is no list of hashes; expected a SHA-256, two blanks and a name in each line, as tankcal "
        "wrote it",
    )
