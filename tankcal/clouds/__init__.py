"""Point clouds: files of scanners read in pieces, and the wall that they show.

`describe_cloud` looks at a file without reading its points, and `read_cloud` gives them a piece at
a time, each scan in its own frame; `tankcal.clouds.wall` makes cells of the wall of them.
"""

from tankcal.clouds.contents import CloudChunk, CloudHeader, ScanHeader
from tankcal.clouds.reading import describe_cloud, read_cloud

__all__ = ["CloudChunk", "CloudHeader", "ScanHeader", "describe_cloud", "read_cloud"]
