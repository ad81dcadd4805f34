"""A product of another distribution: `tankcal barrels`, a volume in barrels or US gallons.

Its folder and its entry point, in `toy_product.dist-info`, are all that the command needs.
"""

from tankcal.products.base import Product

UNITS = ("bbl", "gal")
M3 = {"bbl": 0.158987294928, "gal": 0.003785411784}  # exact, from 231 cubic inches


class Barrels(Product):
    """Volumes in the units of the United States."""

    name = "barrels"
    commands = (("barrels", "toy_product"),)

    def completions(self):
        return {("barrels", "--unit"): (UNITS, False)}

    def help_words(self, language):
        texts = {
            "pt-BR": ("converter um volume", "Converte um volume.", "volume em metros cúbicos"),
            "es": ("convertir un volumen", "Convierte un volumen.", "volumen en metros cúbicos"),
        }
        if language not in texts:
            return {}
        line, about, volume = texts[language]
        return {"barrels": {"line": line, "about": about, "volume": volume}}


def add(commands):
    """Add the parser of `tankcal barrels`."""
    parser = commands.add_parser("barrels", help="convert a volume", description="Convert it.")
    parser.add_argument("volume", metavar="M3", type=float, help="volume in cubic metres")
    parser.add_argument("--unit", metavar="CODE", default="bbl", help="bbl or gal")
    parser.set_defaults(command=_convert)


def _convert(options):
    print(f"{options.volume / M3[options.unit]:.4f} {options.unit}")
    return 4 if options.volume < 0 else None
