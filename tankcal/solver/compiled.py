"""Loops in plain Python, which are compiled if numba is available.

A module writes its loops as ordinary functions next to their array form. This module compiles them
at their first use and stores the result next to the source file. All functions that call each other
must be in the same module, because numba checks only the date of that file before it reuses a
stored result.

Compilation takes 9 s, once for each machine. Loading the stored result takes 0.3 s in each run. The
array form needs about 12 us for an image point in an iteration (with elimination), compiled loops
less than a tenth of this time. Small problems therefore use arrays, and no small job waits for the
compiler. A lower threshold applies if compiled loops exist in the package, created at installation
by `python -m tankcal.cli.kernels`. They are also read from a directory without write access.

The environment variable TANKCAL_COMPILED=1 compiles at first use, TANKCAL_COMPILED=0 never.

Limit of BLAS to one thread for small matrices.

Matrices with a few hundred rows are finished before a second thread is ready. On two busy cores,
the adjustment of 487 unknowns and its covariance took longer with two threads than with one: twice
as long in the best of 100 runs, six times as long in the median.
"""

import hashlib
import importlib.util
import os
from contextlib import contextmanager, nullcontext
from contextvars import ContextVar
from functools import cache
from pathlib import Path
from types import FunctionType, SimpleNamespace

from tankcal.memory import without_collection

AT_ONCE = 20_000  # rows from which compilation saves time: 0.3 s in each iteration
LOADING = 0.05  # fraction of AT_ONCE that suffices if compiled loops only need loading
FAST = {"contract", "reassoc", "nsz"}  # sums in any order; NaN and infinity are preserved
OPTIONS = {"nogil": True, "error_model": "numpy", "fastmath": FAST}


@cache
def available():
    """Whether loops can be compiled; TANKCAL_COMPILED=0 disables compilation."""
    if _requested_mode() == "0":
        return False
    return importlib.util.find_spec("numba") is not None


@cache
def _requested_mode():
    """Value of TANKCAL_COMPILED, by default "patient": compile large problems only."""
    return os.environ.get("TANKCAL_COMPILED", "patient")


_SOURCES = (
    Path(__file__).with_name("loops.py"),
    Path(__file__).with_name("propagate.py"),
    Path(__file__).with_name("series.py"),
    Path(__file__).parents[1] / "camera/imaging.py",
)
_MARK = Path(__file__).parent / "__pycache__" / "kernels.txt"


def _hash_sources():
    """SHA-256 of all source files with compiled loops, as hexadecimal text."""
    return hashlib.sha256(b"".join(path.read_bytes() for path in _SOURCES)).hexdigest()


def mark_as_kept():
    """Record that compiled loops of the present sources exist next to the sources.

    Returns
    -------
    bool
        False if the directory is not writable or contains no compiled loops.
    """
    try:
        _MARK.write_text(_hash_sources(), encoding="utf-8")
    except OSError:
        return False
    return any(_MARK.parent.glob("loops._eliminate-*.nbi"))


@cache
def are_kept():
    """Whether an installation has compiled the loops of the present sources.

    Returns
    -------
    bool

    Notes
    -----
    Loops compiled by a large job do not count. Otherwise the result of a job would depend on
    earlier jobs.
    """
    # The mark is written only by `tankcal.cli.kernels`, never by a job.
    try:
        return _MARK.read_text(encoding="utf-8") == _hash_sources()
    except (OSError, UnicodeDecodeError):
        return False


_rows = ContextVar("rows of the problem at hand", default=0)


@contextmanager
def problem_of(rows):
    """Context manager in which all loops use the form chosen for a problem of this size.

    Parameters
    ----------
    rows : int
        Number of rows of the problem.
    """
    token = _rows.set(rows)
    try:
        yield
    finally:
        _rows.reset(token)


