"""Decoder that runs in a child process: LAZ by lazrs and E57 by libe57, one frame per chunk.

Memory and processor time are limited. This module checks nothing; a failure is reported in one
frame.
"""

import contextlib
import os
import struct

HEAD = struct.Struct("<BIQQ")  # kind, scan, records read, bytes that follow
DATA, DONE, FAILURE = 1, 2, 3
MEMORY = "memory"  # reason of a failure by lack of memory
MEMORY_LIMIT = 3 << 30  # largest address space of the child, bytes
# Processor time for one chunk, s: at least, and per million points (about 40 times the usual time)
LEAST_CPU_S, CPU_S_OF_MILLION = 4, 30
OUT_OF_TIME = (24,)  # signals of exhausted processor time: SIGXCPU
LONGEST_REASON = 160  # letters of a reason that are sent


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
