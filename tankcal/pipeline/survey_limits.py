"""The figures of rule files: what a sound survey keeps to, as far as it was remembered or read, and
by how much its repeats may differ.
"""

import tomllib
from functools import cache
from importlib.resources import files

import numpy as np
from scipy.special import ndtri

BY_CHANCE = 0.01  # of sound surveys in which something seems to have moved by readings' scatter


@cache
def limits_of(survey):
    """The figures of a kind of survey, by the name of its file in limits/."""
    text = files("tankcal.pipeline").joinpath(f"limits/{survey}.toml").read_text("utf-8")
    return tomllib.loads(text)


def limit_at(survey, table, figure, circumference_m):
    """A figure of a rule file that depends on the circumference: of the first row that holds it."""
    rows = limits_of(survey)[table]
    return next(row[figure] for row in rows if circumference_m <= row.get("up_to_m", np.inf))


def repeat_factor(count):
    """By how many standard deviations one of so many repeats differs from what was read first, in
    one of a hundred sound surveys.
    """
    return np.sqrt(2) * -ndtri(BY_CHANCE / 2 / count)
