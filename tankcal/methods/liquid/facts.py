"""Facts of a calibration by liquid, and sentences on errors that its steps do not detect."""

from tankcal.report import numbers
from tankcal.report.tables.table import Column

HIDDEN_U = 2.0  # change of a volume by an undetected error, in U, above which page 1 reports it
# Unit of a control in the record and unit in the documents.
SHOWN = {"1": "share ppm", "m3/h": "L/h", "m3": "L"}


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


def _metered(paper, row):
    """Return a sentence on runs, steps and range of dips of a calibration by liquid, or None."""
    liquid = paper.record.get("liquid")
    if not liquid:
        return None
    low, high = (paper.height(liquid[f"{end}_dip_m"]) for end in ("lowest", "highest"))
    counts = {"runs": len(liquid["runs"]), "steps": len(liquid["steps"])}
    return paper.word("texts.liquid_metered", **counts, low=low, high=high)


def _metered_liquid(paper, row):
    """Return density and thermal expansion of the liquid, each with its u, in words, or None."""
    liquid = paper.record.get("liquid")
    return liquid and paper.word(
        "texts.liquid_liquid",
        density=density_text(paper, liquid),
        expansion=with_u(paper, liquid, "expansion_per_k", "1/K"),
    )


def _metered_with(paper, row):
    """Return the meters with their factors and provers in words, or None."""
    liquid = paper.record.get("liquid")
    return liquid and "; ".join(_meter(paper, meter) for meter in liquid["meters"])


def _meter(paper, meter):
    factor, u = (paper.number(meter[key], u=meter["u_factor"]) for key in ("factor", "u_factor"))
    text = paper.word("texts.liquid_meter", name=meter["meter"], factor=factor, u=u)
    if not meter["prover"]:
        return text
    return paper.word("texts.liquid_prover", meter=text, prover=meter["prover"])


def _metered_table(paper, row):
    liquid = paper.record.get("liquid")
    return liquid and paper.word(f"liquid_tables.{liquid['certified']}")


FACTS = (  # of certificate and workbook
    Column("metered", text=_metered, sheet=True),
    Column("metered_liquid", text=_metered_liquid, sheet=True),
    Column("metered_with", text=_metered_with, sheet=True),
    Column("metered_table", text=_metered_table, sheet=True),
)
