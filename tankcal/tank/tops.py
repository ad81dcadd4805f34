"""A shell of courses with a head on top of it: a dome or a cone that liquid may rise into.

The edge of the head is the top of the last course, and its plan the area there, so what is
uncertain about that area moves the head, too: all of it is one linear function of the features of
the shell. Liquid above the shell leaves the shell's own volume as it is.
"""

from dataclasses import dataclass

import numpy as np

from tankcal.errors import HeightError
from tankcal.messages import message
from tankcal.tank.body import ShellPart
from tankcal.tank.parts import Part, as_levels
from tankcal.tank.tips import Tip

ROUNDING = 1e-12  # of the height, by which a level may stand above the tip
MOVED_BY_HEIGHT = ("shell_temperature", "expansion")


@dataclass(frozen=True)
class HeadedShell(Part):
    """The shell of courses and the head on it as one part; both at the table's temperature.

    Attributes
    ----------
    shell : ShellPart
    tip : Tip
        Over the area of the last course at its top, its sizes stretched as heights are.
    """

    shell: ShellPart
    tip: Tip

    @property
    def base_m(self):
        """Level of the head's edge."""
        return self.shell.volume.height_m

    @property
    def highest_m(self):
        """Level of the head's tip."""
        return self.base_m + self.tip.depth_m

    @property
    def breakpoints_m(self):
        """Bottoms of the courses, and the edge of the head."""
        return (*self.shell.breakpoints_m, self.base_m)

    def volume_m3(self, levels_m):
        """(rows,) volume of shell and head below each level."""
        below, x = self._split(levels_m)
        return self.shell.volume_m3(below) + self.tip.beyond_m3(0.0) - self.tip.beyond_m3(x)

    def area_m2(self, levels_m):
        """(rows,) inside area at each level; that of the head at its edge."""
        below, x = self._split(levels_m)
        over = as_levels(levels_m) >= self.base_m
        return np.where(over, self.tip.area_m2(x), self.shell.area_m2(below))

    def derivatives(self, levels_m):
        """{input: (rows,)} those of the shell, of the plan of the head, and of its sizes.

        "top_depth" lifts the tip over its edge; "dish" and "knuckle" are those of a
        torispherical head that was given by them. A higher course lifts the whole head.
        """
        below, x = self._split(levels_m)
        over, cut = as_levels(levels_m) >= self.base_m, self.tip.area_m2(x)
        found = self.shell.derivatives(below)
        plan, of_tip = self.tip.plan_m2, self._of_tip(x)
        by_plan = of_tip.pop("scale") / (2 * plan)
        for name, by_input in self._plan_by().items():
            if name in found:
                found[name] = found[name] + by_plan * by_input
        lifted = np.where(over, plan - cut, 0.0)
        if "datum" in found:
            found["datum"] = np.where(over, cut, found["datum"])
        if "course_heights" in found:
            found["course_heights"] = found["course_heights"] + lifted[:, None]
        if self.shell.stretch != 1.0:
            by_heights = sum(self.tip.sizes_m[name] * by for name, by in of_tip.items())
            by_stretch = (by_heights + lifted * self.base_m) / self.shell.stretch
            for name in MOVED_BY_HEIGHT:
                if name in found:
                    found[name] = found[name] + self._warmed_by(name) * by_stretch
        found |= {"top_depth" if name == "depth" else name: by for name, by in of_tip.items()}
        return found

    def sources(self, levels_m):
        """What the survey leaves uncertain: of the shell, and of the plan of the head with it."""
        factors = self.shell.factors
        if not factors:
            return ()
        below, x = self._split(levels_m)
        by_plan = self._of_tip(x)["scale"] / (2 * self.tip.plan_m2)
        weights = self.shell.volume.top_weights
        return tuple(
            one.source(source.columns_m3 + by_plan[:, None] * (weights @ one.columns))
            for one, source in zip(factors, self.shell.sources(below), strict=True)
        )

    def _split(self, levels_m):
        """(levels in the shell, x in the head); raises HeightError above the tip."""
        levels = as_levels(levels_m)
        above = levels > self.highest_m * (1 + ROUNDING)
        if np.any(above):
            raise HeightError(
                message(
                    "level_above_head",
                    "level {level_m:g} m is above the head on the shell ({top_m:g} m)",
                    level_m=levels[above][0],
                    top_m=self.highest_m,
                )
            )
        x = np.clip(levels - self.base_m, 0.0, self.tip.depth_m)
        return np.minimum(levels, self.base_m), x

    def _of_tip(self, x):
        """{input of the tip: (rows,)} of the head's volume below x."""
        whole, beyond = self.tip.derivatives(np.zeros(1)), self.tip.derivatives(x)
        return {name: whole[name] - beyond[name] for name in whole}

    def _plan_by(self):
        """{input: derivative of the plan of the head by it, m2 per SI unit}."""
        shell, volume = self.shell, self.shell.volume
        courses = volume.courses
        weights, scale = volume.top_weights, 2 * self.tip.plan_m2 / shell.scale
        girth = float(weights @ volume.girth_features)
        of_readings = {name: float(weights @ by) for name, by in shell.read_with.items()}
        departures = {
            name: sum(
                float(own @ (one.girths_m * one.missed[name]))
                for own, one in zip(np.split(weights, len(courses)), courses, strict=True)
            )
            for name in volume.departures
        }
        found = {
            "scale": float(weights @ volume.scale_features),
            "offset": girth,
            "tilt": self.tip.plan_m2 * shell.tilt / (1 + shell.tilt**2),
            "plate_thickness": -girth * shell.subtracts,
            "paint": -girth * shell.subtracts,
            **{name: self._warmed_by(name) * scale for name in MOVED_BY_HEIGHT},
            **departures,
        }
        found = {
            name: by
            for name, by in found.items()
            if name in ("scale", "offset", "tilt", *shell.bearing, *departures)
        }
        for name, by in of_readings.items():
            found[name] = found.get(name, 0.0) + by
        return found

    def _warmed_by(self, name):
        """Growth of lengths by the temperature of the shell, or by its coefficient."""
        shell = self.shell
        if name == "shell_temperature":
            return -shell.expansion_per_k
        return (shell.scale - 1) / shell.expansion_per_k
