"""Capacity tables as other laboratories hand them out, made without the formulas that read them.

The head is integrated numerically for each dip: at every node of every ring the loaded radius is
looked up, squared, and summed. A dished bottom and things in the tank are summed in the same way.
"""

from dataclasses import dataclass, replace

import numpy as np

from tankcal.products.recalibration.former import FormerTable

GRAVITY, STEEL = 9.80665, 206e9
NODES, WEIGHTS = np.polynomial.legendre.leggauss(8)


@dataclass(frozen=True)
class SimulatedTank:
    """An upright tank; dips count from the dip plate, `zero_m` below which the rings begin."""

    radii_m: np.ndarray
    heights_m: np.ndarray
    thickness_m: np.ndarray
    density_kg_m3: float
    zero_m: float = 0.0
    deadwood: tuple = ()  # (bottom, top, volume), dips; negative volumes reduce
    cone_m: float = 0.0  # rise of the bottom towards its centre
    bulge_m: float = 0.0  # middle of each course against its joints: a parabola of mean radius_m

    @property
    def top_m(self):
        return self.zero_m + float(np.sum(self.heights_m))

    def volume_m3(self, dips_m):
        """(rows,) volume below each dip."""
        return np.array([self._below(float(dip)) for dip in dips_m])

    def _below(self, dip):
        total = 0.0
        bottom = self.zero_m
        for r, height, plate in zip(self.radii_m, self.heights_m, self.thickness_m, strict=True):
            end = min(dip, bottom + height)
            if end > bottom:
                z = bottom + (end - bottom) * (1 + NODES) / 2
                hoop_stress = self.density_kg_m3 * GRAVITY * (dip - z) * r / plate
                parabola = 1 / 3 - (2 * (z - bottom) / height - 1) ** 2
                loaded = r * (1 + hoop_stress / STEEL) + self.bulge_m * parabola
                total += np.pi * (WEIGHTS @ loaded**2) * (end - bottom) / 2
            bottom += height
        for low, high, volume in self.deadwood:
            total += volume * min(max((dip - low) / (high - low), 0.0), 1.0)
        return max(total - self._cone_below(dip - self.zero_m), 0.0)

    def _cone_below(self, level):
        if self.cone_m <= 0 or level <= 0:
            return 0.0
        area = np.pi * self.radii_m[0] ** 2
        part = min(level / self.cone_m, 1.0)  # slices of area (1 - z / rise)^2
        return area * self.cone_m / 3 * (1 - (1 - part) ** 3)


def table_of(tank, step_m=0.01, quantum_m3=0.001, first_m=0.0, last_m=None, **declared):
    """The FormerTable of a tank, rounded."""
    last = np.floor(tank.top_m / step_m + 1e-6) * step_m if last_m is None else last_m
    dips = first_m + step_m * np.arange(round((last - first_m) / step_m) + 1)
    volumes = np.round(tank.volume_m3(dips) / quantum_m3) * quantum_m3
    quantum = 10.0 ** -next(
        n for n in range(9) if abs(step_m * 10**n - round(step_m * 10**n)) < 1e-9
    )
    return FormerTable("old.csv", dips, volumes, quantum, quantum_m3, **declared)


def with_proportional_parts(table, parts):
    """The table with the rows between each `parts`-th row interpolated, and rounded again."""
    computed = np.arange(0, len(table.height_m), parts)
    dips = table.height_m[: computed[-1] + 1]
    volumes = np.interp(dips, dips[computed], table.volume_m3[computed])
    quantum = table.volume_quantum_m3
    return replace(table, height_m=dips, volume_m3=np.round(volumes / quantum) * quantum)


def draw_tank(random, *, density=None, shift=True, deadwood=True, bottom=True):
    """A tank of 3 to 9 rings, 12 to 40 m wide, as it is drawn by `random`."""
    count = int(random.integers(3, 10))
    heights = np.round(random.uniform(1.2, 2.5, count), 3)
    radius = random.uniform(6.0, 20.0)
    depth = np.cumsum(heights[::-1])[::-1]
    plates = np.ceil(2 * np.maximum(1000 * depth * 8 * radius / 150e3, 2.5)) / 2 / 1000
    plates = np.maximum(plates, 0.005)
    radii = radius - plates + random.normal(0, 0.002, count)
    zero = float(np.round(random.uniform(-0.05, 0.05), 4)) if shift else 0.0
    things = []
    if deadwood:
        for _ in range(int(random.integers(0, 4))):
            low = random.uniform(0.3, depth[0] - 1.0)
            high = low + random.uniform(0.1, 0.8)
            things.append((low, high, float(-random.uniform(0.02, 0.4))))
    return SimulatedTank(
        radii,
        heights,
        plates,
        float(random.uniform(600, 1000)) if density is None else density,
        zero_m=zero,
        deadwood=tuple(things),
        cone_m=float(random.uniform(0, 0.012) * radius)
        if bottom and random.random() < 0.5
        else 0.0,
    )
