"""Decoding of compressed files in a child process, so that a crash does not end the parent.

The child (`decoding`) writes frames to its standard output. A frame has a head (kind, scan, records
read, bytes) and the bytes of the coordinates. The child limits its own memory and processor time.
The parent ends a child that sends no frame for a long time.
"""

import contextlib
import json
import re
import subprocess
import sys
import threading
import time
from dataclasses import dataclass

import numpy as np

from tankcal.clouds.formats.decoding import DONE, FAILURE, HEAD, MEMORY, OUT_OF_TIME
from tankcal.messages import message

SILENT_S = 60  # longest time that a child may take for a chunk, s
PIPE_BYTES = 1 << 20  # size of the pipe from the child
F_SETPIPE_SZ = 1031  # fcntl command of Linux that sets the size of a pipe
CODE = (
    "import json, sys; request = json.loads(sys.argv[1]); sys.path[:] = request['sys_path']; "
    "from tankcal.clouds.formats.decoding import main; main(request)"
)


@dataclass(frozen=True)
class Frame:
    """Some records of a scan: `data` contains the bytes (uint8) of `read` records."""

    scan: int
    read: int
    data: np.ndarray


def decode_frames(file, request):
    """Yield the frames of a file from a child; raise InputError if the child fails or hangs."""
    request = {**request, "sys_path": sys.path}
    child = subprocess.Popen(
        [sys.executable, "-c", CODE, json.dumps(request)],
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        bufsize=0,
    )
    _widen_pipe(child.stdout)
    watch = _Watch(child)
    try:
        while (frame := _next_frame(file, child, watch)) is not None:
            yield frame
    finally:
        watch.stop()
        child.kill()
        child.stdout.close()
        child.wait()


def _next_frame(file, child, watch):
    """Read the next `Frame`, None at the end; raise InputError if the child ended early."""
    with watch.limit_wait():
        head = _read_exactly(child.stdout, HEAD.size)
        data = None
        if head is not None:
            kind, scan, read, size = HEAD.unpack(head)
            data = _read_exactly(child.stdout, size)
    if data is None:
        raise _exit_error(file, child, watch)
    if kind == FAILURE:
        raise _failure_error(file, data.tobytes().decode("utf-8", errors="replace"))
    return None if kind == DONE else Frame(scan, read, data)


def _read_exactly(stream, size):
    """Read `size` bytes as an array of uint8; None if the stream ends before."""
    data = np.empty(size, np.uint8)
    view, done = memoryview(data), 0
    while done < size:
        count = stream.readinto(view[done:])
        if not count:
            return None
        done += count
    return data


def _widen_pipe(stream):
    with contextlib.suppress(ImportError, OSError, AttributeError):
        import fcntl

        fcntl.fcntl(stream.fileno(), F_SETPIPE_SZ, PIPE_BYTES)


class _Watch:
    """Thread that ends a child if it sends nothing for SILENT_S while the parent waits."""

    def __init__(self, child):
        self.child, self.since, self.has_ended_child = child, None, False
        self._over = threading.Event()
        threading.Thread(target=self._run, daemon=True).start()

    @contextlib.contextmanager
    def limit_wait(self):
        """Context in which the parent waits for the child."""
        self.since = time.monotonic()
        try:
            yield
        finally:
            self.since = None

    def stop(self):
        """Stop the thread."""
        self._over.set()

    def _run(self):
        while not self._over.wait(1.0):
            since = self.since
            if since is not None and time.monotonic() - since > SILENT_S:
                self.has_ended_child = True
                self.child.kill()
                return


def _exit_error(file, child, watch):
    """Create the InputError for a child that ended without a failure frame."""
    status = child.wait()
    if watch.has_ended_child or -status in OUT_OF_TIME:
        text = message(
            "cloud_file_hang", "its reader came to no end with it and was stopped: is it damaged?"
        )
    elif status < 0:
        text = message(
            "cloud_file_abort",
            "its reader was ended by the system (signal {signal}): is the file damaged?",
            signal=str(-status),
        )
    else:
        text = message(
            "cloud_file_exit",
            "its reader ended with status {status} before the last point: is the file damaged?",
            status=str(status),
        )
    return file.refusal(text)


def _failure_error(file, reason):
    """Create the InputError for a failure that the child reported."""
    if reason == MEMORY:
        return file.refusal(
            message(
                "cloud_file_memory",
                "its reader asked for more memory than it may have: is the file damaged?",
            )
        )
    if re.search(r"not supported|unsupported", reason, re.IGNORECASE):
        return file.refusal(
            message(
                "cloud_file_unsupported",
                "its reader does not support it ({reason}); expected points as present programs"
                " write them: convert it to LAS or save it again with the program that wrote it",
                reason=reason,
            )
        )
    return file.refusal(
        message(
            "cloud_file_library",
            "its reader refused it ({reason}): is the file damaged?",
            reason=reason,
        )
    )
