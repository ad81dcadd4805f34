"""Loops that are plain Python and run compiled when numba is there.

A room writes its loops as ordinary functions beside their array form; here they are compiled, when
first asked for, with the results kept beside the source file. All functions that call one another
must live in one module: numba looks only at that file's date when it decides whether what it kept
is still true.

Compiling takes 9 s, once on a machine, and loading what was kept 0.3 s in each run. The array form
needs about 12 us for an image point in an iteration (elimination included), compiled loops less
than a tenth of that. So arrays do the work of small problems: no small job waits for a compiler,
and fewer rows are enough where compiled loops lie beside the package, made at installation by
`python -m tankcal.cli.kernels`. They are read from there also where nothing may be written.
TANKCAL_COMPILED=1 compiles at first use, 0 never.
"""

import hashlib
import importlib.util
import os
from contextlib import contextmanager
from contextvars import ContextVar
from functools import cache
from pathlib import Path
from types import FunctionType, SimpleNamespace

from tankcal.memory import without_collection

AT_ONCE = 20_000  # rows of a problem from which compiling pays: 0.3 s an iteration
LOADING = 0.05  # of that is enough where loops need not be compiled, only loaded
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


_SOURCES = (
    Path(__file__).with_name("loops.py"),
    Path(__file__).with_name("propagate.py"),
    Path(__file__).with_name("series.py"),
    Path(__file__).parents[1] / "camera/imaging.py",
)
_MARK = Path(__file__).parent / "__pycache__" / "kernels.txt"


def _stamp():
    return hashlib.sha256(b"".join(one.read_bytes() for one in _SOURCES)).hexdigest()


def mark_as_kept():
    """Say that compiled loops of these sources lie beside them; False where nothing is written."""
    try:
        _MARK.write_text(_stamp(), encoding="utf-8")
    except OSError:
        return False
    return any(_MARK.parent.glob("loops._eliminate-*.nbi"))


@cache
def are_kept():
    """True when an installation has compiled the loops (`tankcal.cli.kernels`) as they are now.

    What a large job left behind does not count, or a job would depend on those before it.
    """
    try:
        return _MARK.read_text(encoding="utf-8") == _stamp()
    except (OSError, UnicodeDecodeError):
        return False


_rows = ContextVar("rows of the problem at hand", default=0)


@contextmanager
def problem_of(rows):
    """A context in which the loops over any part are those of a problem of so many rows."""
    before = _rows.set(rows)
    try:
        yield
    finally:
        _rows.reset(before)


def is_worth_compiling(rows=0):
    """Whether compiled loops are to be used.

    It hangs on the size of the problem, never on what this process did before: compiled loops and
    arrays differ in the last digits, and the same job is to give the same ones. Loops that lie
    beside the package count, however they came there: a large problem leaves its own.

    Parameters
    ----------
    rows : int, default 0
        To be worked through, where that is more than those of `problem_of`.

    Returns
    -------
    bool
        False below the rows that pay for the compiler, or for loading what it made before; where
        TANKCAL_COMPILED is 1 or 0: `available()`.
    """
    if _asked_for() != "patient":
        return available()
    enough = LOADING * AT_ONCE if are_kept() else AT_ONCE
    return max(rows, _rows.get()) >= enough and available()


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
    known = dict(vars(module))
    called = {one for name in names for one in known[name].__code__.co_names}
    with without_collection():
        import numba

        for name in names:
            plain = known[name]
            bound = FunctionType(plain.__code__, known, name, plain.__defaults__)
            bound.__module__, bound.__qualname__ = plain.__module__, plain.__qualname__
            known[name] = _jitted(numba, bound, name in called)
    return SimpleNamespace(**{name: known[name] for name in names})


def _jitted(numba, function, into_others):
    """A compiled function; into_others: its code becomes part of those that call it."""
    compiled = numba.njit(**OPTIONS, forceinline=into_others)(function)
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
        with without_collection():
            found = self.beside.load_overload(signature, target)
            if found is None and self.usual is not None:
                found = self.usual.load_overload(signature, target)
        return found

    def save_overload(self, signature, data):
        """Keep a compiled function."""
        if self.usual is not None:
            self.usual.save_overload(signature, data)
