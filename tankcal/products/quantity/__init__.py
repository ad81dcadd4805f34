"""From a dip to the quantity of product: volumes at the base temperature, mass, and their U."""

from tankcal.products.base import Product


class Quantity(Product):
    """Quantity of a transfer or of a stock."""

    name = "quantity"
    commands = (
        ("ticket", "tankcal.products.quantity.command"),
        ("standard", "tankcal.products.quantity.standard_command"),
    )

    def documents(self):
        from tankcal.report import ticket

        return (ticket.DOCUMENT,)

    def saved_types(self):
        from tankcal.record import ticket

        return ((ticket.TICKET, None, ticket.TicketFile),)
