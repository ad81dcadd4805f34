"""Strapped rings of a horizontal cylinder: circumferences by tape, ring by ring."""

from typing import ClassVar

from tankcal.methods.base import Delegate, Import, Method


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

    table_notes: ClassVar = {
        "rings": "one row for each ring (of plates) of the cylinder, from end A to end B"
    }

    examples = Import("tankcal.methods.rings.columns:EXAMPLES")
    check = Delegate("tankcal.methods.rings.readings:check_rings")
    estimate_diameter_m = Delegate("tankcal.methods.rings.readings:estimate_diameter_m")

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

    inside_radii = Delegate("tankcal.methods.rings.wall:inside_radii")
    part = Delegate("tankcal.methods.rings.wall:ringed_part")
    warnings = Delegate("tankcal.methods.rings.wall:check_rings")

    # ---- record

    def choices(self, result):
        shape_mm = 1000 * result.rings.shape_sd_m
        return {
            "survey": "strapping_rings",
            "area_term": shape_mm or "none",
            "between_sections": "rings",
            "form": "learned",
        }

    def sizes(self, result):
        # Volumes below dip 0 and above the highest dip, which no dip measures.
        solid = result.body.parts[0].solid
        below_m3 = float(solid.volume_m3([result.zero_m])[0])
        return {"below_zero": (below_m3, "m3"), "left_at_full": (solid.left_m3, "m3")}
