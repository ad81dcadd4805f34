"""Commissioning of an automatic level gauge: its deviation from hand dips, and its corrections."""

from tankcal.products.base import Product


class Gauge(Product):
    """Level gauge compared with hand dips."""

    name = "gauge"
    commands = (("gauge", "tankcal.products.gauge.command"),)

    def documents(self):
        from tankcal.products.gauge.paper import DOCUMENT

        return (DOCUMENT,)

    def saved_types(self):
        from tankcal.products.gauge.saved import GAUGE, GaugeFile

        return ((GAUGE, None, GaugeFile),)
