"""Random sample of points that does not depend on the order or division of the points.

Each point has a number, a hash of its coordinates and its scan. The sample consists of the points
with the smallest numbers, so that samples of parts merge to the sample of all points.
"""

import numpy as np

SEED = np.uint64(0x2011_7507_0000_0001)
MIX = tuple(
    np.uint64(word) for word in (0x9E3779B97F4A7C15, 0xBF58476D1CE4E5B9, 0x94D049BB133111EB)
)
PIECE = 1 << 16


class PointSample:
    """Sample of the added points, and the number of points added of each scan.

    Parameters
    ----------
    most : int
        Largest number of points in the sample.
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
        """Return the sample of both sets of points."""
        both = PointSample(self.most)
        both._xyz, both._key = self._xyz + other._xyz, self._key + other._key
        both._scan = self._scan + other._scan
        both.delivered = {
            scan: self.delivered.get(scan, 0) + other.delivered.get(scan, 0)
            for scan in self.delivered | other.delivered
        }
        return both

    def points(self):
        """Sampled points (k, 3), in the order of their numbers."""
        order = self._order()
        return self._xyz[0][order]

    def scans(self):
        """Scan (k,) of each point of `points`."""
        order = self._order()
        return self._scan[0][order]

    def _order(self):
        """Reduce the sample and return the order (k,) of the numbers."""
        self.reduce()
        return np.lexsort((*self._xyz[0].T, self._key[0]))

    def reduce(self):
        """Discard points that do not belong to the sample."""
        xyz, key, scan = np.vstack(self._xyz), *map(np.concatenate, (self._key, self._scan))
        if len(key) > self.most:
            best = np.argpartition(key, self.most - 1)[: self.most]
            xyz, key, scan = xyz[best], key[best], scan[best]
            self._limit = key.max()
        self._xyz, self._key, self._scan, self._waiting = [xyz], [key], [scan], 0


def _hash(xyz_m, scan):
    """Numbers (n,) of points, from splitmix64 over the bits of x, y and z."""
    bits = np.ascontiguousarray(xyz_m, dtype=float).view(np.uint64).reshape(-1, 3).T
    number = np.full(bits.shape[1], SEED ^ np.uint64(scan), dtype=np.uint64)
    for word in bits:
        number = (number ^ word) * MIX[0]
        number = (number ^ (number >> np.uint64(30))) * MIX[1]
        number = (number ^ (number >> np.uint64(27))) * MIX[2]
        number ^= number >> np.uint64(31)
    return number
