"""Constructors of the most frequent keys and columns: bounded numbers and choices."""

from math import inf

from tankcal.job.fields import Field

FREE = "free"  # in place of a standard uncertainty: estimated as an unknown


def number(name, note, low=-inf, high=inf, **more):
    """Return a `Field` for a number from `low` to `high`."""
    return Field(name, "number", note, low=low, high=high, **more)


def positive(name, note, high=inf, **more):
    """Return a `Field` for a number above 0, at most `high`."""
    return Field(name, "number", note, low=0, above_low=True, high=high, **more)


def choice(name, note, choices, **more):
    """Return a `Field` for a word of `choices`."""
    return Field(name, "choice", note, choices=choices, **more)


KINDS = ("vertical", "horizontal", "sphere", "mesh")
VERTICAL = ("vertical",)
LYING = ("horizontal",)
STRAPPED = ("vertical", "horizontal")
LOADED = ("vertical", "sphere")  # kinds whose wall expands under the load of the content
WITH_POINTS = ("vertical", "horizontal", "sphere")
