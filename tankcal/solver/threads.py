"""Limit of BLAS to one thread for small matrices.

Matrices with a few hundred rows are finished before a second thread is ready. On two busy cores,
the adjustment of 487 unknowns and its covariance took longer with two threads than with one: twice
as long in the best of 100 runs, six times as long in the median.
"""

from contextlib import nullcontext
from functools import cache

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
