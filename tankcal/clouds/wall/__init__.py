"""From points of scans to cells of the wall: what is wall, what stands before it."""
