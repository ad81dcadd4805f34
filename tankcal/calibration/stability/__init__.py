"""Stability of a camera: comparison of its calibrations."""
