"""App: from a new job to its certificate in a browser, without a terminal (docs/app.md)."""

from tankcal.products.base import Product


class App(Product):
    """Pages for jobs, served on this machine."""

    name = "app"
    commands = (("app", "tankcal.products.app.command"),)
