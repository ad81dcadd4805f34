"""Shell of courses with a head on top: a dome or a cone that liquid may enter.

The edge of the head is the top of the last course, and its plan is the area there. The uncertainty
of that area thus also affects the head: the volume of the head is a linear function of the features
of the shell. Liquid above the shell does not change the volume of the shell.
"""

from dataclasses import dataclass

import numpy as np

from tankcal.errors import HeightError
from tankcal.messages import message
from tankcal.tank.body import ShellPart
from tankcal.tank.parts import Part, as_levels
from tankcal.tank.tips import Tip

ROUNDING = 1e-12  # relative excess of a level above the tip due to rounding
MOVED_BY_HEIGHT = ("shell_temperature", "expansion")  # inputs that stretch heights


@dataclass(frozen=True)
class HeadedShell(Part):
    """Shell of courses and its head as a single part, both at the temperature of the table.

    Attributes
    ----------
    shell : ShellPart
    tip : Tip
        Head over the area of the last course at its top, with dimensions stretched like heights.
    """

    shell: ShellPart
    tip: Tip

    @property
    def base_m(self):
        """Level of the edge of the head."""
        return self.shell.volume.height_m

    @property
    def highest_m(self):
        """Level of the tip of the head."""
        return self.base_m + self.tip.depth_m

    @property
    def breakpoints_m(self):
        """Bottoms of the courses, and the edge of the head."""
        return (*self.shell.breakpoints_m, self.base_m)

    def volume_m3(self, levels_m):
        """Return the volume (rows,) of shell and head below each level."""
        shell_levels, x = self._split(levels_m)
        return self.shell.volume_m3(shell_levels) + self.tip.beyond_m3(0.0) - self.tip.beyond_m3(x)

    def area_m2(self, levels_m):
        """Return the inside area (rows,) at each level; at the edge, the area of the head."""
        shell_levels, x = self._split(levels_m)
        in_head = as_levels(levels_m) >= self.base_m
        return np.where(in_head, self.tip.area_m2(x), self.shell.area_m2(shell_levels))

    def derivatives(self, levels_m):
        """Return {input: (rows,)} of the shell, of the plan of the head, and of its dimensions.

        "top_depth" raises the tip over its edge. "dish" and "knuckle" are the radii of a
        torispherical head, if given. A higher course raises the whole head.
        """
        shell_levels, x = self._split(levels_m)
        in_head, cut_m2 = as_levels(levels_m) >= self.base_m, self.tip.area_m2(x)
        derivatives = self.shell.derivatives(shell_levels)
        plan, by_tip = self.tip.plan_m2, self._tip_derivatives(x)
        # The plan grows with the square of its scale.
        by_plan = by_tip.pop("scale") / (2 * plan)
        for name, by_input in self._plan_by().items():
            if name in derivatives:
                derivatives[name] = derivatives[name] + by_plan * by_input
        # Raising the head adds a cylinder over the plan, and removes the cut at the level.
        by_lift = np.where(in_head, plan - cut_m2, 0.0)
        if "datum" in derivatives:
            derivatives["datum"] = np.where(in_head, cut_m2, derivatives["datum"])
        if "course_heights" in derivatives:
            derivatives["course_heights"] = derivatives["course_heights"] + by_lift[:, None]
        if self.shell.stretch != 1.0:
            # A stretch of heights changes the dimensions of the head, and the level of its edge.
            by_heights = sum(
                self.tip.sizes_m[name] * derivative for name, derivative in by_tip.items()
            )
            by_stretch = (by_heights + by_lift * self.base_m) / self.shell.stretch
            for name in MOVED_BY_HEIGHT:
                if name in derivatives:
                    derivatives[name] = derivatives[name] + self._thermal_growth(name) * by_stretch
        derivatives |= {
            "top_depth" if name == "depth" else name: derivative
            for name, derivative in by_tip.items()
        }
        return derivatives

    def sources(self, levels_m):
        """Return the sources of the survey, for the shell and the plan of the head."""
        factors = self.shell.factors
        if not factors:
            return ()
        shell_levels, x = self._split(levels_m)
        by_plan = self._tip_derivatives(x)["scale"] / (2 * self.tip.plan_m2)
        weights = self.shell.volume.top_weights
        return tuple(
            factor.source(source.columns_m3 + by_plan[:, None] * (weights @ factor.columns))
            for factor, source in zip(factors, self.shell.sources(shell_levels), strict=True)
        )

    def _split(self, levels_m):
        """Return (levels in the shell, x in the head); raise HeightError above the tip."""
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

    def _tip_derivatives(self, x):
        """Return {input of the tip: derivative (rows,) of the volume of the head below x}."""
        complete, remaining = self.tip.derivatives(np.zeros(1)), self.tip.derivatives(x)
        return {name: complete[name] - remaining[name] for name in complete}

    def _plan_by(self):
        """Return {input: derivative of the plan of the head, m2 per SI unit}."""
        shell, volume = self.shell, self.shell.volume
        courses = volume.courses
        weights, scale = volume.top_weights, 2 * self.tip.plan_m2 / shell.scale
        girth = float(weights @ volume.girth_features)
        by_readings = {
            name: float(weights @ derivative) for name, derivative in shell.read_with.items()
        }
        departures = {
            name: sum(
                float(course_weights @ (course.girths_m * course.missed[name]))
                for course_weights, course in zip(
                    np.split(weights, len(courses)), courses, strict=True
                )
            )
            for name in volume.departures
        }
        derivatives = {
            "scale": float(weights @ volume.scale_features),
            "offset": girth,
            "tilt": self.tip.plan_m2 * shell.tilt / (1 + shell.tilt**2),
            "plate_thickness": -girth * shell.subtracts,
            "paint": -girth * shell.subtracts,
            **{name: self._thermal_growth(name) * scale for name in MOVED_BY_HEIGHT},
            **departures,
        }
        derivatives = {
            name: derivative
            for name, derivative in derivatives.items()
            if name in ("scale", "offset", "tilt", *shell.bearing, *departures)
        }
        for name, derivative in by_readings.items():
            derivatives[name] = derivatives.get(name, 0.0) + derivative
        return derivatives

    def _thermal_growth(self, name):
        """Return the growth of lengths by the temperature of the shell, or by its coefficient."""
        shell = self.shell
        if name == "shell_temperature":
            return -shell.expansion_per_k
        return (shell.scale - 1) / shell.expansion_per_k
