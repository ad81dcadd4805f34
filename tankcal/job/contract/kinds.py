"""The kinds of tank."""

KINDS = ("vertical", "horizontal", "sphere", "mesh")
VERTICAL = ("vertical",)
LYING = ("horizontal",)
STRAPPED = ("vertical", "horizontal")
LOADED = ("vertical", "sphere")  # whose wall gives way to what it holds
WITH_POINTS = ("vertical", "horizontal", "sphere")
