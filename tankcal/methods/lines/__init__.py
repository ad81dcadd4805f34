"""Reference lines: offsets of the wall from vertical lines of sight, beside straps or points."""

from typing import ClassVar

from tankcal.methods.base import Delegate, Import, Method


class LinesMethod(Method):
    """Offsets from reference lines, which transfer a strapped or surveyed radius to other courses.

    The wall is that of the straps or points beside the lines.
    """

    name = "lines"
    attribute = "lines"
    kinds = ("vertical",)
    tables = ("lines", "offsets")
    shared_tables = ("circumferences", "obstructions", "thickness", "tape_checks")
    starter = "reference-line"
    starter_has_network = False
    tables_with_sds = ("offsets",)
    accompanies_points = True
    field_forms = ((("lines",), 12), (("offsets",), 30))
    kind_of_readings = "offsets"
    csv_files = ("offsets.csv",)
    saved_note = "reference lines; left out if there are none"

    # ---- job

    columns = Import("tankcal.methods.lines.columns:COLUMNS")
    settings = Import("tankcal.methods.strapping.columns:KEYS")

    def starter_settings(self, kind):
        return {"survey.side": "outside", "datum.bottom_z_m": "0.0"}

    table_notes: ClassVar = {
        "lines": "one row for each vertical line of sight round the tank",
        "offsets": "one row for each reading of the wall's offset; repeated readings are"
        " repeated rows",
    }

    examples = Import("tankcal.methods.lines.columns:EXAMPLES")

    def is_given(self, tables):
        from tankcal.job.checking import has_rows

        return any(has_rows(tables[name]) for name in self.tables)

    def check(self, values, tables, registers, raw, log):
        if self.is_given(tables):
            from tankcal.methods.lines.readings import check_lines

            check_lines(values, tables, registers, raw, log)

    def read(self, values, tables, registers, raw):
        from tankcal.methods.lines.readings import make_lines

        return make_lines(tables, registers)

    # ---- known walls

    observe = Delegate("tankcal.methods.lines.observed:observe_offsets")

    def levels_read(self, job):
        return {(offset.course, offset.level_m) for offset in job.lines.offsets}

    def courses_of_readings(self, job):
        return [offset.course for offset in job.lines.offsets]

    def instruments_in_use(self, job):
        return {line.instrument for line in job.lines.lines.values()}

    def detectable_m(self, job, wall, sights):
        from tankcal.pipeline.read_wall import detectable_m

        return detectable_m(wall, "offsets")

    # ---- pipeline

    def finds(self, job):
        return False

    def courses_read(self, job):
        return {offset.course for offset in job.lines.offsets if not offset.check}

    warnings = Delegate("tankcal.methods.lines.warnings:check_lines")

    # ---- record

    saved_type = Import("tankcal.methods.lines.saved:LinesRecord")

    def is_saved(self, result):
        return result.job.lines is not None

    save = Delegate("tankcal.methods.lines.saved:save_lines")

    def choices(self, result):
        if result.strapped is None:
            return {"lines": "beside_points"}
        wall = {"between_sections": "revolution", "tilt": "not_applied"}
        return {"survey": "reference_line", **wall}

    # ---- report

    report_tables = Import("tankcal.methods.lines.saved")

    def csv_tables(self, record):
        return {"offsets": self.report_tables().OFFSETS}

    def sheets(self, record):
        declared = self.report_tables()
        tables = (declared.LEVELS, declared.PLUMMETS, declared.LINES, declared.OFFSETS)
        return [("lines", "lines_subtitle", [(table.name, table) for table in tables])]

    def certificates(self, saved):
        return {
            entry["plummet"]: entry["certificate"]
            for entry in saved["plummets"]
            if entry["plummet"]  # None: the job does not describe the plummet
        }
