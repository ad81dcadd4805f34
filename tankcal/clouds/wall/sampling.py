"""A random sample of points that hangs on the points alone, not on their order or pieces.

Each point gets a number by a hash of its coordinates and its scan; the points of the smallest
numbers are the sample, so that samples of parts make the sample of the whole.
"""

import numpy as np

SEED = np.uint64(0x2011_7507_0000_0001)
MIX = tuple(np.uint64(one) for one in (0x9E3779B97F4A7C15, 0xBF58476D1CE4E5B9, 0x94D049BB133111EB))
PIECE = 1 << 16


class PointSample:
    """At most `most` points of all that were added, and how many there were of each scan.

    Parameters
    ----------
    most : int
    """

    def __init__(self, most):
        self.most, self.delivered = most, {}
        self._xyz, self._key = [np.empty((0, 3))], [np.empty(0, dtype=np.uint64)]
        self._scan = [np.empty(0, dtype=np.int64)]
        self._waiting, self._limit = 0, np.uint64(2**64 - 1)

    def add(self, xyz_m, scan):
        """Add points (n, 3) of one scan."""
        self.delivered[scan] = self.delivered.get(scan, 0) + len(xyz_m)
        for start in range(0, len(xyz_m), PIECE):
            part = xyz_m[start : start + PIECE]
            key = _hash(part, scan)
            taken = np.flatnonzero(key <= self._limit)
            self._xyz.append(part[taken])
            self._key.append(key[taken])
            self._scan.append(np.full(len(taken), scan, dtype=np.int64))
            self._waiting += len(taken)
            if self._waiting > self.most:
                self.reduce()

    def merged(self, other):
        """The sample of the points of both."""
        both = PointSample(self.most)
        both._xyz, both._key = self._xyz + other._xyz, self._key + other._key
        both._scan = self._scan + other._scan
        both.delivered = {
            scan: self.delivered.get(scan, 0) + other.delivered.get(scan, 0)
            for scan in self.delivered | other.delivered
        }
        return both

    def points(self):
        """(k, 3) points, in the order of their numbers."""
        order = self._order()
        return self._xyz[0][order]

    def scans(self):
        """(k,) scan of each of the points."""
        order = self._order()
        return self._scan[0][order]

    def _order(self):
        """(k,) order of the numbers, after the reduction."""
        self.reduce()
        return np.lexsort((*self._xyz[0].T, self._key[0]))

    def reduce(self):
        """Let go of points that are not in the sample."""
        xyz, key, scan = np.vstack(self._xyz), *map(np.concatenate, (self._key, self._scan))
        if len(key) > self.most:
            best = np.argpartition(key, self.most - 1)[: self.most]
            xyz, key, scan = xyz[best], key[best], scan[best]
            self._limit = key.max()
        self._xyz, self._key, self._scan, self._waiting = [xyz], [key], [scan], 0


def _hash(xyz_m, scan):
    """(n,) numbers of points, by splitmix64 over the bits of x, y and z."""
    bits = np.ascontiguousarray(xyz_m, dtype=float).view(np.uint64).reshape(-1, 3).T
    number = np.full(bits.shape[1], SEED ^ np.uint64(scan), dtype=np.uint64)
    for one in bits:
        number = (number ^ one) * MIX[0]
        number = (number ^ (number >> np.uint64(30))) * MIX[1]
        number = (number ^ (number >> np.uint64(27))) * MIX[2]
        number ^= number >> np.uint64(31)
    return number
