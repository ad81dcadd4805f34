"""Folders of results, replaced as a whole and never if they contain files of the user.

If a program or a machine stops, the folder contains either the complete earlier results or the
complete new results. While a command writes, a hidden folder exists beside the results:

.tankcal-xxx/lock         locked by the writing process; the lock ends with the process
.tankcal-xxx/made/NAME    the new results, while they are written
.tankcal-xxx/before/NAME  complete results: first the new, after the exchange the earlier results
.tankcal-xxx/rest         files to be removed

The next command that writes to the same place repairs the folders of a killed process.
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
NEW_S = 60  # age, s, up to which a folder without a lock may belong to a starting process
EXCHANGE = 2  # RENAME_EXCHANGE of Linux, RENAME_SWAP of macOS
HERE = -100  # AT_FDCWD of Linux: paths are relative to the working directory
# Errors of a file system without exchange.
NO_EXCHANGE = (errno.ENOSYS, errno.EINVAL, errno.ENOTSUP)


def default_folder(source):
    """Return the default folder for the results of a job (Path).

    The default is `results` in a job folder. For an Excel workbook NAME.xlsx it is NAME-results
    beside the workbook, since a folder may contain several workbooks.
    """
    if source.name in (SETTINGS_FILE, WORKBOOK_FILE):
        return source.parent / "results"
    if source.suffix.lower() == ".xlsx":
        return source.with_name(f"{source.stem}-results")
    return source / "results"


def refuse_foreign(directory, known):
    """Raise InputError if `directory` contains a file that is not among `known`.

    SHA256SUMS is always among the known files.
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
def replace_file(path):
    """Yield the path of a temporary file, which replaces a file if the block succeeds.

    An OSError names the file of the user instead of the temporary file.
    """
    temporary = path.with_name(f".{path.name}.{os.getpid()}.tmp")
    try:
        yield temporary
        temporary.replace(path)
    except OSError as error:
        raise type(error)(error.errno, error.strerror, str(path)) from error
    finally:
        with suppress(OSError):  # replaced, or never created
            temporary.unlink()


@contextmanager
def replace_folder(directory, language=None):
    """Context manager of a new folder that replaces `directory` if the block ends without error.

    The new folder lies beside `directory`, or beside the target of a link. It receives SHA256SUMS
    of all its files. Files that the user puts into `directory` while the block runs are kept.

    Parameters
    ----------
    directory : str or Path
        Folder of the results; it is created if it does not exist.
    language : str, optional
        Language requested for the papers; None: the language of the job.

    Yields
    ------
    Path
        New folder to write to.
    """
    target = Path(directory).resolve()
    target.parent.mkdir(parents=True, exist_ok=True)
    recover(target.parent)
    work = Path(tempfile.mkdtemp(prefix=PREFIX, dir=target.parent))
    try:
        with open(work / LOCK, "w") as lock:
            # Some network drives have no locks; `recover` does nothing there.
            with suppress(OSError):
                lock_file(lock)
            try:
                new_folder = work / MADE / target.name
                new_folder.mkdir(parents=True)
                yield new_folder
                manifest.write_manifest(new_folder, language)
                _write_through(new_folder)
                _swap(new_folder, target, work / BEFORE / target.name)
            finally:
                _put_right(work)
    finally:
        _remove(work)


def recover(place):
    """Repair and remove the hidden folders of killed processes in the folder `place`."""
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
    """Lock an open file until it is closed; return False if another process holds the lock."""
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


def _swap(new_folder, target, before):
    """Move the folder `new_folder` to `target`; the earlier folder becomes `before`."""
    if not target.exists():
        new_folder.rename(target)
    else:
        # Stage the new folder at `before`, then exchange it with `target` in one step if possible.
        before.parent.mkdir()
        new_folder.rename(before)
        if not _exchange(before, target):
            before.rename(new_folder)
            target.rename(before)
            new_folder.rename(target)
    _write_through(target.parent, files=False)


def _exchange(first, second):
    """Exchange two folders in one step; return False if the system does not support it."""
    call = _call_of_exchange()
    if call is None:
        return False
    if call(os.fsencode(first), os.fsencode(second)) == 0:
        return True
    number = ctypes.get_errno()
    if number in NO_EXCHANGE:
        return False
    raise OSError(number, os.strerror(number), str(second))


@functools.cache
def _call_of_exchange():
    """Return the exchange function of the C library (0 on success), or None if it has none."""
    with suppress(OSError, AttributeError, TypeError):  # no C library, or one without the function
        library = ctypes.CDLL(None, use_errno=True)
        if sys.platform == "darwin":
            return lambda first, second: library.renamex_np(first, second, EXCHANGE)
        renameat2 = library.renameat2
        return lambda first, second: renameat2(HERE, first, HERE, second, EXCHANGE)
    return None


def _write_through(folder, files=True):
    """Flush a folder, and the files below it, to the disk."""
    if os.name != "posix":  # Windows cannot open a folder
        return
    below = [path for path in folder.rglob("*") if not path.is_symlink()] if files else []
    for path in (*below, folder):
        handle = os.open(path, os.O_RDONLY)
        try:
            os.fsync(handle)
        except OSError as error:
            if error.errno != errno.EINVAL:  # some network drives cannot flush
                raise
        finally:
            os.close(handle)


def _put_right(work):
    """Restore earlier results without a successor, keep files of the user, remove the rest."""
    for earlier in (work / BEFORE).glob("*"):
        target = work.parent / earlier.name
        if target.exists():
            _keep_foreign(earlier, target)
        else:
            earlier.rename(target)
    if (work / BEFORE).exists():
        (work / BEFORE).rename(work / REST)  # after this step no results are restored from it
    for name in (MADE, REST):
        shutil.rmtree(work / name, ignore_errors=True)


def _keep_foreign(earlier, target):
    """Move files listed in neither SHA256SUMS from the folder `earlier` to `target`."""
    listed = {manifest.FILE}
    for folder in (earlier, target):
        with suppress(InputError):
            listing = manifest.read_manifest(folder)
            listed.update(listing.digests if listing else ())
    for path in sorted(earlier.rglob("*")):
        name = path.relative_to(earlier)
        is_folder = path.is_dir() and not path.is_symlink()
        if is_folder or name.as_posix() in listed or manifest.EMPTY_JOB in name.parts[:-1]:
            continue
        place, count = target / name, 1
        while os.path.lexists(place):
            count += 1
            place = (target / name).with_stem(f"{name.stem} ({count})")
        place.parent.mkdir(parents=True, exist_ok=True)
        path.rename(place)


def _remove(work):
    """Remove the hidden folder, unless it contains results that could not be restored."""
    with suppress(OSError):
        (work / LOCK).unlink(missing_ok=True)  # Windows cannot remove an open file
        work.rmdir()
