"""Scope of a laboratory's accreditation: its calibration and measurement capabilities (CMC).

A letterhead may state the CMC by kind and capacity of the tank. An accredited certificate states no
smaller uncertainty than the CMC, and a calibration outside the scope bears no accreditation mark.
Source: ILAC-P14:09/2020, section 5, as summarised in a public guidance page; the text itself was
not read.
"""

from tankcal.errors import InputError, Problem
from tankcal.messages import message
from tankcal.report.letterhead import CMC
from tankcal.report.uncertainty.stated import stated_U_m3


def find_capability(letterhead, record):
    """Return the CMC (dict) for the tank of a record, or None.

    If several entries of the scope apply, the smallest uncertainty counts.
    """
    tank, capacity = record["job"]["tank"], record["capacity"]
    if not letterhead or not tank or not capacity:
        return None
    top_m3 = capacity["volume_m3"][-1]
    applicable = [
        capability
        for capability in letterhead.get(CMC, ())
        if tank["kind"] in capability["tanks"]
        and (capability["from_m3"] or 0) <= top_m3
        and (capability["to_m3"] is None or top_m3 <= capability["to_m3"])
    ]
    return min(applicable, key=lambda capability: capability["percent"], default=None)


def is_outside_scope(letterhead, record):
    """Whether a letterhead states CMC, but none for the tank of a record."""
    return bool(letterhead and letterhead.get(CMC)) and find_capability(letterhead, record) is None


def letterhead_in_scope(letterhead, record):
    """Return the letterhead (dict), without the accreditation mark outside the scope."""
    return letterhead | {"mark": None} if is_outside_scope(letterhead, record) else letterhead


def refuse_below_capability(letterhead, record):
    """Raise InputError if U of the capacity is below the CMC of a `Letterhead`."""
    capability = find_capability(letterhead and letterhead.data(), record)
    if capability is None:
        return
    capacity = record["capacity"]
    percent = 100 * stated_U_m3(capacity)[-1] / capacity["volume_m3"][-1]
    if percent < capability["percent"]:
        text = message(
            "below_cmc",
            "U of the capacity is {percent:.2g} %, below the CMC of {cmc:g} %; expected the "
            "missing contributions in uncertainty.csv, or a letterhead without this CMC",
            percent=percent,
            cmc=capability["percent"],
        )
        raise InputError(Problem("--letterhead", text, None, f"{CMC}.{capability['name']}"))
