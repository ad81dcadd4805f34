"""Certificates of laboratories: their register, and a page for digital certificates."""

from tankcal.products.base import Product


class Register(Product):
    """Register of certificates, and pages that show digital certificates."""

    name = "register"
    commands = (
        ("register", "tankcal.products.register.command"),
        ("dcc", "tankcal.products.register.dcc_command"),
    )
