"""Results of tickets: one row for each ticket, and the comparison with the other party.

Search for a slip that explains a contradiction between a ticket and the other party.

Some slips leave plausible inputs, such as an ullage written as a dip. If the comparison fails, each
slip is tried: its correction is reported if the comparison would then agree. This is a hint for the
person who signs, never a correction of the ticket.
"""

import os
from dataclasses import dataclass
from errno import EISDIR

import numpy as np

from tankcal.errors import InputError, Problem
from tankcal.messages import message
from tankcal.products.quantity.chain import QUANTITIES, STATES, values_of
from tankcal.products.settings import drop_blanks
from tankcal.report.folders import replace_file
from tankcal.tank.volume_correction.corrections import TABLE
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
