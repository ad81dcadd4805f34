"""What a name may be: of points, photos, cameras and everything else that a user names."""

import re

MAX_NAME = 64  # characters
_NAME = re.compile(r"\w[\w .()/#-]*")


def is_name(text):
    """Whether a text can be a name: a letter, digit or _ first, then also spaces and - . ( ) / #"""
    return len(text) <= MAX_NAME and _NAME.fullmatch(text) is not None


def file_name(text, otherwise):
    """A text as part of a file name: what no file system takes is _; what is left may be none.

    >>> file_name("T-1 / north", "tank")
    'T-1_north'
    """
    return re.sub(r"[^\w.()-]+", "_", text).strip("._")[:MAX_NAME] or otherwise
