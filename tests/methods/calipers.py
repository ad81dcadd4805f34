"""A method of another distribution: diameters of a sphere by caliper, the same all round.

It is the smallest method that computes a table. Its entry point is in `calipers.dist-info`.
"""

from dataclasses import dataclass

from tankcal.methods.base import Method


class CalipersMethod(Method):
    """Inside diameters of a sphere by caliper."""

    name = "calipers"
    kinds = ("sphere",)
    tables = ("calipers",)

    def columns(self):
        from tankcal.job.fields import positive

        diameter = positive("diameter_m", "inside diameter, metres", 100, required=True)
        sd = positive("s_mm", "standard deviation of the reading, millimetres", 100, required=True)
        return {"calipers": (diameter, sd)}

    def useless_inputs(self, values, tables):
        return {"diameter": "its uncertainty comes from the calipers"}

    def read(self, values, tables, registers, raw):
        table = tables["calipers"]
        return table.numbers("diameter_m"), table.numbers("s_mm") / 1000

    def find(self, job, progress, network):
        from tankcal.pipeline.surveying import Surveyed

        diameters, sds = job.surveys["calipers"]
        sd_of_mean = float((sds**2).sum() ** 0.5 / len(sds))
        return Surveyed(job, MeasuredSphere(float(diameters.mean()), sd_of_mean))

    def solid_part(self, survey, plate_m, scale):
        import numpy as np

        from tankcal.tank.budgets import Factor
        from tankcal.tank.solids import Sphere

        factor = Factor("calipers", np.array([[survey.sd_m]]))
        arguments = {"surveyed": ("diameter",), "factors": (factor,)}
        return Sphere(survey.diameter_m * scale), arguments, ("offset",)

    def warnings(self, job, survey, sights=None):
        from tankcal.errors import Problem
        from tankcal.messages import message

        if len(job.surveys["calipers"][0]) < 2:
            yield Problem("calipers.csv", message("_one_diameter", "only a single diameter"))


@dataclass(frozen=True)
class MeasuredSphere:
    """Sphere from its mean diameter."""

    diameter_m: float
    sd_m: float
    surveyed_as = "calipers"
