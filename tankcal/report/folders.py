"""Folders of results: written all or nothing, and only where nothing of somebody else lies.

Whenever a program or a machine stops, the folder of results is whole: the earlier results, or the
new ones. Beside it lies, while a command writes, a hidden folder:

.tankcal-xxx/lock         held by the process that writes; a killed one holds nothing
.tankcal-xxx/made/NAME    the new results, as they are written
.tankcal-xxx/before/NAME  whole results: the new ones, then, exchanged, the earlier ones
.tankcal-xxx/rest         what is being removed

What a killed process leaves is put right by the next command that writes there.
"""

import ctypes
import errno
import functools
import os
import shutil
import sys
import tempfile
import time
from contextlib import contextmanager, suppress
from pathlib import Path

from tankcal.errors import InputError, Problem
from tankcal.job.tables import SETTINGS_FILE, WORKBOOK_FILE
from tankcal.messages import message
from tankcal.record import manifest

PREFIX, LOCK, MADE, BEFORE, REST = ".tankcal-", "lock", "made", "before", "rest"
NEW_S = 60  # a folder without a lock is so new that its process is about to lock it
EXCHANGE = 2  # RENAME_EXCHANGE of Linux, RENAME_SWAP of macOS
HERE = -100  # AT_FDCWD of Linux: paths are from the working directory
NO_EXCHANGE = (errno.ENOSYS, errno.EINVAL, errno.ENOTSUP)  # what a file system without it answers


def default_folder(source):
    """Where the results of a job (a Path) go by default.

    `results` in a job folder, whichever form it has; NAME-results beside any other NAME.xlsx, since
    several workbooks may lie in one folder.
    """
    if source.name in (SETTINGS_FILE, WORKBOOK_FILE):
        return source.parent / "results"
    if source.suffix.lower() == ".xlsx":
        return source.with_name(f"{source.stem}-results")
    return source / "results"


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
    link points to), which is made when missing. Files that somebody put into `directory` while the
    block ran are kept: they lie in the new one.

    language  that the papers were asked in; None: that of the job
    """
    target = Path(directory).resolve()
    target.parent.mkdir(parents=True, exist_ok=True)
    recover(target.parent)
    work = Path(tempfile.mkdtemp(prefix=PREFIX, dir=target.parent))
    try:
        with open(work / LOCK, "w") as lock:
            with suppress(OSError):  # some network drives have no locks: nobody recovers there
                lock_file(lock)
            try:
                made = work / MADE / target.name
                made.mkdir(parents=True)
                yield made
                manifest.write_manifest(made, language)
                _write_through(made)
                _swap(made, target, work / BEFORE / target.name)
            finally:
                _put_right(work)
    finally:
        _remove(work)


def recover(place):
    """Put right what killed processes left in a folder, `place`: nothing of theirs remains."""
    for work in Path(place).glob(f"{PREFIX}*"):
        if not work.is_dir() or work.is_symlink():
            continue
        with suppress(OSError):
            if not (work / LOCK).exists() and time.time() - work.stat().st_mtime < NEW_S:
                continue
            with open(work / LOCK, "a") as lock:
                if not lock_file(lock):
                    continue
                _put_right(work)
            _remove(work)


def lock_file(file):
    """Lock an open file until it is closed or this process ends; False: another process has it."""
    try:
        import fcntl
    except ImportError:  # Windows
        import msvcrt

        try:
            file.seek(0)
            msvcrt.locking(file.fileno(), msvcrt.LK_NBLCK, 1)
        except OSError:
            return False
        return True
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    return True


def _swap(made, target, before):
    """Put the folder `made` in the place of `target`; the earlier one remains as `before`."""
    if not target.exists():
        made.rename(target)
    else:
        before.parent.mkdir()
        made.rename(before)
        if not _exchange(before, target):
            before.rename(made)
            target.rename(before)
            made.rename(target)
    _write_through(target.parent, files=False)


def _exchange(one, other):
    """Exchange two folders in one step; False where the system has no such step."""
    call = _call_of_exchange()
    if call is None:
        return False
    if call(os.fsencode(one), os.fsencode(other)) == 0:
        return True
    number = ctypes.get_errno()
    if number in NO_EXCHANGE:
        return False
    raise OSError(number, os.strerror(number), str(other))


@functools.cache
def _call_of_exchange():
    """call(path, path) of the C library, 0 where it worked; None: it has none."""
    with suppress(OSError, AttributeError, TypeError):  # no C library, or one without the function
        library = ctypes.CDLL(None, use_errno=True)
        if sys.platform == "darwin":
            return lambda one, other: library.renamex_np(one, other, EXCHANGE)
        renameat2 = library.renameat2
        return lambda one, other: renameat2(HERE, one, HERE, other, EXCHANGE)
    return None


def _write_through(folder, files=True):
    """Wait until a folder, and the files below it, are on the disk and not only on their way."""
    if os.name != "posix":  # Windows has no handle of a folder
        return
    below = [path for path in folder.rglob("*") if not path.is_symlink()] if files else []
    for path in (*below, folder):
        handle = os.open(path, os.O_RDONLY)
        try:
            os.fsync(handle)
        except OSError as error:
            if error.errno != errno.EINVAL:  # some network drives cannot
                raise
        finally:
            os.close(handle)


def _put_right(work):
    """Put back earlier results that lack their place, keep files of others, remove the rest."""
    for earlier in (work / BEFORE).glob("*"):
        target = work.parent / earlier.name
        if target.exists():
            _keep_foreign(earlier, target)
        else:
            earlier.rename(target)
    if (work / BEFORE).exists():
        (work / BEFORE).rename(work / REST)  # once it is a part of it nothing is looked for in it
    for name in (MADE, REST):
        shutil.rmtree(work / name, ignore_errors=True)


def _keep_foreign(earlier, target):
    """Move the files that no SHA256SUMS of the two folders lists from the first to the second."""
    listed = {manifest.FILE}
    for folder in (earlier, target):
        with suppress(InputError):
            found = manifest.read_manifest(folder)
            listed.update(found.digests if found else ())
    for path in sorted(earlier.rglob("*")):
        name = path.relative_to(earlier)
        is_folder = path.is_dir() and not path.is_symlink()
        if is_folder or name.as_posix() in listed or manifest.FILLED_IN in name.parts[:-1]:
            continue
        place, count = target / name, 1
        while os.path.lexists(place):
            count += 1
            place = (target / name).with_stem(f"{name.stem} ({count})")
        place.parent.mkdir(parents=True, exist_ok=True)
        path.rename(place)


def _remove(work):
    """Remove a folder beside results, unless it holds any that could not be put right."""
    with suppress(OSError):
        (work / LOCK).unlink(missing_ok=True)  # Windows keeps a lock as long as it is open
        work.rmdir()
