"""How many draws a study takes: as many as CI has time for, or as the figures of docs/ took.

`make study` takes the first number, `make study-full` (TANKCAL_STUDIES=full) the second. Where a
study is judged by a fixed band, it is the band of the full size: fewer draws never widen it.
"""

import os


def draws(in_ci, full):
    """The number of draws of this run."""
    return full if os.environ.get("TANKCAL_STUDIES") == "full" else in_ci
