"""What the tank holds in service: shell at another temperature, another liquid, and its product.

    V = (V table + head) CTSh + roof,   V at the product's own temperature = V * VCF

The head is the table for another density less the table, both without what the roof makes of the
density, linear between the densities that the record has. U of the table is U of none of these:
what is typed here has an uncertainty of its own.
"""

from itertools import pairwise

from tankcal.report.uncertainty.sources import roof_of
from tankcal.report.workbook.calculator import products
from tankcal.report.workbook.calculator.cells import NANOMETRE, Line, if_number, is_no_number
from tankcal.report.workbook.calculator.products import OWN_FACTOR, PRODUCTS
from tankcal.report.workbook.parts import name_of_density
from tankcal.tank.fittings import AIR_KG_M3, WEIGHTS_KG_M3, floating_roof
from tankcal.text.digits import LITRE_DECIMALS, NOTHING

SHELL_C = (-50.0, 150.0)


def checks(number):
    """Lines that say of each input whether it can be used."""
    listed = "MATCH([product],product_groups,0)"
    code = f"IF(ISBLANK([product]),0,IF(ISNUMBER({listed}),{listed},-1))"
    state = "IF([product_code]=0,#product_none,IF([product_code]<0,#product_unknown,#fine))"
    shell = _check("shell", SHELL_C, "#shell_blank", good="#shell_fine")
    return [
        Line("shell_state", shell, number("shell_fine"), 0),
        Line("product_code", code, 0, 0),
        Line("product_state", state, number("product_none"), 0),
        *(Line(f"{key}_state", check, number("not_used"), 0) for key, check in _of_product()),
    ]


def _of_product():
    """(input, formula of its check) of those that a product needs."""
    ranges = [(product.from_kg_m3, product.to_kg_m3) for product in PRODUCTS]
    ranges.append((products.LEAST_KG_M3, products.MOST_KG_M3))
    densities = [
        f"CHOOSE([product_code],{','.join(repr(end) for end in ends)})"
        for ends in zip(*ranges, strict=True)
    ]
    blank = f"IF([product_code]={OWN_FACTOR},#density_left_out,#density_blank)"
    yield "density", _unless("[product_code]<1", _check("density", densities, blank))
    liquid = _check("liquid", (products.LEAST_C, products.MOST_C), "#liquid_blank")
    yield "liquid", _unless(f"OR([product_code]<1,[product_code]={OWN_FACTOR})", liquid)
    factors = products.LEAST_FACTOR, products.MOST_FACTOR
    factor = _check("factor", factors, "#factor_blank")
    yield "factor", _unless(f"[product_code]<>{OWN_FACTOR}", factor)


def _unless(unused, check):
    return f"IF({unused},#not_used,{check})"


def _check(key, ends, blank, good="#fine"):
    """The formula of the number of the sentence that is true of an input."""
    cell, (low, high) = f"[{key}]", ends
    return (
        f"IF(ISBLANK({cell}),{blank},IF({is_no_number(cell)},#no_number,"
        f"IF(OR({cell}<{low},{cell}>{high}),#{key}_range,{good})))"
    )


def product_lines():
    """Lines of the workings: expansion, factor, density of the liquid as it is in the tank."""
    good, none = "[good_density]", f'"{NOTHING}"'
    expansions = ",".join(product.expansion(good) for product in PRODUCTS)
    of_group = f"AND([product_code]>0,[product_code]<{OWN_FACTOR},[liquid_state]=#fine)"
    own = f"IF([factor_state]=#fine,[factor],{none})"
    computed = if_number("[expansion]", products.factor("[expansion]", "[liquid]"))
    return [
        Line("good_density", f"IF([density_state]=#fine,[density],{none})", NOTHING, 1, "kg/m³"),
        Line(
            "expansion",
            if_number(good, f"IF({of_group},CHOOSE([product_code],{expansions}),{none})"),
            NOTHING,
            "0.000000E+00",
            "1/K",
        ),
        Line("vcf", f"IF([product_code]={OWN_FACTOR},{own},{computed})", NOTHING, 6),
        Line("liquid_density", _if_both(good, "[vcf]", f"{good}*[vcf]"), NOTHING, 2, "kg/m³"),
    ]


def _if_both(one, other, expression):
    return f'IF(AND(ISNUMBER({one}),ISNUMBER({other})),{expression},"{NOTHING}")'


def head_lines(table, number, label):
    """Lines of the workings: the volume for each density, and what the head adds to the table.

    label  function of a density, names its line
    """
    volumes = []
    densities = table.densities
    for place, density in enumerate(densities[1:], start=2):
        low, high = (f"INDEX({name_of_density(place)},[dip_{end}])" for end in ("row", "next"))
        volume = table.record["densities"][place - 2]["volume_m3"][table.at]
        floating = ""
        if table.critical is not None:  # the roof is added by its own line
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
    head = f"IF([head_state]=#head_applied,{_between(densities, known)}-[dip_volume],0)"
    head = f'IF([head_state]=#head_outside,"{NOTHING}",{head})'
    return [
        *volumes,
        Line("head_state", state, number("head_unknown"), 0),
        Line("head_m3", if_number("[dip_row]", head), 0, LITRE_DECIMALS, "m³"),
    ]


def _between(densities, density):
    """The formula of the volume at a density, linear between the two nearest of the record."""
    cells = ["[dip_volume]", *(f"[density_{i}]" for i in range(2, len(densities) + 1))]
    ordered = sorted(zip(densities, cells, strict=True))
    formula = ""
    for (low, of_low), (high, of_high) in reversed(list(pairwise(ordered))):
        part = f"{of_low}+({density}-{low!r})/{high - low!r}*({of_high}-{of_low})"
        formula = f"IF({density}<={high!r},{part},{formula})" if formula else part
    return formula


def roof_lines(table):
    """The line of the workings with the correction of a floating roof, where there is one."""
    if table.critical is None:
        return []
    afloat = when_afloat(table, draught_m3(table, "[liquid_density]"))
    known = f"IF(ISNUMBER([liquid_density]),{afloat},0)"
    return [Line("roof_m3", if_number("[dip_row]", known), 0, LITRE_DECIMALS, "m³")]


def draught_m3(table, density):
    """The formula of what the roof takes less of a liquid of this density than of the table's."""
    roof = roof_of(table.record)
    air = AIR_KG_M3 if roof["roof_weighing"] == "air" else 0.0
    mass = f"{roof['roof_mass']!r}*(1-{air!r}/{WEIGHTS_KG_M3!r})"
    reference = roof["roof_reference_density"]
    return f"{mass}*(1/({reference!r}-{air!r})-1/({density}-{air!r}))"


def when_afloat(table, expression):
    """The formula of what counts only above the critical zone of the roof."""
    return f"IF([dip]>={table.critical[1]!r}-{NANOMETRE},{expression},0)"


def _roof_at_opening(table, density):
    """m3: `draught_m3` of a density at the dip with which the calculator opens."""
    if table.height_m[table.at] < table.critical[1]:
        return 0.0
    roof = roof_of(table.record)
    sizes = (roof["roof_mass"], *table.critical, roof["roof_reference_density"])
    return floating_roof(*sizes, roof["roof_weighing"]).density_correction_m3(density)


def results(table):
    """Lines of the result: volume in service, volume at the product's own temperature, masses."""
    base = table.job["table"]["reference_temperature_c"]
    step = f"{table.job['material']['expansion_per_k']!r}*([shell]-{base!r})"
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
