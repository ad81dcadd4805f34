"""Results of tickets: a row for each ticket, comparison with the other party, and ticket.json.

Some slips leave plausible inputs, such as an ullage written as a dip. If the comparison with the
other party fails, each slip is tried: its correction is reported if the comparison would then
agree. This is a hint for the person who signs, never a correction of the ticket.
"""

import os
from dataclasses import dataclass, fields
from errno import EISDIR

import numpy as np

from tankcal.errors import InputError, Problem
from tankcal.messages import message
from tankcal.products.quantity.chain import QUANTITIES, STATES, values_of
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
from tankcal.report.folders import replace_file
from tankcal.tank.gauging import ASSUMPTIONS, KEY_OF_INPUT
from tankcal.tank.volume_correction.corrections import TABLE, FactorTable
from tankcal.tank.volume_correction.petroleum import BASES_C, DEGREES
from tankcal.text.delimited import write_guarded

# First columns of `rows_of`, which identify a file that may be replaced.
_BEGINNINGS = (b"ticket,opening_tov_m3,", b"ticket,closing_tov_m3,")


@dataclass(frozen=True)
class Comparison:
    """Difference of a quantity from that of a meter or of the other party.

    Attributes
    ----------
    quantity, source : str
    difference : ndarray, shape (n,)
        Quantity of the ticket, without its sign, less that of the other party; m3 or kg. nan: no
        quantity of the other party.
    e_n : ndarray, shape (n,), or None
        Difference over the root of the sum of both squared U; None if the other U is not known.
    """

    quantity: str
    source: str
    difference: np.ndarray
    e_n: np.ndarray | None


def compare(tickets):
    """`Comparison` with the other party, or None if the tickets contain none."""
    if tickets.compared is None:
        return None
    quantity, values, other_u, source = tickets.compared
    result, place = tickets.quantities[tickets.result_state], QUANTITIES.index(quantity)
    difference = np.abs(result.value[:, place]) - values
    e_n = None
    if other_u is not None:
        both_u = np.hypot(result.U[:, place], other_u)
        e_n = np.where(both_u > 0, difference, np.nan) / np.where(both_u > 0, both_u, 1.0)
    return Comparison(quantity, source, difference, e_n)


def rows_of(tickets):
    """{column: value} of each ticket: steps, quantities, u and U, and the comparison.

    A number that does not exist, such as a difference without a quantity to compare with, is None.
    """
    columns = {"ticket": list(tickets.names)}
    for state, result in tickets.transfer.steps.items():
        for name, values in values_of(result).items():
            columns[f"{state}_{name}"] = values.tolist()
    for state, result in tickets.quantities.items():
        for place, name in enumerate(QUANTITIES):
            columns[f"{state}_{name}"] = result.value[:, place].tolist()
            columns[f"{state}_u_{name}"] = result.u[:, place].tolist()
            columns[f"{state}_U_{name}"] = result.U[:, place].tolist()
    if tickets.transfer.room_levels:
        rooms = tickets.transfer.rooms()
        for place, name in enumerate(tickets.transfer.room_levels):
            columns[f"closing_{name}_m3"] = rooms.value[:, place].tolist()
            columns[f"closing_U_{name}_m3"] = rooms.U[:, place].tolist()
    comparison = compare(tickets)
    if comparison is not None:
        columns[f"difference_{comparison.quantity}"] = _numbers(comparison.difference)
        if comparison.e_n is not None:
            columns["e_n"] = _numbers(comparison.e_n)
    return [dict(zip(columns, row, strict=True)) for row in zip(*columns.values(), strict=True)]


def _numbers(values):
    """Values as a list, with None for a value that is not finite."""
    return [value if np.isfinite(value) else None for value in values.tolist()]


def check_output(path):
    """Refuse a file that `write_rows` must not replace.

    Raises
    ------
    InputError
        For an existing file with other contents.
    IsADirectoryError
    """
    if path.is_dir():
        raise IsADirectoryError(EISDIR, os.strerror(EISDIR), str(path))
    if not path.exists():
        return
    # A regular file is needed first: reading another one, such as a pipe, may never end.
    if path.is_file():
        with path.open("rb") as stream:
            start = stream.read(max(map(len, _BEGINNINGS)))
        if not start or start.startswith(_BEGINNINGS):
            return
    expected = message(
        "ticket_out_exists",
        "found a file that tankcal ticket did not write; expected a new name, or such a file",
    )
    raise InputError(Problem(str(path), expected))


def write_rows(path, rows):
    """Write the rows of `rows_of` to a CSV file, as a whole or not."""
    check_output(path)
    with (
        replace_file(path) as temporary,
        temporary.open("w", encoding="utf-8", newline="") as stream,
    ):
        write_guarded(stream, [[*rows[0]], *(row.values() for row in rows)])


