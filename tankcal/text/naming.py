"""Permitted names of points, photos, cameras and other user-defined objects."""

import re

MAX_NAME = 64  # characters
_NAME = re.compile(r"\w[\w .()/#-]*")


def is_name(text):
    """Return whether a text is a name: a letter, digit or _, then also spaces and - . ( ) / #"""
    return len(text) <= MAX_NAME and _NAME.fullmatch(text) is not None


def file_name(text, otherwise):
    """Convert a text to part of a file name; invalid characters become _.

    Returns `otherwise` if no character remains.

    >>> file_name("T-1 / north", "tank")
    'T-1_north'
    """
    return re.sub(r"[^\w.()-]+", "_", text).strip("._")[:MAX_NAME] or otherwise
