"""Decoding of compressed files in a child process, so that a crash does not end the parent.

The child process writes frames to its standard output. A frame has a head (kind, scan, records
read, bytes) and the bytes of the coordinates. The child limits its own memory and processor time.
The parent ends a child that sends no frame for a long time.

Decoder that runs in a child process: LAZ by lazrs and E57 by libe57, one frame per chunk.

Memory and processor time are limited. This module checks nothing; a failure is reported in one
frame.
"""

import contextlib
import json
import os
import re
import struct
import subprocess
import sys
import threading
import time
from dataclasses import dataclass

import numpy as np

from tankcal.messages import message

SILENT_S = 60  # longest time that a child may take for a chunk, s
PIPE_BYTES = 1 << 20  # size of the pipe from the child
F_SETPIPE_SZ = 1031  # fcntl command of Linux that sets the size of a pipe
CODE = (
    "import json, sys; request = json.loads(sys.argv[1]); sys.path[:] = request['sys_path']; "
    "from tankcal.clouds.formats.isolation import main; main(request)"
)
HEAD = struct.Struct("<BIQQ")  # kind, scan, records read, bytes that follow
DATA, DONE, FAILURE = 1, 2, 3
MEMORY = "memory"  # reason of a failure by lack of memory
MEMORY_LIMIT = 3 << 30  # largest address space of the child, bytes
# Processor time for one chunk, s: at least, and per million points (about 40 times the usual time)
LEAST_CPU_S, CPU_S_OF_MILLION = 4, 30
OUT_OF_TIME = (24,)  # signals of exhausted processor time: SIGXCPU
LONGEST_REASON = 160  # letters of a reason that are sent


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


# ---- decoder that runs in a child process: LAZ by lazrs and E57 by libe57, one frame per chunk


def main(request):
    """Write the frames of a request (see `isolation`) to the standard output."""
    out = os.fdopen(os.dup(1), "wb", buffering=0)
    os.dup2(2, 1)  # output that a library prints must not mix with the frames
    try:
        _limit_memory()
        for scan, read, data in {"laz": laz_chunks, "e57": e57_chunks}[request["kind"]](request):
            _send(out, DATA, scan, read, data)
        _send(out, DONE)
    except MemoryError:
        _send(out, FAILURE, data=MEMORY.encode())
    except BrokenPipeError:  # the parent has stopped reading
        pass
    except BaseException as error:  # a panic of Rust is not derived from Exception
        words = next(iter(f"{error}".strip().splitlines()), type(error).__name__)
        shown = "".join(c if c.isprintable() else "?" for c in words)[:LONGEST_REASON]
        _send(out, FAILURE, data=shown.encode())
    out.close()
    os._exit(0)


def _send(out, kind, scan=0, read=0, data=b""):
    # An unbuffered write may write only a part of the bytes.
    view = memoryview(data).cast("B")
    for part in (memoryview(HEAD.pack(kind, scan, read, len(view))), view):
        done = 0
        while done < len(part):
            done += out.write(part[done:])


def _limit_memory():
    with contextlib.suppress(ImportError, ValueError, OSError):
        import resource

        resource.setrlimit(resource.RLIMIT_AS, (MEMORY_LIMIT, MEMORY_LIMIT))


def _allow_time(points):
    """Set the limit of processor time for the next chunk; the system ends a slower process."""
    with contextlib.suppress(ImportError, ValueError, OSError):
        import resource

        usage = resource.getrusage(resource.RUSAGE_SELF)
        used = usage.ru_utime + usage.ru_stime
        limit = int(used + LEAST_CPU_S + CPU_S_OF_MILLION * points / 1e6) + 1
        resource.setrlimit(resource.RLIMIT_CPU, (limit, resource.getrlimit(resource.RLIMIT_CPU)[1]))


def laz_chunks(request):
    """Yield (0, number of points, int32 coordinates (points, 3)) of a LAZ file."""
    _allow_time(0)
    import lazrs
    import numpy as np

    count, record, chunk = request["count"], request["record"], request["chunk"]
    laszip = bytes.fromhex(request["laszip"])
    selection = lazrs.DecompressionSelection(
        lazrs.SELECTIVE_DECOMPRESS_XY_RETURNS_CHANNEL | lazrs.SELECTIVE_DECOMPRESS_Z
    )
    with open(request["path"], "rb") as stream:
        stream.seek(request["first"])
        reader = lazrs.LasZipDecompressor(stream, laszip, selection)
        if request["skip"]:
            reader.seek(request["skip"])
        place = np.dtype(
            {"names": ["xyz"], "formats": ["(3,)<i4"], "offsets": [0], "itemsize": record}
        )
        records = np.empty(min(chunk, count), place)
        for done in range(0, count, chunk):
            part = records[: min(chunk, count - done)]
            _allow_time(len(part))
            reader.decompress_many(part.view(np.uint8))
            yield 0, len(part), np.ascontiguousarray(part["xyz"])


def e57_chunks(request):
    """Yield (scan, records, coordinates (3, points)) of an E57 file, without invalid points."""
    _allow_time(0)
    import numpy as np
    from pye57 import libe57

    image = libe57.ImageFile(request["path"], "r")
    scans = image.root()["data3D"]
    for number, wanted in enumerate(request["scans"]):
        if not wanted["count"]:
            continue
        points = scans[number]["points"]
        # A scan of few points needs small buffers only.
        size = min(request["chunk"], wanted["count"])
        columns = np.zeros((3, size), wanted["type"])
        state = np.zeros(size, np.int8)
        buffers = libe57.VectorSourceDestBuffer()
        fields = [*zip(wanted["fields"], columns, strict=True)]
        fields += [(wanted["state"], state)] if wanted["state"] else []
        for name, array in fields:
            buffers.append(libe57.SourceDestBuffer(image, name, array, size, True, True))
        reader = points.reader(buffers)
        while True:
            _allow_time(size)
            read = reader.read()
            if not read:
                break
            coordinates = columns[:, :read]
            if wanted["state"] and state[:read].any():
                coordinates = coordinates[:, state[:read] == 0]
            if wanted["is_spherical"]:
                coordinates = _cartesian(coordinates)
            yield number, read, np.ascontiguousarray(coordinates)
        reader.close()
    image.close()


def _cartesian(columns):
    """Convert range, azimuth from +x and elevation (rad), each of shape (n,), to x, y, z."""
    import numpy as np

    distance, azimuth, elevation = columns
    across = distance * np.cos(elevation)
    return np.array(
        [across * np.cos(azimuth), across * np.sin(azimuth), distance * np.sin(elevation)]
    )
