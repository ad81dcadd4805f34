"""What most keys and columns are: a number within bounds or above 0, or one of some words."""

from math import inf

from tankcal.job.fields import Field

FREE = "free"  # in place of a standard uncertainty: an unknown


def number(name, note, low=-inf, high=inf, **more):
    """A number from `low` to `high`."""
    return Field(name, "number", note, low=low, high=high, **more)


def positive(name, note, high=inf, **more):
    """A number above 0."""
    return Field(name, "number", note, low=0, above_low=True, high=high, **more)


def choice(name, note, choices, **more):
    """One of some words."""
    return Field(name, "choice", note, choices=choices, **more)
