"""Loops that are plain Python and run compiled when numba is there.

A room writes its loops as ordinary functions beside their array form; here they are compiled, when
first asked for, with the results kept beside the source file. All functions that call one another
must live in one module: numba looks only at that file's date when it decides whether what it kept
is still true.
"""

import importlib.util
import os
from functools import cache
from types import FunctionType, SimpleNamespace

FAST = {"contract", "reassoc", "nsz"}  # sums in any order; NaN and infinity stay what they are


@cache
def available():
    """True when loops can be compiled; TANKCAL_COMPILED=0 turns that off."""
    if os.environ.get("TANKCAL_COMPILED", "1") == "0":
        return False
    return importlib.util.find_spec("numba") is not None


@cache
def compiled(module, names):
    """The functions `names` of a module, compiled; callees before their callers.

    module  a module object
    names   tuple of function names
    """
    import numba

    known = dict(vars(module))
    for name in names:
        plain = known[name]
        bound = FunctionType(plain.__code__, known, name, plain.__defaults__)
        bound.__module__, bound.__qualname__ = plain.__module__, plain.__qualname__
        known[name] = _jitted(numba, bound)
    return SimpleNamespace(**{name: known[name] for name in names})


def _jitted(numba, function):
    options = {"nogil": True, "error_model": "numpy", "fastmath": FAST}
    try:
        return numba.njit(cache=True, **options)(function)
    except RuntimeError:  # nowhere to keep the result: compile in each run
        return numba.njit(**options)(function)
