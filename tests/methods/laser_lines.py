"""A method of another distribution: offsets of an upright wall from vertical laser lines.

Each line is at a known place outside the tank. The offsets become points of the wall, and the
wall, the volumes and all documents follow from the points and their covariance.
"""

from dataclasses import replace

import numpy as np

from tankcal.methods.base import Method


class LaserLinesMethod(Method):
    """Offsets from vertical lines of a laser outside of an upright tank."""

    name = "laser_lines"
    kinds = ("vertical",)
    tables = ("laser_lines",)
    replaces_points = True
    is_sighted = True  # `find` returns a job with points
    has_means = True  # the points are not single sights of an instrument

    def columns(self):
        from tankcal.job.fields import number, positive

        return {
            "laser_lines": (
                number("azimuth_deg", "direction of the line", -360, 360, required=True),
                positive("distance_m", "from the axis to the line", 100, required=True),
                positive("height_m", "above the origin", 100, required=True),
                positive("offset_mm", "from the line to the wall", 5000, required=True),
                positive("s_mm", "standard deviation of an offset", 100, required=True),
                number("u_bracket_mm", "common to all offsets", 0, 100, required=True),
            )
        }

    def read(self, values, tables, registers, raw):
        table = tables["laser_lines"]
        return {field.name: table.numbers(field.name) for field in self.columns()["laser_lines"]}

    def find(self, job, progress, network):
        from tankcal.pipeline.surveying import Surveyed
        from tankcal.pipeline.wall.finding import find_wall
        from tankcal.survey.points import Points

        rows = job.surveys["laser_lines"]
        azimuth, count = np.radians(rows["azimuth_deg"]), len(rows["s_mm"])
        outwards = np.stack([np.cos(azimuth), np.sin(azimuth), 0 * azimuth], axis=1)
        xyz = (rows["distance_m"] - rows["offset_mm"] / 1000)[:, None] * outwards
        xyz[:, 2] = rows["height_m"]
        # Independent errors of the offsets, and the bracket, which moves all points radially.
        common = (rows["u_bracket_mm"][:, None] / 1000 * outwards).ravel()
        covariance = np.diag(np.repeat((rows["s_mm"] / 1000) ** 2, 3)) + np.outer(common, common)
        names, blank = tuple(f"P{place}" for place in range(count)), (None,) * count
        points = Points(
            names, xyz, None, covariance, blank, blank, tuple(range(2, count + 2)),
            from_adjustment=True, file="laser_lines.csv",
        )  # fmt: skip
        job = replace(job, points=points)
        wall = find_wall(job, progress, network.dof, network.amplitudes)
        return Surveyed(job, wall, sights={self.name: points})
