"""An invented language: each of its texts stands in brackets, so that one of no words is seen."""

import re


def bracketed(words):
    """The words, each text in brackets; a text with places keeps them inside."""
    if isinstance(words, dict):
        return {key: bracketed(value) for key, value in words.items()}
    return f"⟦{words}⟧" if isinstance(words, str) and words else words


def without_brackets(text):
    """What of a text stands outside of every pair of brackets."""
    shorter = re.sub(r"⟦[^⟦⟧]*⟧", "", text)
    return shorter if shorter == text else without_brackets(shorter)
