"""Point clouds: files of scanners, whose cells become points of the wall."""

from typing import ClassVar

from tankcal.messages import message
from tankcal.methods.base import Delegate, Import, Method


class CloudsMethod(Method):
    """Scans of the wall, registered by targets or declared poses."""

    name = "clouds"
    attribute = "clouds"
    kinds = ("vertical", "horizontal", "sphere")
    tables = ("scan_targets",)
    register = "clouds"
    starter = "cloud"
    starter_registers = ("clouds", "instruments")
    is_sighted = True
    has_means = True
    has_own_offset = True
    saved_note = "clouds of the wall; left out if there are none"

    # ---- job

    columns = Import("tankcal.methods.clouds.columns:COLUMNS")

    def register_fields(self):
        from tankcal.methods.clouds.columns import CLOUD

        return {"clouds": CLOUD}

    def starter_tables(self):
        from tankcal.methods.clouds.columns import BESIDE

        return (*self.tables, *BESIDE)

    table_notes: ClassVar = {"scan_targets": "one row for each target in each scan; may stay empty"}

    setting_examples = Import("tankcal.methods.clouds.columns:SETTING_EXAMPLES")
    examples = Import("tankcal.methods.clouds.columns:EXAMPLES")

    no_rows = message(
        "no_cloud_at_all", "nothing filled in; expected a section for each file of a scanner"
    )

    check = Delegate("tankcal.methods.clouds.readings:check_clouds")
    read = Delegate("tankcal.methods.clouds.readings:make_clouds")

    # ---- pipeline

    def find(self, job, progress, network):
        from tankcal.methods.clouds.passes import Reading
        from tankcal.methods.clouds.wall import find_wall_in_clouds
        from tankcal.pipeline.surveying import Surveyed

        reading = Reading(network.cluster, network.part_progress)
        job, clouded, survey = find_wall_in_clouds(
            job,
            network.adjustment,
            progress,
            network.dof,
            amplitudes=network.amplitudes,
            reading=reading,
        )
        return Surveyed(job, survey, sights={"clouds": clouded})

    warnings = Delegate("tankcal.methods.clouds.wall:check_clouds")

    # ---- record

    saved_type = Import("tankcal.methods.clouds.saved:CloudsRecord")
    save = Delegate("tankcal.methods.clouds.saved:save_clouds")

    def choices(self, result):
        if result.wall is None:
            return {}
        return {"survey": "clouds", "covariance": "clouds"}

    # ---- report

    report_tables = Import("tankcal.methods.clouds.tables")
    report_figures = Import("tankcal.methods.clouds.figures")
    facts = Import("tankcal.methods.clouds.tables:FACTS")

    def sheets(self, record):
        tables = [table for table in self.report_tables().TABLES if table.rows(record)]
        return [("clouds", "clouds_subtitle", [(table.name, table) for table in tables])]

    def certificates(self, saved):
        return {entry["scanner"]: entry["certificate"] for entry in saved["scanners"]}
