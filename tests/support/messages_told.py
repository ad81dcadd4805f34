"""Warnings and problems as tests read them: each has the code that it is translated by."""

from tankcal.messages import Message


def lines(problems):
    """Warnings or problems as the terminal shows them."""
    uncoded = [str(one) for one in problems if not isinstance(one.expected, Message)]
    assert not uncoded
    return [str(one) for one in problems]
