"""The calibrating liquid, as a sentence of certificate and working papers."""

from tankcal.report import numbers


def metered_liquid_text(paper, liquid):
    """Density at its temperature and thermal expansion, each with its u, of the record's liquid."""
    return paper.word(
        "texts.liquid_liquid",
        density=density_text(paper, liquid),
        expansion=with_u(paper, liquid, "expansion_per_k", "1/K"),
    )


def density_text(paper, liquid):
    """Such as "998.20(20) kg/m³ at 20.0 °C"."""
    density = with_u(paper, liquid, "density_kg_m3", "kg/m3")
    at = paper.number(liquid["density_c"], "degC", digits=3)
    return paper.word("texts.liquid_density", density=density, temperature=at)


def with_u(paper, liquid, key, unit):
    """A value with its standard uncertainty, as "998.20(20) kg/m³"."""
    concise = numbers.concise(liquid[key], liquid[f"u_{key}"], paper.marks)
    return f"{concise}\N{NO-BREAK SPACE}{numbers.unit(unit).symbol}"
