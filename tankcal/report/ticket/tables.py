"""Tables of a ticket, declared once for PDF, web page, workbook and CSV, and their rows."""

from tankcal.report.plain_formulas import STEP_FORMULAS
from tankcal.report.tables import Column, Table
from tankcal.tank.gauging import KEY_OF_INPUT, UNITS_OF_U, assumed_u_vcf
from tankcal.text.digits import NOTHING, fixed, format_with_u, shortest

QUANTITY_UNITS = {  # in the order of the calculation
    **dict.fromkeys(("tov_m3", "gov_m3", "gsv_m3", "nsv_m3"), "m3"),
    **dict.fromkeys(("mass_kg", "weight_kg"), "kg"),
}
STEP_DECIMALS = {"m3": 3, "kg": 1, "kg/m3": 2, "degC": 2, "": 6}
_PRINTED_UNITS = {"m3": "m³", "kg/m3": "kg/m³", "degC": "°C"}


def unit_symbol(unit):
    """Return the printed form of a unit of the ticket."""
    return _PRINTED_UNITS.get(unit, unit)


def formula_of(saved, step):
    """Return the formula of a step, as it applies to this ticket."""
    table = saved["table"]
    if step == "ctsh" and table["kind"] != "vertical":
        step = "ctsh_solid"
    elif step == "shell_c" and saved["insulated"]:
        step = "shell_c_insulated"
    elif step == "base_density" and saved["density_is"] == "observed":
        step = "base_density_observed"
    elif step == "fra_m3" and table["roof"]:
        step = f"fra_m3_{table['roof']}"
    return STEP_FORMULAS[step]


def source_of(paper, step):
    """Return the source of a step in words."""
    saved = paper.record
    sources = paper.words["sources"]
    if step in ("tov_m3", "fw_m3"):
        return sources["table"]
    if step == "vcf" or (step == "base_density" and saved["density_is"] == "observed"):
        return paper.correction()
    if step == "base_density":
        return sources["declared"]
    if step == "fra_m3":
        return sources["record"] if saved["table"]["roof"] else sources["no_roof"]
    if step == "air_factor":
        return paper.word(
            "sources.air",
            air=shortest(saved["air_kg_m3"], paper.marks),
            weights=shortest(saved["weights_kg_m3"], paper.marks),
        )
    if step in ("observed_density", "mass_kg", "weight_kg"):
        return sources["definition"]
    if step == "ctsh" and saved["table"]["kind"] != "vertical":
        return sources["solid"]
    return sources["api"]


def _step_value(key):
    def text(paper, row):
        if row[key] is None:
            return None
        return fixed(row[key], STEP_DECIMALS[row["unit"]], paper.marks)

    return text


def step_text(paper, row, states):
    """Return the name of a step with its values in some states and its unit."""
    name = paper.words["steps"][row["step"]]
    values = "; ".join(_step_value(state)(paper, row) for state in states)
    return f"{name}: {values} {unit_symbol(row['unit'])}".strip()


def _step_name(paper, row):
    unit = unit_symbol(row["unit"])
    name = paper.words["steps"][row["step"]]
    return f"{name} / {unit}" if unit else name


STEPS = Table(
    "ticket_steps",
    (
        Column("step", text=_step_name, csv="step", sheet=True, width=36),
        Column("formula", text=lambda paper, row: formula_of(paper.record, row["step"]),
               formulas=True, sheet=True, width=30),
        Column("source", text=lambda paper, row: source_of(paper, row["step"]), sheet=True,
               width=34),
        Column("unit", csv="unit", on=""),
        Column("opening", text=_step_value("opening"), align="right", csv="opening", sheet=True,
               in_sheet={"text": None, "decimals": 6}),
        Column("closing", text=_step_value("closing"), align="right", csv="closing", sheet=True,
               in_sheet={"text": None, "decimals": 6}),
    ),
    rows=lambda saved: saved["steps"],
    csv_style="%.15g",
)  # fmt: skip


def _code(key, group, width=22):
    return Column(key, text=lambda paper, row: paper.words[group][row[key]], csv=key, sheet=True,
                  width=width)  # fmt: skip


def _figure(key, **more):
    return Column(key, decimals=6, csv=key, sheet=True, width=14, **more)


QUANTITIES = Table(
    "ticket_quantities",
    (
        _code("state", "states"),
        _code("quantity", "quantities", 30),
        Column("unit", text=lambda paper, row: unit_symbol(QUANTITY_UNITS[row["quantity"]]),
               sheet=True, width=7),
        _figure("value"),
        _figure("u"),
        Column("dof", decimals=1, nothing="∞", csv="dof", sheet=True),
        Column("k", decimals=4, csv="k", sheet=True),
        _figure("U"),
    ),
    rows=lambda saved: saved["quantities"],
    csv_style="%.15g",
)  # fmt: skip


