"""The saved form of a ticket."""

from dataclasses import fields

import numpy as np

from tankcal.errors import InputError, Problem
from tankcal.messages import message
from tankcal.products.quantity.chain import QUANTITIES, STATES
from tankcal.products.quantity.results import compare
from tankcal.products.settings import drop_blanks
from tankcal.record.schema import warnings_of
from tankcal.record.ticket import (
    ComparisonOfTicket,
    ContributionToTicket,
    FactorsOfTicket,
    GaugingOfTicket,
    QuantityOfTicket,
    RoomOfTicket,
    StepOfTicket,
    TableOfTicket,
    TicketFile,
    TicketFileEntry,
    UncertaintyOfTicket,
)
from tankcal.tank.gauging import ASSUMPTIONS, KEY_OF_INPUT
from tankcal.tank.volume_correction.corrections import FactorTable

UNITS = {  # of the steps; others have no unit
    **dict.fromkeys(("tov_m3", "fw_m3", "fra_m3", "gov_m3", "gsv_m3", "nsv_m3"), "m3"),
    **dict.fromkeys(("base_density", "observed_density"), "kg/m3"),
    **dict.fromkeys(("mass_kg", "weight_kg"), "kg"),
    "shell_c": "degC",
}


def ticket_file(tickets):
    """Return the saved form of a single ticket.

    Parameters
    ----------
    tickets : Tickets
        A single ticket of `read_tickets`.

    Returns
    -------
    TicketFile
    """
    sections, transfer = tickets.sections, tickets.transfer
    head, product = sections["ticket"], sections["product"]
    table, correction = transfer.table, transfer.product.correction
    quantities = tickets.quantities
    return TicketFile(
        notice=table.certificate.get("notice") or "",
        tank=table.tank,
        number=tickets.names[0],
        date=head["date"],
        by=head["by"],
        customer=head["customer"],
        product=product["name"],
        note=head["note"],
        probability=transfer.probability,
        table=_table(table, transfer.product),
        correction=correction.name,
        base_c=float(correction.base_c),
        density_kg_m3=product["density_kg_m3"],
        density_is=product["density_is"],
        density_temperature_c=product["density_temperature_c"],
        sw_percent=product["sw_percent"],
        air_kg_m3=transfer.product.air_kg_m3,
        weights_kg_m3=transfer.product.weights_kg_m3,
        insulated=transfer.product.is_insulated,
        gaugings=[_gauging(sections, transfer, state) for state in transfer.gaugings],
        steps=_steps(transfer.steps),
        quantities=[
            QuantityOfTicket(
                state,
                name,
                *map(float, (result.value[0, at], result.u[0, at])),
                _number(result.dof[0, at]),
                *map(float, (result.k[0, at], result.U[0, at])),
            )
            for state, result in quantities.items()
            for at, name in enumerate(QUANTITIES)
        ],
        rooms=_rooms(transfer),
        budget=_budget(quantities),
        uncertainties=_uncertainties(sections["uncertainty"], quantities),
        comparison=_comparison(tickets),
        not_in_u=_not_in_u(sections, table),
        factors=_factors(correction),
        inputs=drop_blanks(sections),
        files=[TicketFileEntry(name, digest) for name, digest in tickets.files.items()],
        warnings=warnings_of(tickets.warnings),
    )


def document_file(tickets):
    """Return the saved form of a ticket that is to be signed, with its number and date.

    Raises
    ------
    InputError
        If `number` or `date` is missing.
    """
    head = tickets.sections["ticket"]
    expected = message("ticket_for_document", "missing; expected for the document of a ticket")
    problems = [
        Problem(tickets.settings_name, expected, column=f"ticket.{key}")
        for key in ("number", "date")
        if head[key] is None
    ]
    if problems:
        raise InputError(problems)
    return ticket_file(tickets)


def _number(value):
    return float(value) if np.isfinite(value) else None


