"""Memory of the process: pauses of the garbage collector, and release of freed memory."""

import ctypes
import gc
import sys
from contextlib import contextmanager


@contextmanager
def without_collection():
    """Context manager that pauses the garbage collector while many lasting objects are created.

    Notes
    -----
    The collector would scan the new objects repeatedly without freeing any. For the rows of a
    survey with 180 000 readings, the scans take half as long as the work itself. For numba and its
    compiled loops they take a fifth.
    """
    was_on = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        # A nested call must not enable the collector of the outer context.
        if was_on:
            gc.enable()


@contextmanager
def without_looking_back():
    """Context manager that excludes all existing objects from garbage collection."""
    gc.freeze()
    try:
        yield
    finally:
        gc.unfreeze()


def return_freed_memory():
    """Return freed memory to the operating system.

    Notes
    -----
    Computation leaves fragmented free memory: about 100 MB for a survey with 90 000 image points.
    The C library of Linux would keep this memory while the report is typeset. Other systems have no
    such function, and the call has no effect there.
    """
    if sys.platform == "linux":
        # C libraries other than glibc do not provide malloc_trim.
        trim = getattr(ctypes.CDLL(None), "malloc_trim", None)
        if trim:
            trim(0)
