"""Blocks and tables of a ticket, for paper, web page, workbook and CSV."""

import io

from tankcal.errors import InputError, Problem
from tankcal.messages import message
from tankcal.report import blocks
from tankcal.report.attachments import sha256
from tankcal.report.folders import replace_file
from tankcal.report.plain_formulas import STEP_FORMULAS
from tankcal.report.tables import Column, Table
from tankcal.tank.gauging import KEY_OF_INPUT, UNITS_OF_U, assumed_u_vcf
from tankcal.tank.volume_correction.petroleum import BASE_NAMES
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


def _code_column(key, group, width=22):
    return Column(key, text=lambda paper, row: paper.words[group][row[key]], csv=key, sheet=True,
                  width=width)  # fmt: skip


def _figure(key, **more):
    return Column(key, decimals=6, csv=key, sheet=True, width=14, **more)


QUANTITIES = Table(
    "ticket_quantities",
    (
        _code_column("state", "states"),
        _code_column("quantity", "quantities", 30),
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
        _code_column("origin", "origins"),
    ),
    rows=lambda saved: saved["uncertainties"],
)


DIGEST = 16  # number of printed digits of the SHA-256 of the record
ACROSS = 2  # parts of the budget side by side


def pages(paper, folder=None, whole=False):
    """Return the blocks of a TicketPaper.

    Parameters
    ----------
    paper : TicketPaper
    folder : Path, optional
        Folder of the files that the PDF embeds; None: no files.
    whole : bool, optional
        Whether the blocks are for the web page, which has more space.

    Returns
    -------
    list of Block
    """
    is_stock = len(paper.record["gaugings"]) == 1
    steps = paper.show(STEPS.only("step", "formula", "source", "closing") if is_stock else STEPS)
    return [
        *paper.head(folder),
        blocks.side_by_side(_show_facts(paper, _head(paper))),
        blocks.result(label_text(paper), result_text(paper), comparison_text(paper)),
        paper.show(RESULTS, result_rows(paper)),
        paper.facts([*_gaugings(paper), *room_texts(paper)]),
        blocks.side_by_side(paper.facts(_properties(paper))),
        steps if whole else blocks.whole(steps),
        paper.show(
            BUDGET, budget_rows(paper), across=None if whole else ACROSS,
            state=paper.words["states"][paper.state],
        ),
        *([blocks.paragraph(checks)] if (checks := warnings_text(paper)) else []),
        blocks.paragraph(" ".join(notes(paper))),
        *_qr_code(paper, folder),
        blocks.signature(
            [paper.word(f"signatures.{role}") for role in ("delivered", "received")],
            paper.word("dcc.sign_here"),
        ),
    ]  # fmt: skip


def _head(paper):
    """Return the facts on the ticket, the table and the volume correction."""
    saved, table = paper.record, paper.record["table"]
    certificate = " · ".join(filter(None, (table["number"], paper.day(table["date"][:10]))))
    return [
        ("ticket_number", saved["number"]),
        ("ticket_date", paper.day(saved["date"])),
        ("ticket_by", saved["by"]),
        ("customer", saved["customer"]),
        ("ticket_tank", saved["tank"]),
        ("ticket_certificate", certificate),
        ("product", saved["product"]),
        ("correction", paper.correction()),
        ("note", saved["note"]),
    ]


def _show_facts(paper, facts):
    """Return the facts; without a value, a line to write on (except for the remark)."""
    return blocks.key_values(
        [(paper.label(key), value or "") for key, value in facts if value or key != "note"]
    )


def label_text(paper):
    """Return the name of the main result and its state."""
    quantity, state = paper.words["quantities"]["nsv_m3"], paper.words["states"][paper.state]
    return f"{quantity[0].upper()}{quantity[1:]} (NSV), {state}"


def result_text(paper):
    """Return the net standard volume with U, k and probability."""
    saved = paper.quantity(paper.state, "nsv_m3")
    written = format_with_u(saved["value"], saved["U"], paper.marks)
    return paper.word(
        "texts.result",
        value=written.value,
        U=written.uncertainty,
        k=fixed(saved["k"], 2, paper.marks),
        dof=dof_text(paper, saved["dof"]),
        probability=paper.percent(paper.record["probability"]),
    )


def comparison_text(paper):
    """Return the comparison with the other party as a sentence, or ""."""
    comparison = paper.record["comparison"]
    if comparison is None:
        return ""
    unit = unit_symbol(QUANTITY_UNITS[comparison["quantity"]])
    values = {
        "quantity": paper.words["quantities"][comparison["quantity"]],
        "source": comparison["source"] or paper.word("texts.other_party"),
        "difference": fixed(comparison["difference"], 2, paper.marks),
        "value": shortest(comparison["value"], paper.marks),
        "unit": unit,
    }
    if comparison["e_n"] is None:
        return paper.word("texts.difference", **values)
    return paper.word(
        "texts.compared",
        U=shortest(comparison["U"], paper.marks),
        e_n=fixed(comparison["e_n"], 2, paper.marks),
        decision=paper.words["agreement"][str(comparison["agrees"])],
        **values,
    )


def _gaugings(paper):
    """Return the readings of the gaugings."""
    return [(f"gauging_{row['state']}", _gauging(paper, row)) for row in paper.record["gaugings"]]