def _table(table, product):
    roof = "in_table" if table.is_roof_in_table else "not_in_table"
    return TableOfTicket(
        table.digest,
        table.kind,
        table.certificate.get("number") or None,
        table.certificate.get("laboratory") or None,
        table.date,
        table.temperature_c,
        float(product.expansion_per_k[0]),
        table.reference_height_m,
        None if table.roof is None else roof,
    )


def _gauging(sections, transfer, state):
    gauging = transfer.gaugings[state]
    return GaugingOfTicket(
        state,
        float(gauging.level_m[0]),
        sections[state]["ullage_m"],
        _number(gauging.water_m[0]),
        float(gauging.temperature_c[0]),
        None if transfer.product.is_insulated else _number(gauging.ambient_c[0]),
        float(gauging.pressure_kpa[0]),
    )


def _steps(steps):
    closing, opening = steps["closing"], steps.get("opening")
    return [
        StepOfTicket(
            step.name,
            UNITS.get(step.name, ""),
            None if opening is None else float(getattr(opening, step.name)[0]),
            float(getattr(closing, step.name)[0]),
        )
        for step in fields(closing)
    ]


def _rooms(transfer):
    if not transfer.room_levels:
        return None
    result = transfer.rooms()
    return [
        RoomOfTicket(
            name, dip, *map(float, (result.value[0, at], result.u[0, at])),
            _number(result.dof[0, at]), *map(float, (result.k[0, at], result.U[0, at])),
        )
        for at, (name, dip) in enumerate(transfer.room_levels.items())
    ]  # fmt: skip


def _budget(quantities):
    rows = []
    for state, result in quantities.items():
        for at, quantity in enumerate(QUANTITIES):
            variance = result.u[0, at] ** 2
            parts = [(float(part[0, at]), name) for name, part in result.contributions.items()]
            for part, name in sorted(parts, key=lambda part: -abs(part[0])):
                share = part**2 / variance if variance > 0 else 0.0
                rows.append(
                    ContributionToTicket(state, quantity, *_split(name), part, float(share))
                )
    return rows


def _split(name):
    """(input, gauging or None) of the name of an input."""
    first, _, last = name.rpartition(" ")
    return (first, last) if last in STATES else (name, None)


def _uncertainties(declared, quantities):
    """Uncertainties of the inputs that contribute to a quantity."""
    used = {
        KEY_OF_INPUT.get(_split(name)[0])
        for result in quantities.values()
        for name, part in result.contributions.items()
        if np.any(part != 0)
    }
    rows = []
    for name, (assumed, origin) in ASSUMPTIONS.items():
        if name in used:
            is_declared = declared[name] is not None
            value = declared[name] if is_declared else assumed
            rows.append(UncertaintyOfTicket(name, value, "declared" if is_declared else origin))
    return rows


def _comparison(tickets):
    comparison = compare(tickets)
    if comparison is None:
        return None
    _, values, other_u, source = tickets.compared
    e_n = None if comparison.e_n is None else _number(comparison.e_n[0])
    return ComparisonOfTicket(
        comparison.quantity, source, float(values[0]), other_u,
        float(comparison.difference[0]), e_n, None if e_n is None else abs(e_n) <= 1,
    )  # fmt: skip


def _not_in_u(sections, table):
    """Codes of effects that U does not contain."""
    codes = ["layers", "slips", "conformity"]
    if sections["product"]["density_is"] == "observed":
        codes.append("sample_temperature")
    if sections["product"]["alpha_per_k"] is not None:
        codes.append("alpha")
    if any(sections[state]["ullage_m"] is not None for state in STATES):
        codes.append("reference_height")
    if table.roof is not None:
        codes.append("roof_mass")
    if any(sections[state]["pressure_kpa"] for state in STATES):
        codes.append("vapour")
    return codes


def _factors(correction):
    if not isinstance(correction, FactorTable):
        return None
    columns = correction.density_kg_m3, correction.temperature_c, correction.factors
    return FactorsOfTicket(correction.file, *(column.tolist() for column in columns))
