"""Horizontal cylinders and spheres fitted to points."""
