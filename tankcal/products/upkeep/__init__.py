"""A calibration kept up by everyday data: level logs, meters and delivery tickets."""

from tankcal.products.base import Product


class Upkeep(Product):
    """Tank in service, watched and estimated by its logs."""

    name = "upkeep"
    commands = (("upkeep", "tankcal.products.upkeep.command"),)

    def documents(self):
        from tankcal.products.upkeep.paper import DOCUMENT

        return (DOCUMENT,)

    def saved_types(self):
        from tankcal.products.upkeep.saved import UPKEEP, UpkeepFile

        return ((UPKEEP, None, UpkeepFile),)
