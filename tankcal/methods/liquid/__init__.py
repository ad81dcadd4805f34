"""Metered liquid: runs between dips, adjusted together with the geometry of the tank."""

from tankcal.methods.base import Method


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

    def columns(self):
        from tankcal.methods.liquid.columns import COLUMNS

        return COLUMNS

    def settings(self):
        from tankcal.methods.liquid.columns import KEYS

        return KEYS

    def register_fields(self):
        from tankcal.methods.liquid.columns import METER

        return {"meters": METER}

    def starter_settings(self, kind):
        from tankcal.methods.liquid.columns import STARTS

        return STARTS if kind == "vertical" else {}

    def section_notes(self):
        return {
            "liquid": "the liquid that was metered into the tank, and how well its dips were read"
        }

    def table_notes(self):
        return {
            "liquid": "one row for the start of each run, and one for each batch with the dip"
            " after it"
        }

    def setting_examples(self):
        from tankcal.methods.liquid.columns import SETTING_EXAMPLES

        return SETTING_EXAMPLES

    def examples(self):
        from tankcal.methods.liquid.columns import EXAMPLES

        return EXAMPLES

    def no_rows(self):
        from tankcal.messages import message

        return message(
            "no_rows_of_liquid",
            "no rows; expected the start of each run, and a row for each batch and the dip after"
            " it",
        )

    def check(self, values, tables, registers, raw, log):
        from tankcal.methods.liquid.checks import check_liquid, tell_without_rows

        if not self.is_given(tables):
            tell_without_rows(tables, registers, raw, log)
            return
        check_liquid(values, tables, registers, raw, log)
        if values is not None:
            from tankcal.methods.liquid.checks import check_metering

            check_metering(values, tables, registers, raw, log)

    def read(self, values, tables, registers, raw):
        from tankcal.methods.liquid.readings import make_metering

        return make_metering(values, tables, registers, raw)

    # ---- pipeline

    def finds(self, job):
        return job.tank.kind == "vertical" and job.points is None

    def find(self, job, progress, network):
        from tankcal.pipeline.liquid.geometry import find_nominal_wall
        from tankcal.pipeline.surveying import Surveyed

        return Surveyed(job, find_nominal_wall(job, progress))

    def supplement(self, job, survey, progress):
        from tankcal.messages import message
        from tankcal.pipeline.liquid.measuring import measure_by_liquid

        progress(message("adjusting_liquid", "adjusting the runs by liquid with the geometry"))
        return measure_by_liquid(job, survey)

    def warnings(self, job, survey, sights=None):
        from tankcal.methods.liquid.warnings import check_liquid

        return check_liquid(job, survey)

    # ---- record

    def saved_type(self):
        from tankcal.methods.liquid.saved import LiquidRecord

        return LiquidRecord

    def save(self, result):
        from tankcal.methods.liquid.saved import save_liquid

        return save_liquid(result)

    def choices(self, result):
        from tankcal.methods.liquid.saved import choices_of

        return choices_of(result)

    # ---- report

    def report_tables(self):
        from tankcal.methods.liquid import tables

        return tables

    def report_figures(self):
        from tankcal.methods.liquid import figures

        return figures

    def facts(self):
        from tankcal.methods.liquid.facts import FACTS

        return FACTS

    def unchecked(self, paper):
        from tankcal.methods.liquid.facts import hidden_errors

        return hidden_errors(paper)

    def field_blocks(self, paper, texts):
        from tankcal.methods.liquid.field_sheets import blocks_of_liquid

        return blocks_of_liquid(paper, texts)

    def field_columns(self, paper, columns):
        from tankcal.methods.liquid.field_sheets import columns_of_batches

        return columns_of_batches(paper, columns)

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
