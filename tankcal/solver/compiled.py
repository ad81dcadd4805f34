"""Loops that are plain Python and run compiled when numba is there.

A room writes its loops as ordinary functions beside their array form; here they are compiled, when
first asked for, with the results kept beside the source file. All functions that call one another
must live in one module: numba looks only at that file's date when it decides whether what it kept
is still true.

Compiling takes 7 s, once on a machine, and loading what was kept 0.4 s in each run. The array form
needs about 12 us for an image point in an iteration (elimination included), compiled loops less
than a tenth of that. So the work is left to arrays until there is enough of it: no small job waits
for a compiler, and less is enough where compiled loops lie beside the package, made at installation
by `python -m tankcal.cli.kernels`. They are read from there also where nothing may be written.
TANKCAL_COMPILED=1 compiles at first use, 0 never.
"""

import importlib.util
import os
from functools import cache
from pathlib import Path
from types import FunctionType, SimpleNamespace

AT_ONCE = 20_000  # rows of one problem from which compiling pays at once: 0.3 s an iteration
ENOUGH = 200_000  # rows that arrays have worked through, 3 s, before a compiler is asked
LOADING = 0.1  # of both is enough where loops need not be compiled, only loaded
FAST = {"contract", "reassoc", "nsz"}  # sums in any order; NaN and infinity stay what they are
OPTIONS = {"nogil": True, "error_model": "numpy", "fastmath": FAST}


@cache
def available():
    """True when loops can be compiled; TANKCAL_COMPILED=0 turns that off."""
    if _asked_for() == "0":
        return False
    return importlib.util.find_spec("numba") is not None


@cache
def _asked_for():
    return os.environ.get("TANKCAL_COMPILED", "patient")


@cache
def are_kept():
    """True when compiled loops of the solver lie beside their source."""
    return any(Path(__file__).parent.glob("__pycache__/loops._eliminate-*.nbi"))


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
        False until arrays have worked through enough rows to pay for the compiler, or for loading
        what it made before; where TANKCAL_COMPILED is 1 or 0: `available()`.
    """
    global _worked
    if _asked_for() != "patient":
        return available()
    share = LOADING if are_kept() else 1.0
    enough = share * ENOUGH
    _worked = max(_worked + rows, enough if rows >= share * AT_ONCE else 0)
    return _worked >= enough and available()


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
    compiled = numba.njit(**OPTIONS)(function)
    try:
        compiled.enable_caching()
    except RuntimeError:  # nowhere to keep the result: compile in each run
        usual = None
    else:
        usual = compiled._cache
    beside = _kept_beside(function)
    if beside is not None:
        compiled._cache = _Kept(beside, usual)
    return compiled


def _kept_beside(function):
    """The cache of numba beside the source, to be read only; None where it cannot be had.

    The one that numba chooses is there, too, but only where it may write.
    """
    try:
        from numba.core import caching

        class Beside(caching.InTreeCacheLocator):
            def ensure_cache_path(self):
                """Nothing is written."""

        class Format(caching.CompileResultCacheImpl):
            _locator_classes = (Beside,)

        class Cache(caching.FunctionCache):
            _impl_class = Format

        return Cache(function)
    except (ImportError, AttributeError, RuntimeError, OSError):
        return None


class _Kept:
    """A cache of compiled functions as numba asks it: kept beside the source, else where it may.

    beside, usual  caches of numba; the second is None where nothing may be written
    """

    def __init__(self, beside, usual):
        self.beside, self.usual = beside, usual
        self.cache_path = (usual or beside).cache_path

    def load_overload(self, signature, target):
        """The compiled function of a signature, None: it is not kept."""
        found = self.beside.load_overload(signature, target)
        if found is None and self.usual is not None:
            found = self.usual.load_overload(signature, target)
        return found

    def save_overload(self, signature, data):
        """Keep a compiled function."""
        if self.usual is not None:
            self.usual.save_overload(signature, data)
