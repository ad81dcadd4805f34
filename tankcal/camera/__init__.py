"""Camera model, refinement of image points, and camera formats of other programs."""
