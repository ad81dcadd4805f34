"""Wall hits inside horizontal tanks and spheres: distances of a total station to the bare wall."""

from tankcal.methods.base import Delegate, Import, Method


class InsideHitsMethod(Method):
    """Reflectorless sights from set-ups inside a horizontal tank or a sphere.

    The tables and readings are those of the upright method `hits`. The hits become points, to which
    the cylinder or sphere is fitted as to any other surveyed points.
    """

    name = "inside_hits"
    kinds = ("horizontal", "sphere")
    tables = ("wall_hits", "control_readings")
    shared_tables = (  # tables that connect set-ups or determine an offset
        *("setups", "control", "directions", "zenith_angles", "slope_distances"),
    )
    starter = "wall-hits"
    needs_station_heights = True
    is_sighted = True
    has_own_offset = True
    saved_note = (
        "bare wall hits inside a horizontal tank or a sphere; left out where there are none"
    )

    # ---- job

    columns = Import("tankcal.methods.hits.columns:COLUMNS")

    def starter_settings(self, kind):
        return {"survey.side": "inside"}

    check = Delegate("tankcal.methods.inside_hits.readings:check_inside_hits")

    def read(self, values, tables, registers, raw):
        from tankcal.methods.inside_hits.readings import make_inside_hits

        return make_inside_hits(tables, registers)

    # ---- pipeline

    def find(self, job, progress, network):
        from tankcal.methods.inside_hits.solid import find_hit_solid
        from tankcal.pipeline.surveying import Surveyed

        job_of_points, sighting, scan = find_hit_solid(
            job, network.adjustment, progress, network.dof
        )
        return Surveyed(job_of_points, scan, sights={self.name: sighting})

    warnings = Delegate("tankcal.methods.inside_hits.solid:check_hits_inside")

    # ---- record

    saved_type = Import("tankcal.methods.inside_hits.saved:InsideHitsRecord")
    save = Delegate("tankcal.methods.inside_hits.saved:save_inside_hits")

    def choices(self, result):
        return {"survey": "wall_hits", "covariance": "hits"}

    # ---- report

    report_tables = Import("tankcal.methods.inside_hits.saved")

    def sheets(self, record):
        declared = self.report_tables()
        tables = (declared.SETUPS, declared.INCIDENCE, declared.COMPARED)
        shown = [(table.name, table) for table in tables if table.rows(record)]
        return [("hits", "inside_hits_subtitle", shown)]

    def certificates(self, saved):
        from tankcal.report.tables.table import certificates_of_setups

        return certificates_of_setups(saved["setups"])
