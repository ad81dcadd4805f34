"""Workbench: edit, check and compute a job in a notebook (docs/notebook.md)."""

from tankcal.products.base import Product


class Workbench(Product):
    """A job in a notebook."""

    name = "workbench"
    commands = (("notebook", "tankcal.products.workbench.command"),)
