"""Strapping of a sphere: equator and meridians by tape, and the ellipsoid that they determine."""

from typing import ClassVar

from tankcal.methods.base import Delegate, Import, Method


class GreatCirclesMethod(Method):
    """Great circles of a sphere, measured by tape."""

    name = "great_circles"
    kinds = ("sphere",)
    tables = ("great_circles",)
    shared_tables = ("obstructions", "tape_checks")
    starter = "strapping"
    tables_with_sds = ("great_circles",)
    compares_size = True
    field_forms = ((("great_circles",), 15),)
    csv_files = ("great_circles.csv",)
    saved_note = "strapped sphere; left out where there is none"

    # ---- job

    def columns(self):
        from tankcal.methods.great_circles.columns import GREAT_CIRCLES

        return {"great_circles": GREAT_CIRCLES}

    def starter_settings(self, kind):
        return {"survey.side": "outside"}

    table_notes: ClassVar = {
        "great_circles": "one row for each reading of the tape round the sphere: equator and"
        " meridians"
    }

    def examples(self):
        from tankcal.methods.great_circles.columns import EXAMPLES

        return {"great_circles": list(EXAMPLES)}

    def check(self, values, tables, registers, raw, log):
        from tankcal.methods.great_circles.readings import check_great_circles

        check_great_circles(values, tables, registers, raw, log, is_given=self.is_given(tables))

    def useless_inputs(self, values, tables):
        from tankcal.messages import message

        reason = message("from_circles", "its uncertainty comes from the great circles")
        return {"diameter": reason}

    def estimate_diameter_m(self, tables):
        from tankcal.methods.great_circles.readings import estimate_diameter_m

        return estimate_diameter_m(tables["great_circles"])

    def read(self, values, tables, registers, raw):
        from tankcal.methods.great_circles.readings import make_great_circles

        return make_great_circles(tables, registers)

    # ---- pipeline

    def find(self, job, progress, network):
        from tankcal.methods.great_circles.sphere import find_strapped_sphere
        from tankcal.pipeline.surveying import Surveyed

        return Surveyed(job, find_strapped_sphere(job, progress))

    inside_radii = Delegate("tankcal.methods.great_circles.sphere:inside_radii")

    def solid_part(self, survey, plate_m, scale):
        return survey.solid(plate_m, scale), survey.arguments_of_part(plate_m, scale), ("offset",)

    warnings = Delegate("tankcal.methods.great_circles.sphere:check_circles")

    # ---- record

    saved_type = Import("tankcal.methods.great_circles.saved:GreatCirclesRecord")
    save = Delegate("tankcal.methods.great_circles.saved:save_great_circles")

    def choices(self, result):
        return {"survey": "great_circles", "between_sections": "ellipsoid"}

    sizes = Delegate("tankcal.methods.great_circles.saved:sizes_inside")

    # ---- report

    report_tables = Import("tankcal.methods.great_circles.saved")

    def csv_tables(self, record):
        return {"great_circles": self.report_tables().CIRCLES}

    def sheets(self, record):
        declared = self.report_tables()
        tables = [("great_circles", declared.CIRCLES), ("tapes", declared.TAPES_OF_SPHERE)]
        return [("great_circles", "great_circles_subtitle", tables)]

    def certificates(self, saved):
        from tankcal.methods.strapping.saved import certificates_of_tapes

        return certificates_of_tapes(saved["tapes"])
