"""The kinds of tank."""

KINDS = ("vertical", "horizontal", "sphere", "mesh")
VERTICAL = ("vertical",)
WITH_POINTS = ("vertical", "horizontal", "sphere")
