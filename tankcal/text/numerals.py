"""Patterns of numbers in tables and on command lines: plain digits without groups."""

import re

NUMBER = re.compile(r"[+-]?([0-9]+(\.[0-9]*)?|\.[0-9]+)([eE][+-]?[0-9]{1,4})?")
WHOLE_NUMBER = re.compile(r"[+-]?[0-9]{1,18}")