def room_texts(paper):
    """Return (key of the label, text) of the volumes to the operating levels."""
    texts = []
    for row in paper.record.get("rooms") or ():
        written = format_with_u(row["value"], row["U"], paper.marks)
        text = paper.word(
            "texts.room",
            value=written.value,
            U=written.uncertainty,
            k=fixed(row["k"], 2, paper.marks),
            level=paper.height(row["level_m"]),
        )
        texts.append((f"ticket_{row['name']}", text))
    return texts


def _properties(paper):
    """Return the properties of the product and of the shell."""
    saved = paper.record
    density = _reading(paper, saved["density_kg_m3"], "kg/m3")
    if saved["density_temperature_c"] is not None:
        celsius = paper.plain(saved["density_temperature_c"], "°C")
        scale = saved["inputs"]["product"].get("hydrometer")  # such as "glass 20C"
        key = "texts.density_by_glass" if scale else "texts.density_observed"
        scale = BASE_NAMES[scale.split()[-1]] if scale else None
        density = paper.word(key, density=density, temperature=celsius, scale=scale)
    else:
        celsius = paper.plain(round(saved["base_c"], 2), "°C")
        density = paper.word("texts.density_at_base", density=density, temperature=celsius)
    share = paper.plain(saved["sw_percent"], "%")
    expansion = paper.word(
        "texts.expansion",
        expansion=paper.plain(saved["table"]["expansion_per_k"], "1/K"),
        temperature=paper.plain(saved["table"]["temperature_c"], "°C"),
    )
    return [("density", density), ("sw", share), ("ticket_shell", expansion)]


def _gauging(paper, row):
    """Return the readings of a gauging as a text."""
    words = paper.words["readings"]
    readings = [
        ("ullage", paper.height(row["ullage_m"])),
        ("dip", paper.height(row["level_m"])),
        ("water", paper.height(row["water_dip_m"])),
        ("liquid", _reading(paper, row["temperature_c"], "degC")),
        ("air", _reading(paper, row["ambient_c"], "degC")),
        ("pressure", paper.plain(row["pressure_kpa"] or None, "kPa")),
    ]
    return ", ".join(f"{words[key]} {text}" for key, text in readings if text is not None)


def _reading(paper, value, unit):
    """Return a reading with at least one decimal and all declared decimals."""
    if value is None:
        return None
    exact = round(value, 4)
    decimals = next((d for d in (1, 2, 3) if round(value, d) == exact), 4)
    return paper.number(value, unit, decimals=decimals)


def notes(paper):
    """Return the sentences below the tables: sources, origins, effects outside U, record."""
    saved = paper.record
    origins = {row["origin"] for row in saved["uncertainties"]}
    texts = [paper.word("texts.sources")]
    if origins & {"memory", "assumed"}:
        texts.append(paper.word("texts.assumed"))
    outside = "; ".join(paper.words["not_in_u"][code] for code in saved["not_in_u"])
    texts.append(paper.word("texts.not_in_u", effects=outside))
    texts.append(paper.word("texts.record", digest=saved["table"]["sha256"][:DIGEST]))
    return texts


def warnings_text(paper):
    """Return the warnings in a sentence, or ""."""
    warnings = "; ".join(map(paper.warning, paper.record["warnings"]))
    check = paper.word("texts.warning")
    return f"{check} {warnings}" if warnings else ""


def _qr_code(paper, folder):
    """Return the QR code of ticket.json; none without the file."""
    if folder is None:
        return []
    digest = sha256((folder / paper.file).read_bytes())
    return [blocks.hash_code(digest, paper.word("texts.hash_of"), paper.words["dcc"]["code_alt"])]


# ---- booklet of standard volumes

BOOKLET = "tickets.pdf"
FILE, PDF = "ticket.json", "ticket.pdf"  # of each ticket
_CREATOR = "tankcal ticket"  # identifies a booklet, which may be replaced


def refuse_foreign_booklet(path):
    """Refuse to replace a file that `write_booklet` did not write.

    Raises
    ------
    InputError
    """
    import pypdf

    if not path.exists():
        return
    try:
        metadata = pypdf.PdfReader(path).metadata or {}
        if metadata.get("/Creator") == _CREATOR:
            return
    except (pypdf.errors.PyPdfError, OSError, ValueError):
        pass  # no PDF
    text = message(
        "ticket_booklet_exists",
        "found a file that tankcal ticket did not write; expected another folder",
    )
    raise InputError(Problem(path.name, text))


def write_booklet(documents, path, title):
    """Write the pages of many tickets as a single PDF, with a bookmark for each ticket.

    Parameters
    ----------
    documents : list of (str, Path)
        Number and folder of each ticket.
    path : Path
    title : str

    Raises
    ------
    InputError
        For an existing file of another origin.
    """
    import pypdf

    refuse_foreign_booklet(path)
    writer = pypdf.PdfWriter()
    for number, folder in documents:
        writer.add_attachment(f"{folder.name}/{FILE}", (folder / FILE).read_bytes())
        reader = pypdf.PdfReader(io.BytesIO((folder / PDF).read_bytes()))
        for place, page in enumerate(reader.pages):
            writer.add_page(page, excluded_keys=["/Annots", "/StructParents", "/Tabs"])
            if place == 0:
                writer.add_outline_item(title=number, page_number=len(writer.pages) - 1)
    writer.compress_identical_objects()  # fonts and letterhead are common to all pages
    writer.add_metadata({"/Title": title, "/Creator": _CREATOR, "/Producer": "pypdf"})
    with replace_file(path) as temporary:
        writer.write(temporary)
