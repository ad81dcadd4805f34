"""Point clouds: files of scanners read in pieces, and the wall that they show.

`describe_cloud` looks at a file without reading its points, and `read_cloud` gives them a piece at
a time, each scan in its own frame, of whole files or of pieces of them that are shared out
(`pieces_of`); `tankcal.clouds.wall` makes cells of the wall of them.
"""

from tankcal.clouds.contents import CloudChunk, CloudHeader, CloudPiece, ScanHeader
from tankcal.clouds.reading import count_about, describe_cloud, pieces_of, read_cloud

__all__ = [
    "CloudChunk",
    "CloudHeader",
    "CloudPiece",
    "ScanHeader",
    "count_about",
    "describe_cloud",
    "pieces_of",
    "read_cloud",
]
