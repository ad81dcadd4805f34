"""Encoding of numbers and texts for the scripts of the web page."""

import base64
import json

_UNSAFE = {sign: f"\\u{ord(sign):04x}" for sign in "<>&\u2028\u2029"}


def pack_numbers(numbers, kind="<f8"):
    """Return numbers as base64 text of little-endian values of a numpy type, such as "<f8"."""
    import numpy as np

    return base64.b64encode(np.ascontiguousarray(numbers, dtype=kind).tobytes()).decode("ascii")


def script_data(data):
    """Return data as JSON for a script element; its characters cannot end the element."""
    compact = {"separators": (",", ":"), "sort_keys": True}  # sorted as in a saved notebook
    text = json.dumps(data, ensure_ascii=False, allow_nan=False, **compact)
    for sign, escaped in _UNSAFE.items():  # twenty times faster than str.translate
        text = text.replace(sign, escaped)
    return text
