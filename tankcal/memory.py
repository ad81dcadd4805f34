"""The memory of this process: when garbage is looked for, and what is given back."""

import ctypes
import gc
import sys
from contextlib import contextmanager


@contextmanager
def without_collection():
    """A context in which the garbage collector rests while much is made that is all kept.

    It would look through all of that again and again, and find nothing to free: of the rows of a
    survey with 180 000 readings that takes as long as half of the work itself, of numba and the
    loops that it loads a fifth.
    """
    was_on = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if was_on:
            gc.enable()


@contextmanager
def without_looking_back():
    """A context in which the garbage collector leaves alone what is there already: it is kept."""
    gc.freeze()
    try:
        yield
    finally:
        gc.unfreeze()


def return_freed_memory():
    """Give memory that was freed back to the machine: what computing leaves is in many pieces.

    Of a survey with 90 000 image points a hundred megabytes, which the C library of Linux would
    keep while the papers are set; others have no such function, and nothing is done.
    """
    if sys.platform == "linux":
        trim = getattr(ctypes.CDLL(None), "malloc_trim", None)
        if trim:
            trim(0)
