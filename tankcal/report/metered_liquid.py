"""Sentences on the calibrating liquid and on errors that its steps do not detect."""

from tankcal.report import numbers

HIDDEN_U = 2.0  # change of a volume by an undetected error, in U, above which page 1 reports it
# Unit of a control in the record and unit in the papers.
SHOWN = {"1": "share ppm", "m3/h": "L/h", "m3": "L"}


def metered_liquid_text(paper, liquid):
    """Return density and thermal expansion of the liquid, each with its u, in words."""
    return paper.word(
        "texts.liquid_liquid",
        density=density_text(paper, liquid),
        expansion=with_u(paper, liquid, "expansion_per_k", "1/K"),
    )


def density_text(paper, liquid):
    """Return the density in words, such as "998.20(20) kg/m³ at 20.0 °C"."""
    density = with_u(paper, liquid, "density_kg_m3", "kg/m3")
    at = paper.number(liquid["density_c"], "degC", digits=3)
    return paper.word("texts.liquid_density", density=density, temperature=at)


def with_u(paper, liquid, key, unit):
    """Return a value with its standard uncertainty, such as "998.20(20) kg/m³".

    Parameters
    ----------
    paper : Paper
        Formatter.
    liquid : dict
        Part "liquid" of the record.
    key : str
        Key of the value; u_KEY is its standard uncertainty.
    unit : str
        Unit, a key of numbers.UNITS.

    Returns
    -------
    str
    """
    concise = numbers.concise(liquid[key], liquid[f"u_{key}"], paper.marks)
    return f"{concise}\N{NO-BREAK SPACE}{numbers.unit(unit).symbol}"


def hidden_errors(paper):
    """Return sentences on undetected errors that change a volume by more than 2 U."""
    liquid = paper.record.get("liquid") or {}
    # A proving after the runs detects errors of the meter factor.
    proved = {
        meter["meter"] for meter in liquid.get("meters", ()) if meter["factor_after"] is not None
    }
    return [
        control_text(paper, control)
        for control in liquid.get("controls") or ()
        if control["of"] not in proved
        and (control["undetected_U"] is None or control["undetected_U"] > HIDDEN_U)
    ]


def control_text(paper, control):
    """Return a sentence on the largest undetected error and its effect on the volumes."""
    name, given = f"texts.liquid_hidden_{control['kind']}", {"of": control["of"]}
    if control["detectable"] is None or control["undetected_U"] is None:
        return paper.word(f"{name}_any", **given)
    size = paper.number(control["detectable"], SHOWN[control["unit"]], digits=2)
    return paper.word(
        name, **given, size=size, times=paper.number(control["undetected_U"], decimals=1)
    )
