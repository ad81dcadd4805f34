"""The camera: its model, the refinement of image points, the formats of other programs."""
