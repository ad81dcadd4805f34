"""Limits from rule files for valid surveys, and the allowed difference between repeats."""

import tomllib
from functools import cache
from importlib.resources import files

import numpy as np
from scipy.special import ndtri

BY_CHANCE = 0.01  # share of valid surveys with an apparent movement due to scatter


def limits_of(survey):
    """Limits of a kind of survey, by the name of its file in limits/."""
    return _read_limits("tankcal.pipeline", f"limits/{survey}.toml")


def limits_of_method(package):
    """Limits of a method, from limits.toml in its package."""
    return _read_limits(package, "limits.toml")


@cache
def _read_limits(package, path):
    return tomllib.loads(files(package).joinpath(path).read_text("utf-8"))


def limit_at(survey, table, figure, circumference_m):
    """Limit that depends on the circumference, from the first applicable row of a rule file.

    Parameters
    ----------
    survey, table, figure : str
        Name of the rule file, of its table, and of the limit in a row.
    circumference_m : float
        Circumference of the tank, m.

    Returns
    -------
    float
    """
    rows = limits_of(survey)[table]
    return next(row[figure] for row in rows if circumference_m <= row.get("up_to_m", np.inf))


def repeat_factor(count):
    """Difference between `count` repeats and their first readings, in standard deviations.

    At least one repeat exceeds it in one of a hundred valid surveys.
    """
    return np.sqrt(2) * -ndtri(BY_CHANCE / 2 / count)
