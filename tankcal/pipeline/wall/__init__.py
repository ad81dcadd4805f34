"""Upright wall from points: separation from clutter, field, sections, shape."""
