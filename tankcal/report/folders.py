"""Folders of results: written all or nothing, and only where nothing of somebody else lies."""

import shutil
import tempfile
from contextlib import contextmanager
from pathlib import Path

from tankcal.errors import InputError, Problem
from tankcal.messages import message
from tankcal.report import manifest


def default_folder(source):
    """Where the results of a job (a Path) go when nobody says where."""
    if source.suffix.lower() == ".xlsx":
        return source.with_name(f"{source.stem}-results")
    return (source.parent if source.name == "job.toml" else source) / "results"


def refuse_foreign(directory, known):
    """Raise InputError when `directory` exists and holds a file that is not among `known`.

    SHA256SUMS is always known.
    """
    directory = Path(directory)
    if not directory.exists():
        return
    name = directory.resolve().name
    if not directory.is_dir():
        raise InputError(
            Problem(name, message("out_is_a_file", "is a file; expected a folder for the results"))
        )
    foreign = sorted(
        path.name for path in directory.iterdir() if path.name not in (*known, manifest.FILE)
    )
    if foreign:
        raise InputError(
            Problem(
                name,
                message(
                    "out_is_foreign",
                    "holds {foreign!r}, which tankcal did not write; expected an empty folder or "
                    "one with earlier results only: move your files away or choose another --out",
                    foreign=foreign[0],
                ),
            )
        )


@contextmanager
def replaced(directory, language=None):
    """A folder to write to that takes the place of `directory` when the block ends without error.

    SHA256SUMS of all that was written is added. The folder lies beside `directory` (beside what a
    link points to), which is made when missing; what was there before goes last.

    language  that the papers were asked in; None: that of the job
    """
    target = Path(directory).resolve()
    target.parent.mkdir(parents=True, exist_ok=True)
    temporary = Path(tempfile.mkdtemp(prefix=".tankcal-", dir=target.parent))
    try:
        yield temporary
        manifest.write_manifest(temporary, language)
        temporary.chmod(0o755)
        _swap(temporary, target)
    finally:
        shutil.rmtree(temporary, ignore_errors=True)


def _swap(temporary, directory):
    """Put `temporary` in the place of `directory`; the old one goes last."""
    if not directory.exists():
        temporary.rename(directory)
        return
    aside = Path(tempfile.mkdtemp(prefix=".tankcal-old-", dir=directory.parent))
    try:
        directory.rename(aside / directory.name)
        try:
            temporary.rename(directory)
        except OSError:
            (aside / directory.name).rename(directory)
            raise
    finally:
        shutil.rmtree(aside, ignore_errors=True)
