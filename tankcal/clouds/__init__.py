"""Point clouds: reading of scanner files, and detection of the wall in their points.

`describe_cloud` reads the header of a file. `read_cloud` yields the points in chunks, each scan in
its own frame. `pieces_of` divides a file into pieces that processes can read independently.
`tankcal.clouds.wall` sums the points in cells of the wall.
"""

from tankcal.clouds.contents import CloudChunk, CloudHeader, CloudPiece, ScanHeader
from tankcal.clouds.reading import describe_cloud, estimate_count, pieces_of, read_cloud

__all__ = [
    "CloudChunk",
    "CloudHeader",
    "CloudPiece",
    "ScanHeader",
    "describe_cloud",
    "estimate_count",
    "pieces_of",
    "read_cloud",
]
