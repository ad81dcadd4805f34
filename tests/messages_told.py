"""Warnings as tests read them, none of which may lack the code that paper translates it by."""

from tankcal.messages import Message


def lines(problems):
    """Warnings as the terminal shows them."""
    uncoded = [str(one) for one in problems if not isinstance(one.expected, Message)]
    assert not uncoded
    return [str(one) for one in problems]
