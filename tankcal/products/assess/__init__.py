"""Assessment of a certificate and its record as an assessor of a laboratory would read them."""

from tankcal.products.base import Product


class Assessment(Product):
    """Certificate and record compared with ISO/IEC 17025, ILAC-P14, ILAC-G8, GUM and the rule."""

    name = "assess"
    commands = (("assess", "tankcal.products.assess.command"),)

    def documents(self):
        from tankcal.products.assess.paper import DOCUMENT

        return (DOCUMENT,)

    def saved_types(self):
        from tankcal.products.assess.requirements import ASSESSMENT, AssessmentFile

        return ((ASSESSMENT, None, AssessmentFile),)
