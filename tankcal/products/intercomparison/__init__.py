"""Comparison of software: random tanks, simulated surveys, sealed volumes, answers and scores."""

from tankcal.products.base import Product


class Intercomparison(Product):
    """Comparison of programs by simulated tanks."""

    name = "intercomparison"
    commands = (("intercomparison", "tankcal.products.intercomparison.command"),)

    def saved_types(self):
        from tankcal.record import intercomparison as saved

        return (
            (saved.PACKAGE, None, saved.PackageFile),
            (saved.TRUTH, None, saved.TruthFile),
            (saved.ANSWERS, None, saved.AnswersFile),
            (saved.SCORES, None, saved.ScoresFile),
        )
