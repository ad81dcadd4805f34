"""Cameras of other programs and publications: read, written, and turned into each other.

frame             a camera with its frame in pixels, its image points and rays
fitting           the camera of a given form that comes nearest to given images of rays
published         the conventions of the publications, with covariances
brown             the model in pixels that the programs below have in common
opencv, colmap, metashape, pix4d, balanced   a module for each form; filestorage: text of OpenCV
register          the text of cameras.toml
reading, writing  one door for files of all of them; texts: what the readers share
"""
