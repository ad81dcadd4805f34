"""Search for a slip that explains a contradiction between a ticket and the other party.

Some slips leave plausible inputs, such as an ullage written as a dip. If the comparison fails, each
slip is tried: its correction is reported if the comparison would then agree. This is a hint for the
person who signs, never a correction of the ticket.
"""

import numpy as np

from tankcal.errors import InputError, Problem
from tankcal.messages import message
from tankcal.products.quantity.results import compare
from tankcal.products.quantity.transfer import STATES
from tankcal.products.settings import drop_blanks
from tankcal.tank.volume_correction.corrections import TABLE
from tankcal.tank.volume_correction.petroleum import BASES_C
from tankcal.tank.volume_correction.ranges import DEGREES

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
