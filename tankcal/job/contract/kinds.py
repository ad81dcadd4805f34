"""The kinds of tank."""

KINDS = ("vertical", "horizontal", "sphere", "mesh")
VERTICAL = ("vertical",)
LOADED = ("vertical", "sphere")  # whose wall gives way to what it holds
WITH_POINTS = ("vertical", "horizontal", "sphere")
