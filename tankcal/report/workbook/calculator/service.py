"""Volume in service, and sentences of the calculator on its input.

Volume in service: other temperature of the shell, other liquid, and volume of the product.

    V = (V table + head) CTSh + roof,   V at the reference temperature of the product = V * VCF

The head is the difference between the tables for another density and for the reference density,
without the effect of the density on a floating roof. It is interpolated linearly between the
densities of the record. U of the table does not apply to these volumes, since the input values have
an uncertainty as well.

Groups of products, and the factor of volume correction to 15 °C.

    VCF = exp(-a dT (1 + 0.8 a dT)),   a = K0 / rho^2 + K1 / rho + K2,   dT = t - 15 °C

rho is the density at 15 °C. Source: ASTM D1250-80, API Standard 2540, IP 200, Tables 54A (crude
oil) and 54B (products). docs/workbook.md lists the printed values of the comparison. The tables
round intermediate results, this module does not; four printed decimals agree.

The first sentences concern valid input; all others begin with the word for "refused".
"""

from dataclasses import dataclass
from itertools import pairwise

from tankcal.report.uncertainty.stated import roof_of
from tankcal.report.workbook.calculator.table import NANOMETRE, Line, if_number, is_no_number
from tankcal.report.workbook.capacity import name_of_density
from tankcal.tank.fittings import AIR_KG_M3, WEIGHTS_KG_M3, floating_roof
from tankcal.text.digits import LITRE_DECIMALS, NOTHING, fixed, shortest
from tankcal.text.words import marks_of

SHELL_C = (-50.0, 150.0)  # limits of the temperature of the shell


def checks(number):
    """Return the lines with the state of each input (list of Line)."""
    listed = "MATCH([product],product_groups,0)"
    code = f"IF(ISBLANK([product]),0,IF(ISNUMBER({listed}),{listed},-1))"
    state = "IF([product_code]=0,#product_none,IF([product_code]<0,#product_unknown,#fine))"
    shell = _check("shell", SHELL_C, "#shell_blank", good="#shell_fine")
    return [
        Line("shell_state", shell, number("shell_fine"), 0),
        Line("product_code", code, 0, 0),
        Line("product_state", state, number("product_none"), 0),
        *(
            Line(f"{key}_state", check, number("not_used"), 0)
            for key, check in _checks_of_product()
        ),
    ]


def _checks_of_product():
    """Yield (input, formula of its check) for the inputs of a product."""
    ranges = [(product.from_kg_m3, product.to_kg_m3) for product in PRODUCTS]
    ranges.append((LEAST_KG_M3, MOST_KG_M3))
    densities = [
        f"CHOOSE([product_code],{','.join(repr(end) for end in ends)})"
        for ends in zip(*ranges, strict=True)
    ]
    blank = f"IF([product_code]={OWN_FACTOR},#density_left_out,#density_blank)"
    yield "density", _unless("[product_code]<1", _check("density", densities, blank))
    liquid = _check("liquid", (LEAST_C, MOST_C), "#liquid_blank")
    yield "liquid", _unless(f"OR([product_code]<1,[product_code]={OWN_FACTOR})", liquid)
    factors = LEAST_FACTOR, MOST_FACTOR
    factor = _check("factor", factors, "#factor_blank")
    yield "factor", _unless(f"[product_code]<>{OWN_FACTOR}", factor)


def _unless(unused, check):
    return f"IF({unused},#not_used,{check})"


def _check(key, ends, blank, good="#fine"):
    """Return the formula of the number of the sentence on an input."""
    cell, (low, high) = f"[{key}]", ends
    return (
        f"IF(ISBLANK({cell}),{blank},IF({is_no_number(cell)},#no_number,"
        f"IF(OR({cell}<{low},{cell}>{high}),#{key}_range,{good})))"
    )


def product_lines():
    """Return the lines of expansion, factor and density of the liquid in the tank."""
    density, none = "[good_density]", f'"{NOTHING}"'
    expansions = ",".join(product.expansion(density) for product in PRODUCTS)
    has_group = f"AND([product_code]>0,[product_code]<{OWN_FACTOR},[liquid_state]=#fine)"
    user_factor = f"IF([factor_state]=#fine,[factor],{none})"
    computed = if_number("[expansion]", factor("[expansion]", "[liquid]"))
    return [
        Line("good_density", f"IF([density_state]=#fine,[density],{none})", NOTHING, 1, "kg/m³"),
        Line(
            "expansion",
            if_number(density, f"IF({has_group},CHOOSE([product_code],{expansions}),{none})"),
            NOTHING,
            "0.000000E+00",
            "1/K",
        ),
        Line("vcf", f"IF([product_code]={OWN_FACTOR},{user_factor},{computed})", NOTHING, 6),
        Line("liquid_density", _if_both(density, "[vcf]", f"{density}*[vcf]"), NOTHING, 2, "kg/m³"),
    ]


