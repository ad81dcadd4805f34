"""How a number is written in text: plain digits, without groups, in tables and on command lines."""

import re

NUMBER = re.compile(r"[+-]?([0-9]+(\.[0-9]*)?|\.[0-9]+)([eE][+-]?[0-9]{1,4})?")
WHOLE_NUMBER = re.compile(r"[+-]?[0-9]{1,18}")