def is_worth_compiling(rows=0):
    """Whether to use compiled loops.

    Parameters
    ----------
    rows : int, optional
        Number of rows, if larger than the number set by `problem_of`.

    Returns
    -------
    bool
        False below the number of rows that justifies compilation, or loading of compiled loops.
        With TANKCAL_COMPILED set to 1 or 0, the result of `available()`.

    Notes
    -----
    The result depends on the size of the problem, never on earlier work of this process. Compiled
    loops and arrays differ in the last digits, and a job must reproduce its digits. Compiled loops
    of an installation lower the threshold, see `are_kept`.
    """
    if _requested_mode() != "patient":
        return available()
    # Loading takes a fraction of the time of compilation, so fewer rows justify it.
    threshold = LOADING * AT_ONCE if are_kept() else AT_ONCE
    return max(rows, _rows.get()) >= threshold and available()


@cache
def compile_functions(module, names):
    """Compile functions of a module, so that the compiled functions call each other.

    Parameters
    ----------
    module : module
        The module.
    names : tuple of str
        Names of the functions; a called function precedes its callers.

    Returns
    -------
    SimpleNamespace
        Compiled functions by name, compiled once in each process.
    """
    namespace = dict(vars(module))
    called_names = {callee for name in names for callee in namespace[name].__code__.co_names}
    with without_collection():
        import numba

        # Each function is bound to a namespace in which the functions before it are already
        # compiled; the module itself stays unchanged.
        for name in names:
            plain = namespace[name]
            function = FunctionType(plain.__code__, namespace, name, plain.__defaults__)
            function.__module__, function.__qualname__ = plain.__module__, plain.__qualname__
            namespace[name] = _compile_function(numba, function, name in called_names)
    return SimpleNamespace(**{name: namespace[name] for name in names})


def _compile_function(numba, function, inline):
    """Compile a function with numba; `inline` inserts its code into the callers."""
    compiled = numba.njit(**OPTIONS, forceinline=inline)(function)
    # Results stored in the package are read first: numba alone reads only a writable directory.
    try:
        compiled.enable_caching()
    except RuntimeError:  # no writable directory: compile in each run
        writable_cache = None
    else:
        writable_cache = compiled._cache
    package_cache = _open_package_cache(function)
    if package_cache is not None:
        compiled._cache = _FunctionCache(package_cache, writable_cache)
    return compiled


def _open_package_cache(function):
    """Open numba's cache next to the source, read-only; None if it is not available.

    The cache directory chosen by numba may be the same, but only if it is writable.
    """
    # These classes are internal to numba: without them only the cache chosen by numba is used.
    try:
        from numba.core import caching

        class Beside(caching.InTreeCacheLocator):
            """Locator of the cache next to the source file."""

            def ensure_cache_path(self):
                """Accept a directory without write access."""

        class Format(caching.CompileResultCacheImpl):
            _locator_classes = (Beside,)

        class Cache(caching.FunctionCache):
            _impl_class = Format

        return Cache(function)
    except (ImportError, AttributeError, RuntimeError, OSError):
        return None


class _FunctionCache:
    """Cache of compiled functions in numba's interface: package first, then numba's directory.

    Parameters
    ----------
    beside : object
        Cache of numba next to the source, read-only.
    usual : object or None
        Cache in the directory chosen by numba; None without a writable directory.
    """

    def __init__(self, beside, usual):
        self.beside, self.usual = beside, usual
        self.cache_path = (usual or beside).cache_path

    def load_overload(self, signature, target):
        """Compiled function for a signature, or None if it is not stored."""
        with without_collection():
            overload = self.beside.load_overload(signature, target)
            if overload is None and self.usual is not None:
                overload = self.usual.load_overload(signature, target)
        return overload

    def save_overload(self, signature, data):
        """Store a compiled function in the directory chosen by numba."""
        if self.usual is not None:
            self.usual.save_overload(signature, data)


# ---- threads

LARGE = 2000  # rows from which a second thread saves time


@cache
def _controller():
    """Controller of the BLAS libraries, loaded at first use."""
    from threadpoolctl import ThreadpoolController

    return ThreadpoolController().select(user_api="blas")


def threads_for(rows):
    """Context manager that limits BLAS to one thread for matrices with few rows.

    Parameters
    ----------
    rows : int
        Number of rows of the matrices.
    """
    if rows >= LARGE:
        return nullcontext()
    blas = _controller()
    # No change is needed if BLAS already runs on one thread.
    if all(library.num_threads == 1 for library in blas.lib_controllers):
        return nullcontext()
    return blas.limit(limits=1)
