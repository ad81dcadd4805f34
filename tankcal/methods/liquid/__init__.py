"""Metered liquid: runs between dips, adjusted together with the geometry of the tank."""

from typing import ClassVar

from tankcal.messages import message
from tankcal.methods.base import Delegate, Import, Method


class LiquidMethod(Method):
    """Metered liquid, which supplements a survey or the drawing."""

    name = "liquid"
    attribute = "liquid"
    kinds = ("vertical", "horizontal", "sphere", "mesh")
    tables = ("liquid",)
    starter = "liquid"
    starter_registers = ("meters",)
    starter_has_network = False
    replaces_points = True
    is_supplement = True
    field_forms = ((("liquid",), 26),)
    field_facts = ("tank", "date", "crew", "weather", "calibrating_liquid", "dipped_by")
    csv_files = ("liquid_steps.csv",)
    hidden_sheets = ("liquid_steps",)
    saved_note = "metered runs; left out if there are none"

    # ---- job

    columns = Import("tankcal.methods.liquid.columns:COLUMNS")
    settings = Import("tankcal.methods.liquid.columns:KEYS")

    def register_fields(self):
        from tankcal.methods.liquid.columns import METER

        return {"meters": METER}

    def starter_settings(self, kind):
        from tankcal.methods.liquid.columns import STARTS

        return STARTS if kind == "vertical" else {}

    section_notes: ClassVar = {
        "liquid": "the liquid that was metered into the tank, and how well its dips were read"
    }

    table_notes: ClassVar = {
        "liquid": "one row for the start of each run, and one for each batch with the dip after it"
    }

    setting_examples = Import("tankcal.methods.liquid.columns:SETTING_EXAMPLES")
    examples = Import("tankcal.methods.liquid.columns:EXAMPLES")

    no_rows = message(
        "no_rows_of_liquid",
        "no rows; expected the start of each run, and a row for each batch and the dip after it",
    )

    def check(self, values, tables, registers, raw, log):
        from tankcal.methods.liquid.readings import check_liquid, tell_without_rows

        if not self.is_given(tables):
            tell_without_rows(tables, registers, raw, log)
            return
        check_liquid(values, tables, registers, raw, log)
        if values is not None:
            from tankcal.methods.liquid.readings import check_metering

            check_metering(values, tables, registers, raw, log)

    read = Delegate("tankcal.methods.liquid.readings:make_metering")

    # ---- pipeline

    def finds(self, job):
        return job.tank.kind == "vertical" and job.points is None

    def find(self, job, progress, network):
        from tankcal.pipeline.liquid import find_nominal_wall
        from tankcal.pipeline.surveying import Surveyed

        return Surveyed(job, find_nominal_wall(job, progress))

    def supplement(self, job, survey, progress):
        from tankcal.messages import message
        from tankcal.pipeline.liquid.measuring import measure_by_liquid

        progress(message("adjusting_liquid", "adjusting the runs by liquid with the geometry"))
        return measure_by_liquid(job, survey)

    warnings = Delegate("tankcal.methods.liquid.warnings:check_liquid")

    # ---- record

    saved_type = Import("tankcal.methods.liquid.saved:LiquidRecord")
    save = Delegate("tankcal.methods.liquid.saved:save_liquid")
    choices = Delegate("tankcal.methods.liquid.saved:choices_of")

    # ---- report

    report_tables = Import("tankcal.methods.liquid.tables")
    report_figures = Import("tankcal.methods.liquid.figures")
    facts = Import("tankcal.methods.liquid.tables:FACTS")
    unchecked = Delegate("tankcal.methods.liquid.tables:hidden_errors")
    field_blocks = Delegate("tankcal.methods.liquid.field_sheets:blocks_of_liquid")
    field_columns = Delegate("tankcal.methods.liquid.field_sheets:columns_of_batches")

    def csv_tables(self, record):
        return {"liquid_steps": self.report_tables().STEPS}

    def sheets(self, record):
        declared = self.report_tables()
        sheets = {
            "liquid": (declared.METERS, declared.RUNS, declared.SIZES, declared.CAUSES),
            "liquid_steps": (declared.STEPS, declared.DIPS, declared.volumes_table(record)),
        }
        return [
            (
                code,
                f"{code}_subtitle",
                [(table.name, table) for table in tables if table.rows(record)],
            )
            for code, tables in sheets.items()
        ]

    def certificates(self, saved):
        return {meter["meter"]: meter["certificate"] for meter in saved["meters"]}
