"""Tangents: sights to both limbs of an upright tank, from a traverse round it."""

from typing import ClassVar

from tankcal.messages import message
from tankcal.methods.base import Delegate, Import, Method


class TangentsMethod(Method):
    """Sights to the limbs of a tank, which become points of its wall."""

    name = "tangents"
    attribute = "tangents"
    kinds = ("vertical",)
    tables = ("tangents",)
    shared_tables = (
        *("setups", "control", "directions", "zenith_angles", "slope_distances"),
        *("stadia", "circumferences", "obstructions"),
    )
    starter = "tangents"
    needs_station_heights = True
    tables_with_sds = ("tangents",)
    is_sighted = True
    names_levels = True
    is_smooth = True
    compares_size = True
    field_forms = ((("tangents",), 30),)
    kind_of_readings = "tangents"
    saved_note = "tangents from outside; left out where there are none"

    # ---- job

    def columns(self):
        from tankcal.methods.tangents.columns import TANGENTS

        return {"tangents": TANGENTS}

    def starter_settings(self, kind):
        return {"survey.side": "outside"}

    table_notes: ClassVar = {
        "tangents": "one row for each sight to a limb of the tank, from outside"
    }

    def examples(self):
        from tankcal.methods.tangents.columns import EXAMPLES

        return {"tangents": list(EXAMPLES)}

    no_rows = message("no_rows_of_tangents", "no rows; expected a sight to a limb in each")

    def check(self, values, tables, registers, raw, log):
        if self.is_given(tables):
            from tankcal.methods.tangents.readings import check_tangents

            check_tangents(values, tables, registers, raw, log)

    def read(self, values, tables, registers, raw):
        from tankcal.methods.tangents.readings import make_tangents

        return make_tangents(tables, registers)

    # ---- known walls

    observe = Delegate("tankcal.methods.tangents.observed:observe_tangents")

    def levels_read(self, job):
        tangents = job.tangents
        return set(zip(tangents.course, tangents.level_m.tolist(), strict=True))

    def courses_of_readings(self, job):
        return job.tangents.course

    def instruments_in_use(self, job):
        return set(job.tangents.instrument)

    def detectable_m(self, job, wall, sights):
        from tankcal.methods.moved_setups import judge_tangents

        return judge_tangents(job, wall, sights).mdb_m[~job.tangents.check]

    # ---- pipeline

    def find(self, job, progress, network):
        from tankcal.methods.tangents.wall import find_tangent_wall
        from tankcal.pipeline.surveying import Surveyed

        job_of_points, touching, wall = find_tangent_wall(
            job, network.adjustment, progress, network.dof, amplitudes=network.amplitudes
        )
        return Surveyed(job_of_points, wall, sights={"tangents": touching})

    warnings = Delegate("tankcal.methods.tangents.wall:check_tangents")

    # ---- record

    saved_type = Import("tankcal.methods.tangents.saved:TangentsRecord")
    save = Delegate("tankcal.methods.tangents.saved:save_tangents")

    def choices(self, result):
        return {"survey": "tangents", "covariance": "tangents"}

    # ---- report

    report_tables = Import("tankcal.methods.tangents.saved")

    def sheets(self, record):
        declared = self.report_tables()
        tables = (declared.SETUPS, declared.LEVELS, declared.READINGS)
        return [("tangents", "tangents_subtitle", [(table.name, table) for table in tables])]

    def certificates(self, saved):
        from tankcal.report.tables.table import certificates_of_setups

        return certificates_of_setups(saved["setups"])
