"""Passes over the files of point clouds, in this process or by workers."""
