"""Instruments of a job that measure distances, and the set-ups that use them."""

from tankcal.job.checks.tapes import tapes_of

RANGE_NOTHING = ("plummet", "stadia", "level")  # kinds of instruments without a distance


def ranging_of(registers):
    """{name: {key: value}} of the instruments that measure distances, except tapes."""
    instruments, tapes = registers["instruments"], tapes_of(registers)
    return {
        name: given
        for name, given in instruments.items()
        if name not in tapes and (given["kind"] or "").strip().lower() not in RANGE_NOTHING
    }


def instruments_used(setups, ranging):
    """{set-up: name of its instrument}; a blank means the only instrument, None if several."""
    only = next(iter(ranging)) if len(ranging) == 1 else None
    pairs = zip(setups.of("setup"), setups.of("instrument"), strict=True)
    return {setup: name or only for setup, name in pairs}
