"""Exports of a table to gauging and inventory systems.

profiles      description of a file for a system (TOML), and the shipped profiles with their texts
chords, breakpoints   rows selected for a polyline or a spline of few points
writing       rows of a record for a profile, or the reasons why it does not fit; the text, and the
              text read back by the linter
exporting     from a record to the file, with HyTD of the gauge, provenance and report
"""

from tankcal.products.base import Product


class Exports(Product):
    """Capacity tables for gauging systems."""

    name = "exports"
    commands = (
        ("export", "tankcal.products.exports.export_command"),
        ("chart", "tankcal.products.exports.chart_command"),
    )

    def completions(self):
        from tankcal.products.exports.profiles import shipped_profiles

        return {("export", "--profile"): (tuple(shipped_profiles()), True)}