def result_rows(paper):
    """Return rows of RESULTS: a row for each quantity, with the texts of all states."""
    rows = []
    for name, unit in QUANTITY_UNITS.items():
        row = {"quantity": name, "unit": unit_symbol(unit)}
        for state in ("opening", "closing", "moved"):
            if not any(saved["state"] == state for saved in paper.record["quantities"]):
                continue
            saved = paper.quantity(state, name)
            written = format_with_u(saved["value"], saved["U"], paper.marks)
            row |= {state: written.value, f"U_{state}": written.uncertainty}
            row |= {"k": fixed(saved["k"], 2, paper.marks), "dof": dof_text(paper, saved["dof"])}
        rows.append(row)
    return rows


def dof_text(paper, dof):
    """Return effective degrees of freedom as text, rounded down; "∞" above 10 000."""
    return "∞" if dof is None or dof > 10_000 else fixed(int(dof), 0, paper.marks)


def _ready(key, **more):
    return Column(key, text=lambda paper, row: row[key], align="right", optional=True, **more)


RESULTS = Table(
    "ticket_results",
    (
        Column("quantity", text=lambda paper, row: paper.words["quantities"][row["quantity"]]),
        Column("unit", text=lambda paper, row: row["unit"]),
        _ready("opening"),
        _ready("U_opening", heading="U"),
        _ready("closing"),
        _ready("U_closing", heading="U"),
        _ready("moved"),
        _ready("U_moved", heading="U"),
        _ready("k"),
        _ready("dof"),
    ),
)


def _u_of_input(paper, row):
    """Return the standard uncertainty of an input with its unit."""
    key = KEY_OF_INPUT.get(row["input"])
    if key is None:
        return None
    value = _uncertainty(paper, key)["value"]
    if value is None:  # by the rule, at the temperature of each gauging
        base_c, gaugings = paper.record["base_c"], paper.record["gaugings"]
        each = [abs(100 * assumed_u_vcf(row["temperature_c"], base_c)) for row in gaugings]
        text = "; ".join(fixed(percent, 3, paper.marks) for percent in each)
        return f"{text} {UNITS_OF_U[key]}"
    text = shortest(value, paper.marks)
    return f"{text} {UNITS_OF_U[key]}"


def origin_text(paper, row):
    """Return whether u of an input was declared, assumed or taken from the record."""
    key = KEY_OF_INPUT.get(row["input"])
    origin = "record" if key is None else _uncertainty(paper, key)["origin"]
    return paper.words["origins"][origin]


def _uncertainty(paper, key):
    return next(row for row in paper.record["uncertainties"] if row["name"] == key)


def budget_rows(paper, quantity="nsv_m3"):
    """Return the contributions to a quantity of the main result, the largest first."""
    return [
        row
        for row in paper.record["budget"]
        if (row["state"], row["quantity"]) == (paper.state, quantity) and row["contribution"] != 0
    ]


BUDGET = Table(
    "ticket_budget",
    (
        Column("state", text=lambda paper, row: paper.words["states"][row["state"]], csv="state",
               sheet=True, width=22, on=""),
        Column("quantity", text=lambda paper, row: paper.words["quantities"][row["quantity"]],
               csv="quantity", sheet=True, width=30, on=""),
        Column("input", text=lambda paper, row: paper.input_name(row), csv="input", sheet=True,
               width=36),
        Column("gauging", csv="gauging", on=""),
        Column("u_input", text=_u_of_input, sheet=True, width=14,
               align="right"),
        Column("origin", text=origin_text, sheet=True, width=16),
        Column("contribution", decimals=3, csv="contribution", sheet="contribution", width=14,
               in_sheet={"decimals": 6}),
        Column("share", "share", decimals=1, csv="share", sheet=True),
    ),
    rows=lambda saved: [row for row in saved["budget"] if row["contribution"] != 0],
    csv_style="%.15g",
)  # fmt: skip


UNCERTAINTIES = Table(
    "ticket_uncertainties",
    (
        Column("name", text=lambda paper, row: row["name"], csv="name", sheet=True, width=22),
        Column("value", digits=4, csv="value", sheet=True, nothing=NOTHING),
        Column("unit", text=lambda paper, row: UNITS_OF_U[row["name"]], sheet=True, width=8),
        _code("origin", "origins"),
    ),
    rows=lambda saved: saved["uncertainties"],
)
