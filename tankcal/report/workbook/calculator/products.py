"""Groups of products, and the factor of volume correction to 15 °C.

    VCF = exp(-a dT (1 + 0.8 a dT)),   a = K0 / rho^2 + K1 / rho + K2,   dT = t - 15 °C

rho is the density at 15 °C. Source: ASTM D1250-80, API Standard 2540, IP 200, Tables 54A (crude
oil) and 54B (products). docs/workbook.md lists the printed values of the comparison. The tables
round intermediate results, this module does not; four printed decimals agree.
"""

from dataclasses import dataclass


@dataclass(frozen=True)
class Zone:
    """Range of densities at 15 °C up to `to_kg_m3`, with the constants of the expansion."""

    to_kg_m3: float
    k0: float
    k1: float = 0.0
    k2: float = 0.0


@dataclass(frozen=True)
class Product:
    """Group of products: code of its words, smallest density (kg/m3), zones from the lightest."""

    code: str
    from_kg_m3: float
    zones: tuple[Zone, ...]

    @property
    def to_kg_m3(self):
        """Largest density, kg/m3."""
        return self.zones[-1].to_kg_m3

    def expansion(self, density):
        """Return the formula of a, 1/K, for a cell with the density."""
        *lighter, heaviest = self.zones
        formula = _expansion(heaviest, density)
        for zone in reversed(lighter):
            formula = f"IF({density}<={zone.to_kg_m3!r},{_expansion(zone, density)},{formula})"
        return formula


def _expansion(zone, density):
    terms = [f"{zone.k0!r}/{density}^2"]
    terms += [f"{zone.k1!r}/{density}"] if zone.k1 else []
    terms += [f"{zone.k2!r}"] if zone.k2 else []
    return "+".join(terms)


PRODUCTS = (
    Product(
        "products_54b",
        653.0,
        (
            Zone(770.5, 346.4228, 0.4388),  # gasolines
            Zone(787.5, 2680.3206, k2=-0.00336312),  # between gasolines and jet fuels
            Zone(838.5, 594.5418),  # jet fuels, kerosenes
            Zone(1075.0, 186.9696, 0.4862),  # diesel and fuel oils
        ),
    ),
    Product("crude_54a", 610.5, (Zone(1075.0, 613.9723),)),
)
# Number of the last entry in the list of products: factor of the user.
OWN_FACTOR = len(PRODUCTS) + 1
CODES = (*(product.code for product in PRODUCTS), "own_factor")
BASE_C = 15.0  # reference temperature of the products
LEAST_C, MOST_C = -40.0, 90.0  # limits of the temperature of the liquid
LEAST_KG_M3, MOST_KG_M3 = 300.0, 2000.0  # limits of the density with a factor of the user
LEAST_FACTOR, MOST_FACTOR = 0.7, 1.3  # limits of a factor of the user


def factor(expansion, temperature):
    """Return the formula of the factor for cells with a and the temperature of the liquid."""
    step = f"({temperature}-{BASE_C!r})"
    return f"EXP(-{expansion}*{step}*(1+0.8*{expansion}*{step}))"
