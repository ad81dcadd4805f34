"""BLAS on one thread where a second one costs more than it brings.

Matrices of a few hundred rows are done before a second thread has woken up: on two busy cores the
adjustment of 487 unknowns and its covariance took twice (best of 100 runs) to six times (median) as
long with two threads as with one.
"""

from contextlib import nullcontext
from functools import cache

LARGE = 2000  # rows from which a second thread is worth having


@cache
def _controller():
    from threadpoolctl import ThreadpoolController

    return ThreadpoolController().select(user_api="blas")


def threads_for(rows):
    """A context in which BLAS runs on one thread when the matrices have few rows."""
    if rows >= LARGE:
        return nullcontext()
    blas = _controller()
    if all(library.num_threads == 1 for library in blas.lib_controllers):
        return nullcontext()
    return blas.limit(limits=1)
