"""Kinds of tank, and groups of kinds that share keys and tables."""

KINDS = ("vertical", "horizontal", "sphere", "mesh")
VERTICAL = ("vertical",)
LYING = ("horizontal",)
STRAPPED = ("vertical", "horizontal")
LOADED = ("vertical", "sphere")  # kinds whose wall expands under the load of the content
WITH_POINTS = ("vertical", "horizontal", "sphere")
