"""Blocks of a ticket: a page to be signed."""

import io

from tankcal.errors import InputError, Problem
from tankcal.messages import message
from tankcal.report import blocks
from tankcal.report.attachments import sha256
from tankcal.report.folders import replace_file
from tankcal.report.ticket.tables import (
    BUDGET,
    QUANTITY_UNITS,
    RESULTS,
    STEPS,
    budget_rows,
    dof_text,
    result_rows,
    unit_symbol,
)
from tankcal.tank.volume_correction.petroleum import BASE_NAMES
from tankcal.text.digits import fixed, format_with_u, shortest

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
        *_code(paper, folder),
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


def _code(paper, folder):
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