def _if_both(first, second, expression):
    return f'IF(AND(ISNUMBER({first}),ISNUMBER({second})),{expression},"{NOTHING}")'


def head_lines(table, number, label):
    """Return the lines of the volume for each density and of the head.

    Parameters
    ----------
    table : Table
        Capacity table.
    number : callable
        number(key) returns the number of a sentence.
    label : callable
        label(density) returns the label of the line of a density.

    Returns
    -------
    list of Line
    """
    volumes = []
    densities = table.densities
    for place, density in enumerate(densities[1:], start=2):
        low, high = (f"INDEX({name_of_density(place)},[dip_{end}])" for end in ("row", "next"))
        volume = table.record["densities"][place - 2]["volume_m3"][table.at]
        floating = ""
        if table.critical is not None:  # the line of the roof adds its effect
            roof = draught_m3(table, repr(density))
            floating = f"-{when_afloat(table, roof)}"
            volume -= _roof_at_opening(table, density)
        formula = if_number("[dip_row]", f"{low}+[dip_part]*({high}-{low}){floating}")
        volumes.append(
            Line(f"density_{place}", formula, volume, LITRE_DECIMALS, "m³", label=label(density))
        )
    if not volumes:
        return [
            Line("head_state", "#head_single", number("head_single"), 0),
            Line("head_m3", if_number("[dip_row]", "0"), 0, LITRE_DECIMALS, "m³"),
        ]
    least, most = min(densities), max(densities)
    known = "[liquid_density]"
    state = (
        f"IF(NOT(ISNUMBER({known})),#head_unknown,"
        f"IF(OR({known}<{least!r},{known}>{most!r}),#head_outside,#head_applied))"
    )
    head = f"IF([head_state]=#head_applied,{_interpolation(densities, known)}-[dip_volume],0)"
    head = f'IF([head_state]=#head_outside,"{NOTHING}",{head})'
    return [
        *volumes,
        Line("head_state", state, number("head_unknown"), 0),
        Line("head_m3", if_number("[dip_row]", head), 0, LITRE_DECIMALS, "m³"),
    ]


def _interpolation(densities, density):
    """Return the formula of the volume at a density, linear between densities of the record."""
    cells = ["[dip_volume]", *(f"[density_{i}]" for i in range(2, len(densities) + 1))]
    ordered = sorted(zip(densities, cells, strict=True))
    formula = ""
    for (low, low_volume), (high, high_volume) in reversed(list(pairwise(ordered))):
        part = f"{low_volume}+({density}-{low!r})/{high - low!r}*({high_volume}-{low_volume})"
        formula = f"IF({density}<={high!r},{part},{formula})" if formula else part
    return formula


def roof_lines(table):
    """Return the line of the correction for a floating roof, in a list; [] without roof."""
    if table.critical is None:
        return []
    afloat = when_afloat(table, draught_m3(table, "[liquid_density]"))
    known = f"IF(ISNUMBER([liquid_density]),{afloat},0)"
    return [Line("roof_m3", if_number("[dip_row]", known), 0, LITRE_DECIMALS, "m³")]


def draught_m3(table, density):
    """Return the formula of the displacement by the roof, m³, reference minus this density."""
    roof = roof_of(table.record)
    air = AIR_KG_M3 if roof["roof_weighing"] == "air" else 0.0
    mass = f"{roof['roof_mass']!r}*(1-{air!r}/{WEIGHTS_KG_M3!r})"
    reference = roof["roof_reference_density"]
    return f"{mass}*(1/({reference!r}-{air!r})-1/({density}-{air!r}))"


def when_afloat(table, expression):
    """Return the formula of an expression that applies above the critical zone only."""
    return f"IF([dip]>={table.critical[1]!r}-{NANOMETRE},{expression},0)"


def _roof_at_opening(table, density):
    """Return the value of `draught_m3` for a density at the initial dip, m³."""
    if table.height_m[table.at] < table.critical[1]:
        return 0.0
    roof = roof_of(table.record)
    sizes = (roof["roof_mass"], *table.critical, roof["roof_reference_density"])
    return floating_roof(*sizes, roof["roof_weighing"]).density_correction_m3(density)


