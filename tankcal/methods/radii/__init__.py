"""Radii of the courses by a former table, a record or a declaration, alone or with a survey."""

from typing import ClassVar

from tankcal.messages import message
from tankcal.methods.base import Delegate, Import, Method


class RadiiMethod(Method):
    """Former radii of the courses; a survey of some courses updates them."""

    name = "radii"
    attribute = "radii"
    kinds = ("vertical",)
    tables = ("radii",)
    archives = ("radii_cov.npz",)
    starter = "radii"
    starter_registers = ()
    starter_has_network = False
    replaces_points = True
    completes_survey = True
    is_inside = True
    saved_note = "radii of a former table; left out if there are none"

    # ---- job

    columns = Import("tankcal.methods.radii.columns:COLUMNS")
    settings = Import("tankcal.methods.radii.columns:KEYS")

    def starter_settings(self, kind):
        return {"survey.side": "inside", "datum.bottom_z_m": "0.0"}

    section_notes: ClassVar = {
        "radii": "the radii of radii.csv: where they come from, and how well they are known",
        "change": "only beside a new survey of some courses: how far the radii may have"
        " changed since",
    }

    table_notes: ClassVar = {
        "radii": "one row for each course, with its radius as a former table or a record has it"
    }

    setting_examples = Import("tankcal.methods.radii.columns:SETTING_EXAMPLES")

    def examples(self):
        from tankcal.methods.radii.columns import EXAMPLES

        return {"radii": list(EXAMPLES)}

    no_rows = message("no_rows_of_radii", "no rows; expected the radius of each course")

    def check(self, values, tables, registers, raw, log):
        from tankcal.methods.radii.readings import check_radii

        check_radii(values, tables, raw, log)

    useless_inputs = Delegate("tankcal.methods.radii.readings:useless_inputs")

    def read(self, values, tables, registers, raw):
        from tankcal.methods.radii.readings import make_radii

        return make_radii(values, tables, raw)

    # ---- pipeline

    def finds(self, job):
        return job.points is None

    def find(self, job, progress, network):
        from tankcal.methods.radii.wall import find_radii_wall
        from tankcal.pipeline.surveying import Surveyed

        return Surveyed(job, find_radii_wall(job, progress))

    complete = Delegate("tankcal.methods.radii.wall:update_by_survey")

    def former_radii_m(self, job):
        import numpy as np

        nominal_m = job.tank.nominal_diameter_m / 2
        return np.where(job.radii.is_known, job.radii.radius_m, nominal_m)

    job_as_surveyed = Delegate("tankcal.methods.radii.wall:job_as_declared")

    def inside_radii(self, job, survey):
        from tankcal.pipeline.checks.size import radii_of_courses

        return radii_of_courses(job, survey.radius_m)

    # ---- record

    saved_type = Import("tankcal.methods.radii.saved:RadiiRecord")
    save = Delegate("tankcal.methods.radii.saved:save_radii")
    choices = Delegate("tankcal.methods.radii.saved:choices_of")

    # ---- report

    report_tables = Import("tankcal.methods.radii.saved")
    report_figures = Import("tankcal.methods.radii.saved")

    def sheets(self, record):
        return [("radii", "radii_subtitle", [("radii", self.report_tables().RADII)])]
