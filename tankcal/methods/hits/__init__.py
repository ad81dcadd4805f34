"""Wall hits: distances of a total station to the bare wall, without a target."""

from tankcal.methods.base import Method


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

    def columns(self):
        from tankcal.methods.hits.columns import COLUMNS

        return COLUMNS

    def table_notes(self):
        return {
            "wall_hits": "one row for each sight to the bare wall, without a target",
            "control_readings": "one row for each reading of a control target: at the start, every"
            " half hour and at the end; may stay empty",
        }

    def examples(self):
        from tankcal.methods.hits.columns import EXAMPLES

        return EXAMPLES

    def no_rows(self):
        from tankcal.messages import message

        return message("no_rows_of_hits", "no rows; expected a sight to the wall in each")

    def check(self, values, tables, registers, raw, log):
        from tankcal.methods.hits.readings import check_hits

        check_hits(values, tables, registers, raw, log)

    def may_see_both_sides(self, tables):
        return len(set(tables["wall_hits"].of("setup"))) > 1

    def read(self, values, tables, registers, raw):
        from tankcal.methods.hits.readings import make_hits

        return make_hits(tables, registers)

    # ---- known walls

    def observe(self, job, wall, errors):
        from tankcal.methods.hits.readings import observe_hits

        return observe_hits(job, wall, errors)

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

    def warnings(self, job, survey, sights=None):
        from tankcal.methods.hits.warnings import check_hits

        return check_hits(job, survey, sights)

    # ---- record

    def saved_type(self):
        from tankcal.methods.hits.saved import HitsRecord

        return HitsRecord

    def save(self, result):
        from tankcal.methods.hits.saved import save_hits

        return save_hits(result)

    def choices(self, result):
        return {"survey": "wall_hits", "covariance": "hits"}

    # ---- report

    def report_tables(self):
        from tankcal.methods.hits import tables

        return tables

    def sheets(self, record):
        declared = self.report_tables()
        tables = (
            *(declared.SETUPS, declared.SHARED, declared.RINGS, declared.CONTROL),
            *(declared.DRIFTS, declared.COMPARED, declared.INCIDENCE),
        )
        shown = [(table.name, table) for table in tables if table.rows(record)]
        return [("hits", "hits_subtitle", shown)]

    def certificates(self, saved):
        from tankcal.report.tables.sights import certificates_of_setups

        return certificates_of_setups(saved["setups"])
