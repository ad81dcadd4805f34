"""Lock of a job that a program has open, so that two programs do not edit it simultaneously.

A hidden file beside the job states the person, the machine and the process. The program renews its
time; without a renewal for `SILENT_S`, or if its process on this machine has ended, another program
may take the job over. Times are those of the file system, because clocks of machines differ.
"""

import getpass
import json
import os
import platform
import secrets
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from tempfile import NamedTemporaryFile

SILENT_S = 300  # time without a renewal after which another program may take over
RENEWAL_S = 60  # interval of the renewals


@dataclass(frozen=True)
class Holder:
    """Program that has a job open.

    Attributes
    ----------
    user, machine : str
        Login name and name of the machine.
    is_silent : bool
        Whether it has not renewed its lock for `SILENT_S`.
    """

    user: str
    machine: str
    is_silent: bool


def lock_path(source):
    """Path of the lock of a job."""
    source = Path(source)
    if source.is_file():
        return source.with_name(f".{source.name}.open.json")
    return source / ".open.json"


class JobLock:
    """Lock of a job for a program.

    Parameters
    ----------
    source : Path
        Folder or workbook of the job.
    owner : str
        Identifier of the program, as of `new_owner`.
    """

    def __init__(self, source, owner):
        self.path, self.owner = lock_path(source), owner

    def acquire(self, *, by_force=False):
        """Lock the job unless another program has it open.

        Parameters
        ----------
        by_force : bool, optional
            Whether to take the job over from a silent program.

        Returns
        -------
        Holder or None
            The other program; None: this program has the lock, or no lock can be written here.
        """
        content = self._read()
        if content is None:
            return self._create()
        if content.get("owner") == self.owner:
            return None
        is_silent = self._age_s() > SILENT_S
        if _has_ended(content) or (is_silent and by_force):
            with suppress(OSError):
                self.path.unlink()
            return self._create()
        named = [str(content.get(key) or "?") for key in ("user", "machine")]
        return Holder(*named, is_silent)

    def _create(self):
        """Write the lock, unless another program writes it at this moment."""
        content = {"owner": self.owner, "user": _user(), "machine": platform.node(),
                   "process": os.getpid()}  # fmt: skip
        try:
            handle = os.open(self.path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o644)
        except FileExistsError:
            other = self._read() or {}
            return Holder(str(other.get("user") or "?"), str(other.get("machine") or "?"), False)
        except OSError:
            return None  # a folder without write access cannot be edited anyway
        with os.fdopen(handle, "w", encoding="utf-8") as file:
            json.dump(content, file)
        return None

    def renew(self):
        """Renew the time of the lock if this program has it."""
        if (self._read() or {}).get("owner") == self.owner:
            with suppress(OSError):
                os.utime(self.path)

    def release(self):
        """Remove the lock if this program has it."""
        if (self._read() or {}).get("owner") == self.owner:
            with suppress(OSError):
                self.path.unlink()

    def _read(self):
        """Content of the lock; {} if it cannot be read, None if there is none."""
        try:
            content = json.loads(self.path.read_bytes())
        except FileNotFoundError:
            return None
        except (OSError, ValueError):
            return {}
        return content if isinstance(content, dict) else {}

    def _age_s(self):
        """Time since the last renewal by the clock of the file system."""
        try:
            with NamedTemporaryFile(dir=self.path.parent, prefix=".clock-") as file:
                now = os.fstat(file.fileno()).st_mtime
            return now - self.path.stat().st_mtime
        except OSError:
            return 0.0


def new_owner():
    """New identifier of a program."""
    return secrets.token_hex(8)


def _user():
    """Login name, or "" if it is not known."""
    with suppress(Exception):  # getpass raises several, by system
        return getpass.getuser()
    return ""


def _has_ended(content):
    """Whether the process of a lock of this machine has ended."""
    process = content.get("process")
    if content.get("machine") != platform.node() or not isinstance(process, int) or process < 1:
        return False
    if os.name != "posix":  # a signal 0 would stop the process there
        return False
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return True
    except OSError:
        return False
    return False
