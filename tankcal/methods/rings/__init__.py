"""Strapped rings of a horizontal cylinder: circumferences by tape, ring by ring."""

from tankcal.methods.base import Method


class RingsMethod(Method):
    """Circumferences of the rings of a horizontal cylinder."""

    name = "rings"
    attribute = "rings"
    kinds = ("horizontal",)
    tables = ("rings",)
    shared_tables = ("circumferences", "obstructions", "thickness", "tape_checks")
    starter = "strapping"
    compares_size = True
    field_forms = ((("rings",), 12),)

    # ---- job

    def columns(self):
        from tankcal.methods.rings.columns import RINGS

        return {"rings": RINGS}

    def starter_tables(self):
        return (*self.shared_tables, *self.tables)

    def table_notes(self):
        return {"rings": "one row for each ring (of plates) of the cylinder, from end A to end B"}

    def examples(self):
        from tankcal.methods.rings.columns import EXAMPLES

        return EXAMPLES

    def check(self, values, tables, registers, raw, log):
        from tankcal.methods.rings.readings import check_rings

        check_rings(values, tables, registers, raw, log)

    def estimate_diameter_m(self, tables):
        from tankcal.methods.rings.readings import estimate_diameter_m

        return estimate_diameter_m(tables)

    def read(self, values, tables, registers, raw):
        from tankcal.methods.rings.readings import make_rings

        return make_rings(tables)

    def readings_of(self, job):
        return job.rings or None

    # ---- pipeline

    def find(self, job, progress, network):
        from tankcal.methods.rings.wall import find_ringed_wall
        from tankcal.pipeline.surveying import Surveyed

        return Surveyed(job, find_ringed_wall(job, progress, network.amplitudes))

    def inside_radii(self, job, survey):
        from tankcal.methods.rings.wall import inside_radii

        return inside_radii(job, survey)

    def part(self, job, survey, switches):
        from tankcal.methods.rings.wall import ringed_part

        return ringed_part(job, survey, switches)

    def warnings(self, job, survey, sights=None):
        from tankcal.methods.rings.warnings import check_rings

        return check_rings(job, survey)

    # ---- record

    def choices(self, result):
        shape_mm = 1000 * result.rings.shape_sd_m
        return {
            "survey": "strapping_rings",
            "area_term": shape_mm or "none",
            "between_sections": "rings",
            "form": "learned",
        }
