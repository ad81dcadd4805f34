"""The calibrating liquid, and what its steps would not show, in sentences of the papers."""

from tankcal.report import numbers

HIDDEN_U = 2.0  # change of a volume, in its U, by an error that no test shows: more is on page 1
SHOWN = {"1": "share ppm", "m3/h": "L/h", "m3": "L"}


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


def hidden_errors(paper):
    """Sentences on errors that no test shows and that change a volume by more than 2 U."""
    liquid = paper.record.get("liquid") or {}
    proved = {one["meter"] for one in liquid.get("meters", ()) if one["factor_after"] is not None}
    return [
        control_text(paper, one)
        for one in liquid.get("controls") or ()
        if one["of"] not in proved
        and (one["undetected_U"] is None or one["undetected_U"] > HIDDEN_U)
    ]


def control_text(paper, control):
    """How large an error of all volumes the steps would not show, and what it changes."""
    name, given = f"texts.liquid_hidden_{control['kind']}", {"of": control["of"]}
    if control["detectable"] is None or control["undetected_U"] is None:
        return paper.word(f"{name}_any", **given)
    size = paper.number(control["detectable"], SHOWN[control["unit"]], digits=2)
    return paper.word(
        name, **given, size=size, times=paper.number(control["undetected_U"], decimals=1)
    )
