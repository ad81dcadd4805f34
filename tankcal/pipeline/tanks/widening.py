"""A bottom whose plan is the shell's own: what widens the shell widens it, too."""

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Widened:
    """Another part with derivatives by what widens the shell.

    part   with a derivative by "scale"
    rates  {input: relative growth of the shell's lengths by SI unit of the input}
    """

    part: object
    rates: dict

    @property
    def lowest_m(self):
        """Level at which the tank is empty."""
        return self.part.lowest_m

    def volume_m3(self, levels_m):
        """(rows,) that of the part."""
        return self.part.volume_m3(levels_m)

    def area_m2(self, levels_m):
        """(rows,) that of the part."""
        return self.part.area_m2(levels_m)

    def derivatives(self, levels_m):
        """{input: (rows,)} those of the part, and by each rate that by its scale."""
        found = self.part.derivatives(levels_m)
        return found | {name: rate * found["scale"] for name, rate in self.rates.items()}

    def sources(self, levels_m):
        """Those of the part."""
        return self.part.sources(levels_m)


def widened(part, shell):
    """`Widened` bottom of a `body.ShellPart`, by its radius at the bottom."""
    radius = np.sqrt(shell.volume.area_m2([0.0])[0] / np.pi) / shell.scale
    rates = {
        "offset": 1 / radius,
        "plate_thickness": -1 / radius,
        "paint": -1 / radius,
        "shell_temperature": -shell.expansion_per_k / shell.scale,
        "expansion": (shell.scale - 1) / shell.expansion_per_k / shell.scale,
    }
    bearing = ("offset", *shell.bearing)
    return Widened(part, {name: rate for name, rate in rates.items() if name in bearing})
