"""Register of the certificates of a laboratory: issued, replaced, withdrawn."""

from tankcal.products.base import Product


class Register(Product):
    """Register of certificates; `tankcal history` shows their states."""

    name = "register"
    commands = (("register", "tankcal.products.register.command"),)