def results(table):
    """Return the lines of volume in service, volume at reference temperature, and masses."""
    base = table.job["table"]["reference_temperature_c"]
    step = f"{table.job['material']['expansion_per_k']!r}*([shell]-{base!r})"
    # Expansion of the shell in two directions: (1 + step)^2.
    ctsh = f'IF([shell_state]=#shell_fine,1+2*{step}+({step})^2,"{NOTHING}")'
    roof = "" if table.critical is None else "+[roof_m3]"
    volume = table.volume_m3[table.at]
    looks = {"digits": LITRE_DECIMALS, "unit": "m³", "by": "expanded"}
    air = f"(1-{AIR_KG_M3!r}/{WEIGHTS_KG_M3!r})"
    masses = [
        Line(key, _if_both("[at_base]", "[good_density]", formula), NOTHING, 0, "kg")
        for key, formula in (
            ("mass", "[at_base]*[good_density]"),
            ("mass_in_air", f"[at_base]*([good_density]-{AIR_KG_M3!r})/{air}"),
        )
    ]
    shown = [Line("head", "[head_m3]", 0, LITRE_DECIMALS, "m³", remark="head_state")]
    if table.critical is not None:
        shown.append(Line("roof", "[roof_m3]", 0, LITRE_DECIMALS, "m³"))
    return [
        Line("ctsh", ctsh, 1.0, 6),
        *shown,
        Line(
            "in_service",
            _if_both("[ctsh]*[volume]", "[head_m3]", f"([volume]+[head_m3])*[ctsh]{roof}"),
            volume,
            strong=True,
            **looks,
        ),
        Line("factor_used", "[vcf]", NOTHING, 6),
        Line("in_tank", "[liquid_density]", NOTHING, 1, "kg/m³"),
        Line(
            "at_base",
            if_number("[in_service]*[vcf]", "[in_service]*[vcf]"),
            NOTHING,
            strong=True,
            **looks,
        ),
        *masses,
    ]


# ---- groups of products


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


GOOD = (
    "within", "fine", "shell_fine", "wanted_within", "not_used", "product_none", "density_left_out",
    "head_single", "head_unknown", "head_applied", "delivery", "no_delivery",
)  # fmt: skip
REFUSED = (
    "dip_blank", "no_number", "below", "above", "critical", "wanted_blank", "wanted_below",
    "wanted_above", "wanted_critical", "no_single_dip", "volumes_fall", "shell_blank",
    "shell_range", "product_unknown", "density_blank", "density_range", "liquid_blank",
    "liquid_range", "factor_blank", "factor_range", "head_outside", "swapped",
)  # fmt: skip
KEYS = (*GOOD, *REFUSED)


def number(key):
    """Return the number of a sentence, from 1."""
    return KEYS.index(key) + 1


def sentences(book, table):
    """Return all sentences in the order of `KEYS` (list of str)."""
    marks = marks_of(book.words)
    heights, volumes = table.height_m, table.volume_m3
    critical = table.critical or (0.0, 0.0)
    values = {
        "first": fixed(heights[0], table.digits, marks),
        "last": fixed(heights[-1], table.digits, marks),
        "least": fixed(min(volumes), 3, marks),
        "most": fixed(max(volumes), 3, marks),
        "critical_low": fixed(critical[0], table.digits, marks),
        "critical_high": fixed(critical[1], table.digits, marks),
        "light": shortest(min(table.densities), marks),
        "heavy": shortest(max(table.densities), marks),
        "own": shortest(table.densities[0], marks),
        "cold": shortest(LEAST_C, marks),
        "hot": shortest(MOST_C, marks),
        "shell_cold": shortest(SHELL_C[0], marks),
        "shell_hot": shortest(SHELL_C[1], marks),
        "temperature": shortest(table.job["table"]["reference_temperature_c"], marks),
        "densities": book.sheet_name("other_densities"),
        "deliveries": book.sheet_name("deliveries"),
    }
    texts = [book.word(f"sentences.{key}", of="calculator", **values) for key in KEYS]
    refused = refused_word(book)
    return [
        f"{refused} {text}" if key in REFUSED else text
        for key, text in zip(KEYS, texts, strict=True)
    ]


def refused_word(book):
    """Return the first word of all refusals."""
    return book.word("texts.refused", of="calculator")
