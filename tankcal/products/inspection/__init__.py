"""Inspection by the calibration survey: plumbness, roundness, peaking and settlement with U."""

from tankcal.products.base import Product


class Inspection(Product):
    """Condition of a tank from the survey of its calibration."""

    name = "inspection"
    commands = (("inspect", "tankcal.products.inspection.command"),)

    def completions(self):
        from tankcal.products.inspection import rules

        return {("inspect", "--rule"): (rules.shipped_names(), True)}

    def documents(self):
        from tankcal.report import inspection

        return (inspection.DOCUMENT,)

    def saved_types(self):
        from tankcal.record import inspection

        return ((inspection.INSPECTION, None, inspection.InspectionFile),)
