"""Wall hits: distances of a total station to the bare wall, without a target."""

from typing import ClassVar

from tankcal.messages import message
from tankcal.methods.base import Delegate, Import, Method


class HitsMethod(Method):
    """Reflectorless sights to the wall, which become its points."""

    name = "hits"
    attribute = "hits"
    kinds = ("vertical",)
    tables = ("wall_hits", "control_readings")
    shared_tables = (  # tables that connect set-ups or determine an offset
        *("setups", "control", "directions", "zenith_angles", "slope_distances"),
        *("circumferences", "obstructions"),
    )
    starter = "wall-hits"
    needs_station_heights = True
    tables_with_sds = ("wall_hits",)
    is_sighted = True
    has_own_offset = True
    compares_size = True
    field_forms = ((("wall_hits",), 30), (("control_readings",), 24))
    kind_of_readings = "hits"
    saved_note = "bare wall hits; left out where there are none"

    # ---- job

    columns = Import("tankcal.methods.hits.columns:COLUMNS")

    table_notes: ClassVar = {
        "wall_hits": "one row for each sight to the bare wall, without a target",
        "control_readings": "one row for each reading of a control target: at the start, every"
        " half hour and at the end; may stay empty",
    }

    examples = Import("tankcal.methods.hits.columns:EXAMPLES")

    no_rows = message("no_rows_of_hits", "no rows; expected a sight to the wall in each")

    check = Delegate("tankcal.methods.hits.readings:check_hits")

    def may_see_both_sides(self, tables):
        return len(set(tables["wall_hits"].of("setup"))) > 1

    def read(self, values, tables, registers, raw):
        from tankcal.methods.hits.readings import make_hits

        return make_hits(tables, registers)

    # ---- known walls

    observe = Delegate("tankcal.methods.hits.readings:observe_hits")

    def levels_read(self, job):
        from tankcal.methods.hits.readings import levels_of_hits

        return set(levels_of_hits(job))

    def courses_of_readings(self, job):
        return job.hits.course

    def instruments_in_use(self, job):
        return set(job.hits.instrument)

    # ---- pipeline

    def find(self, job, progress, network):
        from tankcal.methods.hits.wall import find_hit_wall
        from tankcal.pipeline.surveying import Surveyed

        job_of_points, sighting, wall = find_hit_wall(
            job, network.adjustment, progress, network.dof, amplitudes=network.amplitudes
        )
        return Surveyed(job_of_points, wall, sights={"hits": sighting})

    warnings = Delegate("tankcal.methods.hits.warnings:check_hits")

    # ---- record

    saved_type = Import("tankcal.methods.hits.saved:HitsRecord")
    save = Delegate("tankcal.methods.hits.saved:save_hits")

    def choices(self, result):
        return {"survey": "wall_hits", "covariance": "hits"}

    # ---- report

    report_tables = Import("tankcal.methods.hits.saved")

    def sheets(self, record):
        declared = self.report_tables()
        tables = (
            *(declared.SETUPS, declared.SHARED, declared.RINGS, declared.CONTROL),
            *(declared.DRIFTS, declared.COMPARED, declared.INCIDENCE),
        )
        shown = [(table.name, table) for table in tables if table.rows(record)]
        return [("hits", "hits_subtitle", shown)]

    def certificates(self, saved):
        from tankcal.report.tables.table import certificates_of_setups

        return certificates_of_setups(saved["setups"])
