"""Computation of many jobs, by dask workers or in this process (docs/batch.md).

`running.run_batch` runs a whole batch. The folder of each job, DIR/jobs/NAME, contains
`outcome.json`, from which an interrupted batch continues.
"""

from tankcal.products.base import Product


class Batch(Product):
    """Many jobs."""

    name = "batch"
    commands = (("batch", "tankcal.products.batch.command"),)

    def completions(self):
        from tankcal.products.exports import Exports
        from tankcal.products.inspection import Inspection
        from tankcal.products.recalibration import FormerTables

        exports, inspection, tables = Exports(), Inspection(), FormerTables()
        return {
            ("batch", "--profile"): exports.completions()["export", "--profile"],
            ("batch", "--inspect-by"): inspection.completions()["inspect", "--rule"],
            ("batch", "--compare-by"): tables.completions()["compare", "--rule"],
        }
