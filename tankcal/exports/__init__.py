"""Exports of a table to gauging and inventory systems.

profiles      description of a file for a system (TOML), and the shipped profiles with their texts
chords, breakpoints   rows selected for a polyline or a spline of few points
writing       rows of a record for a profile, or the reasons why it does not fit; the text, and the
              text read back by the linter
exporting     from a record to the file, with HyTD of the gauge, provenance and report
"""

from tankcal.exports.exporting import Export, export_record, write_export
from tankcal.exports.profiles import Profile, find_profile, shipped_profiles

__all__ = [
    "Export", "Profile", "export_record", "find_profile", "shipped_profiles", "write_export",
]  # fmt: skip
