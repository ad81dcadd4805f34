"""SHA256SUMS: the SHA-256 of every file in a folder of results, in the format of `sha256sum -c`.

The first lines list the programs, packages and machine that made the files. With these, a record
gives files with the same bytes.
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
EMPTY_JOB = "job"  # folder of the empty job in the folder of a plan, not listed: users fill it in
MOST_BYTES = 10_000_000  # largest size of a manifest
PACKAGES = (  # packages that change the bytes of results
    *("numpy", "scipy", "matplotlib", "xlsxwriter", "mistune", "typst", "segno"),
    "pypdf",  # for a signature field
)
_MADE = "# made by "
_LANGUAGE = "# language asked for: "
_ROW = re.compile(r"([0-9a-f]{64}) [ *](.+)")


@dataclass(frozen=True)
class Manifest:
    """Content of a SHA256SUMS.

    Attributes
    ----------
    digests : dict
        {path below the folder, with slashes: SHA-256 of the file}.
    made_by : str
        Program, packages and machine that made the files; "" if not stated.
    language : str or None
        Requested language of the reports; None: language of the job, or not stated.
    sha256 : str
        SHA-256 of the manifest.
    """

    digests: dict = field(default_factory=dict)
    made_by: str = ""
    language: str | None = None
    sha256: str = ""


def describe_maker():
    """Return program, packages and kind of machine of the present process in one line."""
    packages = [f"{name} {_version(name)}" for name in PACKAGES]
    python = f"python {platform.python_version()}"
    machine = f"{platform.system()} {platform.machine()}"
    return ", ".join([f"tankcal {tankcal.__version__}", python, *packages, machine])


def _version(name):
    from importlib import metadata  # slow: loading it takes as long as the help of a command

    try:
        return metadata.version(name)
    except metadata.PackageNotFoundError:
        return "-"


def files_below(folder):
    """Return the sorted paths, below a folder and with slashes, of the files of its manifest.

    The manifest, hidden files and the empty job of a plan are excluded. Links to folders are not
    followed.
    """
    folder, files, folders = Path(folder), [], [Path(folder)]
    while folders:
        for path in folders.pop().iterdir():
            if path.name.startswith("."):
                continue
            if path.is_dir():
                if not path.is_symlink() and path.name != EMPTY_JOB:
                    folders.append(path)
            elif path != folder / FILE:
                files.append(path.relative_to(folder).as_posix())
    return sorted(files)


def digest_of(path):
    """Return the SHA-256 of a file of any size."""
    with open(path, "rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()


def write_manifest(folder, language=None):
    """Write SHA256SUMS of all files in a folder.

    Parameters
    ----------
    folder : path
    language : str, optional
        Requested language of the reports; None: language of the job.

    Returns
    -------
    Path
        The manifest.

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
    rows = [f"{_MADE}{describe_maker()}", f"{_LANGUAGE}{language or '-'}"]
    rows += [f"{digest_of(folder / name)}  {name}" for name in files_below(folder)]
    path = folder / FILE
    path.write_text("\n".join([*rows, ""]), encoding="utf-8", newline="\n")
    return path


def read_manifest(folder):
    """Read the Manifest of a folder; None if it has none.

    Raises
    ------
    InputError
        For a file that is no list of hashes.
    OSError
        For a file that cannot be read.
    """
    path = Path(folder) / FILE
    if not path.is_file():
        return None
    try:
        content = path.read_bytes() if path.stat().st_size <= MOST_BYTES else b"\xff"
        rows = content.decode("utf-8").splitlines()
    except ValueError:
        raise InputError(_invalid()) from None
    digests, made_by, language, problems = {}, "", None, []
    for number, row in enumerate(rows, 1):
        match = _ROW.fullmatch(row)
        if row.startswith(_MADE):
            made_by = row.removeprefix(_MADE)
        elif row.startswith(_LANGUAGE):
            requested = row.removeprefix(_LANGUAGE)
            language = None if requested == "-" else requested
        elif match:
            digests[match[2]] = match[1]
        elif row.strip() and not row.startswith("#"):
            problems.append(_invalid(number))
    if problems or not digests:
        raise InputError(problems[:1] or [_invalid()])
    return Manifest(digests, made_by, language, hashlib.sha256(content).hexdigest())


def _invalid(row=None):
    """Return the Problem of a file that is no list of hashes."""
    text = message(
        "verify_no_manifest",
        "is no list of hashes; expected a SHA-256, two blanks and a name in each line, as tankcal "
        "wrote it",
    )
    return Problem(FILE, text, row)
