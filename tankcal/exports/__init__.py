"""Exports of a table to gauging and inventory systems.

profiles      what a file for a system is like (TOML), the shipped ones
marks         rows as whole numbers of last digits, each rounded once
chords, breakpoints, splines   the rows that a polyline, or a spline, of few points keeps
choosing      rows of a record by a profile, and why it cannot take them
writing       the text, and the same text read back by the linter
facts         provenance, and what the report says
shell_movement   HyTD of a gauge that hangs on the shell
exporting     from a record to the file
"""

from tankcal.exports.exporting import Export, export_record, write_export
from tankcal.exports.profiles import Profile, find_profile, shipped_profiles

__all__ = [
    "Export", "Profile", "export_record", "find_profile", "shipped_profiles", "write_export",
]  # fmt: skip
