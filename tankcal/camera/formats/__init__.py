"""Cameras of other programs and publications: reading, writing and conversion.

frame
    camera with its frame in pixels, image points and rays
fitting
    fit of a camera of a given form to images of rays
published
    conventions of publications, with covariances
brown
    common model in pixels of the programs below
opencv, colmap, metashape, pix4d, balanced
    form of each program, and the text of its files
reading, writing
    interface for files of all programs, and cameras.toml; texts: shared functions of the readers
"""
