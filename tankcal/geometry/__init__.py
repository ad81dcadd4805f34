"""Shapes and their fits: circle, cylinder, sphere, outline, the form of a wall, its outliers."""
