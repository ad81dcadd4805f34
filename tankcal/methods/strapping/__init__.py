"""Strapping: circumferences by tape of an upright tank, alone or beside points of its wall."""

from typing import ClassVar

from tankcal.messages import message
from tankcal.methods.base import Delegate, Import, Method


class StrappingMethod(Method):
    """Circumferences of the courses of an upright tank, or of the rings of a horizontal tank.

    The method "rings" finds the wall of a horizontal tank from these readings.
    """

    name = "strapping"
    attribute = "strapping"
    kinds = ("vertical", "horizontal")
    tables = ("circumferences", "obstructions", "thickness", "tape_checks")
    starter = "strapping"
    starter_has_network = False
    tables_with_sds = ("circumferences",)
    replaces_points = True
    accompanies_points = True
    measures_size = True
    compares_size = True
    comes_last = True
    field_forms = (
        (("circumferences",), 15),
        (("obstructions",), 9),
        (("thickness",), 8),
        (("tape_checks",), 4),
    )
    kind_of_readings = "straps"
    csv_files = ("strapping.csv",)
    saved_note = "circumferences by tape; left out if there are none"

    # ---- job

    columns = Import("tankcal.methods.strapping.columns:COLUMNS")
    settings = Import("tankcal.methods.strapping.columns:KEYS")

    def starter_settings(self, kind):
        return {"survey.side": "outside", "datum.bottom_z_m": "0.0"}

    section_notes: ClassVar = {
        "shell": "how far the wall is from a circle",
        "strapping": "how the tape lay",
    }

    table_notes: ClassVar = {
        "circumferences": "one row for each reading of the tape round the tank",
        "obstructions": "one row for each kind of obstacle on the way of a circumference; may"
        " stay empty",
        "thickness": "one row for each reading of a gauge of plates; may stay empty",
        "tape_checks": "one row for each comparison of the working tape with its master; may"
        " stay empty",
    }

    setting_examples = Import("tankcal.methods.strapping.columns:SETTING_EXAMPLES")
    examples = Import("tankcal.methods.strapping.columns:EXAMPLES")

    no_rows = message(
        "no_circumferences", "no rows; expected a reading of the tape on each course at least"
    )

    def check(self, values, tables, registers, raw, log):
        from tankcal.job.entries import kind_of
        from tankcal.methods.strapping.readings import check_strapping

        if kind_of(raw) == "vertical":
            check_strapping(values, tables, registers, raw, log)

    def read(self, values, tables, registers, raw):
        from tankcal.methods.strapping.readings import make_strapping

        return make_strapping(values, tables, registers)

    # ---- known walls

    observe = Delegate("tankcal.methods.strapping.readings:observe_straps")

    def levels_read(self, job):
        return {(strap.course, strap.level_m) for strap in job.strapping.straps}

    def courses_of_readings(self, job):
        return [strap.course for strap in job.strapping.straps]

    def instruments_in_use(self, job):
        read = {strap.tape for strap in job.strapping.straps}
        return read | {tape.master for tape in job.strapping.tapes if tape.name in read}

    def detectable_m(self, job, wall, sights):
        from tankcal.pipeline.read_wall import detectable_m

        return detectable_m(wall, "straps")

    # ---- pipeline

    def finds(self, job):
        return job.tank.kind == "vertical" and job.points is None

    def find(self, job, progress, network):
        from tankcal.methods.strapping.wall import find_strapped_wall
        from tankcal.pipeline.surveying import Surveyed

        return Surveyed(job, find_strapped_wall(job, progress, network.amplitudes))

    def courses_read(self, job):
        return {strap.course for strap in job.strapping.straps if not strap.check}

    inside_radii = Delegate("tankcal.methods.strapping.wall:inside_radii")
    warnings = Delegate("tankcal.methods.strapping.warnings:check_strapping")

    # ---- record

    saved_type = Import("tankcal.methods.strapping.saved:StrappingRecord")

    def is_saved(self, result):
        return result.straps is not None

    save = Delegate("tankcal.methods.strapping.saved:save_strapping")
    choices = Delegate("tankcal.methods.strapping.saved:choices_of")

    # ---- report

    report_tables = Import("tankcal.methods.strapping.saved")

    def csv_tables(self, record):
        return {"strapping": self.report_tables().straps_of(record)}

    def sheets(self, record):
        declared = self.report_tables()
        tables = (
            declared.straps_of(record),
            declared.strapped_courses_of(record),
            declared.TAPES,
        )
        return [("strapping", "strapping_subtitle", [(table.name, table) for table in tables])]

    def certificates(self, saved):
        return self.report_tables().certificates_of_tapes(saved["tapes"])
