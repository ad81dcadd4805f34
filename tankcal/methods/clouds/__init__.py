"""Point clouds: files of scanners, whose cells become points of the wall."""

from tankcal.methods.base import Method


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

    def columns(self):
        from tankcal.methods.clouds.columns import COLUMNS

        return COLUMNS

    def register_fields(self):
        from tankcal.methods.clouds.columns import CLOUD

        return {"clouds": CLOUD}

    def starter_tables(self):
        from tankcal.methods.clouds.columns import BESIDE

        return (*self.tables, *BESIDE)

    def table_notes(self):
        return {"scan_targets": "one row for each target in each scan; may stay empty"}

    def setting_examples(self):
        from tankcal.methods.clouds.columns import SETTING_EXAMPLES

        return SETTING_EXAMPLES

    def examples(self):
        from tankcal.methods.clouds.columns import EXAMPLES

        return EXAMPLES

    def no_rows(self):
        from tankcal.messages import message

        return message(
            "no_cloud_at_all", "nothing filled in; expected a section for each file of a scanner"
        )

    def check(self, values, tables, registers, raw, log):
        from tankcal.methods.clouds.checks import check_clouds

        check_clouds(values, tables, registers, raw, log)

    def read(self, values, tables, registers, raw):
        from tankcal.methods.clouds.readings import make_clouds

        return make_clouds(values, tables, registers, raw)

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

    def warnings(self, job, survey, sights=None):
        from tankcal.methods.clouds.warnings import check_clouds

        return check_clouds(job, survey, sights)

    # ---- record

    def saved_type(self):
        from tankcal.methods.clouds.saved import CloudsRecord

        return CloudsRecord

    def save(self, result):
        from tankcal.methods.clouds.saved import save_clouds

        return save_clouds(result)

    def choices(self, result):
        if result.wall is None:
            return {}
        return {"survey": "clouds", "covariance": "clouds"}

    # ---- report

    def report_tables(self):
        from tankcal.methods.clouds import tables

        return tables

    def report_figures(self):
        from tankcal.methods.clouds import figures

        return figures

    def facts(self):
        from tankcal.methods.clouds.facts import FACTS

        return FACTS

    def sheets(self, record):
        tables = [table for table in self.report_tables().TABLES if table.rows(record)]
        return [("clouds", "clouds_subtitle", [(table.name, table) for table in tables])]

    def certificates(self, saved):
        return {entry["scanner"]: entry["certificate"] for entry in saved["scanners"]}