# ---- slips

OTHER_BASES = {"15C": "20C", "20C": "15C", "60F": "20C"}  # another customary base

_BOTH_DIPS = "opening.dip_m, closing.dip_m"


def find_slips(tickets, read):
    """Slips that would explain why a single ticket contradicts the other party.

    Parameters
    ----------
    tickets : Tickets
        A single ticket.
    read : callable
        Tickets of this table from {section: {key: value}}; raises InputError.

    Returns
    -------
    tuple of Problem
        Warnings; empty if there is no comparison, or if it agrees.
    """
    if len(tickets.names) != 1 or tickets.compared is None:
        return ()
    e_n = _e_n(tickets)
    if e_n is None or abs(e_n) <= 1:
        return ()
    slips = []
    for key, text, changed in _candidates(tickets.sections, tickets.transfer.table):
        try:
            trial = read(drop_blanks(changed))
        except InputError:  # the changed ticket is impossible
            continue
        other = _e_n(trial)
        # Both dips exchanged reverse the transfer; both parties know its direction.
        if abs(other) <= 1 and (key != _BOTH_DIPS or _direction(trial) == _direction(tickets)):
            expected = message(
                "ticket_slip", "would explain the difference (E_n {e_n:.2f}): {slip}?", e_n=other,
                slip=text,
            )  # fmt: skip
            slips.append(Problem(tickets.settings_name, expected, column=key))
    return tuple(slips)


def _e_n(tickets):
    """E_n of the comparison of a single ticket; None if it is not known."""
    comparison = compare(tickets)
    if comparison is None or comparison.e_n is None or not np.isfinite(comparison.e_n[0]):
        return None
    return float(comparison.e_n[0])


def _direction(tickets):
    """Sign of the volume closing less opening; 0 for a stock."""
    moved = tickets.quantities.get("moved")
    return 0 if moved is None else np.sign(moved.value[0, 0])


def _candidates(sections, table):
    """Yield (key, slip in words, sections without the slip)."""
    product, base = sections["product"], sections["product"]["base"]
    if table.reference_height_m is not None:
        for states in (STATES, *((state,) for state in STATES)):
            changed = _exchange_dips(sections, states)
            if changed is not None:
                text = message("ticket_slip_ullage", "is the dip an ullage, or the ullage a dip")
                key = _BOTH_DIPS if len(states) == len(STATES) else f"{states[0]}.dip_m"
                yield key, text, changed
    celsius = dict(sections)
    for state in STATES:
        celsius[state] = _map(sections[state], ("temperature_c", "ambient_c"), _convert_fahrenheit)
    celsius["product"] = _map(product, ("density_temperature_c",), _convert_fahrenheit)
    fahrenheit = message("ticket_slip_fahrenheit", "are the temperatures in degrees Fahrenheit")
    yield "closing.temperature_c", fahrenheit, celsius
    if base is not None and product["correction"] != TABLE:
        other = OTHER_BASES[base]
        text = message("ticket_slip_other_base", "is the other quantity at {other:g} {unit}",
                       other=BASES_C[other], unit=DEGREES)  # fmt: skip
        yield "product.base", text, sections | {"product": product | {"base": other}}
    if product["density_is"] == "base":
        observed = {"density_is": "observed"}
        if base is not None:
            changed = observed | {"density_temperature_c": BASES_C[OTHER_BASES[base]]}
            text = message(
                "ticket_slip_base", "is the density that at {other:g} {unit}",
                other=BASES_C[OTHER_BASES[base]], unit=DEGREES,
            )  # fmt: skip
            yield "product.density_kg_m3", text, sections | {"product": product | changed}
        changed = observed | {"density_temperature_c": sections["closing"]["temperature_c"]}
        text = message("ticket_slip_observed", "was the density observed in the tank")
        yield "product.density_is", text, sections | {"product": product | changed}
    if product["sw_percent"]:
        changed = product | {"sw_percent": 100 * product["sw_percent"]}
        text = message("ticket_slip_sw", "is S&W a fraction")
        yield "product.sw_percent", text, sections | {"product": changed}


def _exchange_dips(sections, states):
    """Sections with dips as ullages and ullages as dips in some states; None without them."""
    changed = dict(sections)
    for state in states:
        dip, ullage = sections[state]["dip_m"], sections[state]["ullage_m"]
        if dip is None and ullage is None:
            return None
        changed[state] = sections[state] | {"dip_m": ullage, "ullage_m": dip}
    return changed


def _map(values, keys, function):
    return values | {key: function(values[key]) for key in keys if values[key] is not None}


def _convert_fahrenheit(value):
    return (value - 32) / 1.8


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
