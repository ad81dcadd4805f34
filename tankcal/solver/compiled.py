"""Loops that are plain Python and run compiled when numba is there.

A room writes its loops as ordinary functions beside their array form; here they are compiled, when
first asked for, with the results kept beside the source file. All functions that call one another
must live in one module: numba looks only at that file's date when it decides whether what it kept
is still true.

Compiling takes 12 s, once on a machine, and loading what was kept 0.5 s in each run. The array form
needs about 16 us for an image point in an iteration (elimination included), compiled loops less
than a tenth of that. TANKCAL_COMPILED says what to do: 1 compiles at first use (so does leaving it
out: programs that call tankcal are served best in the long run); patient, which the command line
sets, leaves the work to arrays until there is enough of it, so that no small job waits for a
compiler; 0 never compiles.
"""

import importlib.util
import os
from functools import cache
from types import FunctionType, SimpleNamespace

AT_ONCE = 20_000  # rows of one problem from which compiling pays at once: 0.3 s an iteration
ENOUGH = 200_000  # rows that arrays have worked through, 3 s, before a compiler is asked
FAST = {"contract", "reassoc", "nsz"}  # sums in any order; NaN and infinity stay what they are


@cache
def available():
    """True when loops can be compiled; TANKCAL_COMPILED=0 turns that off."""
    if _asked_for() == "0":
        return False
    return importlib.util.find_spec("numba") is not None


@cache
def _asked_for():
    return os.environ.get("TANKCAL_COMPILED", "1")


_worked = 0  # rows that arrays have worked through in this process


def is_worth_compiling(rows=0):
    """Whether compiled loops are to be used, given how much work arrays have done so far.

    Parameters
    ----------
    rows : int, default 0
        Rows of a new problem, named by the first call about it; later calls about it name none.

    Returns
    -------
    bool
        `available()`, but where TANKCAL_COMPILED is "patient": then False until arrays have worked
        through enough rows to pay for the compiler.
    """
    global _worked
    if _asked_for() != "patient":
        return available()
    _worked = max(_worked + rows, ENOUGH if rows >= AT_ONCE else 0)
    return _worked >= ENOUGH and available()


@cache
def compile_functions(module, names):
    """Compile functions of one module; the compiled ones call each other, not the plain ones.

    Parameters
    ----------
    module : module
    names : tuple of str
        Names of its functions, those that are called before those that call them.

    Returns
    -------
    SimpleNamespace
        The compiled functions by their names; compiled once in a process.
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
