"""The kinds of tank."""

KINDS = ("vertical", "horizontal", "sphere", "mesh")
VERTICAL = ("vertical",)
LYING = ("horizontal",)
STRAPPED = ("vertical", "horizontal")
WITH_POINTS = ("vertical", "horizontal", "sphere")
