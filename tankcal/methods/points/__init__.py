"""Points of the wall: as given, or from the adjustment of a network."""

from typing import ClassVar

from tankcal.methods.base import Import, Method


class PointsMethod(Method):
    """Surveyed points, to which the wall of a tank is fitted."""

    name = "points"
    attribute = "points"
    kinds = ("vertical", "horizontal", "sphere")
    tables = ("points",)
    archives = ("points_cov.npz",)

    # ---- job

    def columns(self):
        from tankcal.methods.points.columns import POINTS

        return {"points": POINTS}

    table_notes: ClassVar = {"points": "one row for each surveyed point of the wall"}

    examples = Import("tankcal.methods.points.columns:EXAMPLES")

    def check(self, values, tables, registers, raw, log):
        from tankcal.methods.points.readings import check_points_of

        check_points_of(values, tables, raw, log)

    def read(self, values, tables, registers, raw):
        from tankcal.methods.points.readings import make_points

        return make_points(tables, raw)

    # ---- pipeline

    def find(self, job, progress, network):
        from tankcal.pipeline.surveying import Surveyed

        if job.tank.kind == "vertical":
            from tankcal.pipeline.wall.finding import find_wall

            return Surveyed(job, find_wall(job, progress, network.dof, network.amplitudes))
        from tankcal.messages import message
        from tankcal.pipeline.scanned_solids import fit_scan

        count = len(job.points.names)
        progress(message("fitting_wall", "fitting the wall to {count} points", count=count))
        return Surveyed(job, fit_scan(job, network.dof))
