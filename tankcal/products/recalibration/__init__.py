"""Comparison and history of capacity tables of one tank, and the tank geometry behind a table."""

from tankcal.products.base import Product


class FormerTables(Product):
    """Former tables of a tank: geometry, comparison, history."""

    name = "former tables"
    commands = (
        ("read-table", "tankcal.products.recalibration.read_table_command"),
        ("compare", "tankcal.products.recalibration.compare_command"),
        ("history", "tankcal.products.recalibration.history_command"),
    )

    def completions(self):
        from tankcal.job import rule_files

        return {("compare", "--rule"): (rule_files.shipped_names(), True)}

    def documents(self):
        from tankcal.report import comparison, history

        return comparison.DOCUMENT, history.DOCUMENT

    def saved_types(self):
        from tankcal.record import recalibration

        return (
            (recalibration.COMPARISON, None, recalibration.ComparisonFile),
            (recalibration.HISTORY, None, recalibration.HistoryFile),
        )
