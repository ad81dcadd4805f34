"""Proportional parts beside a table: in proportion to each other, and to the table's own rise."""

import numpy as np

from tankcal.messages import message

MOST_PARTS = 15  # rows: 9 of a centimetre, 7 or 15 of an inch
_AS_THE_TABLE = 0.02


def check_parts(table, main, log):
    """Tell parts that are out of proportion, or unlike the rise of the main table.

    table  of parts: marks 1, 2, ... and their volumes; main  (area low, area high), m2, of the
    steps of the main table
    Part j is rounded j * p: some p must lie between (v_j - q/2) / j and (v_j + q/2) / j for all j.
    """
    entries = [e for e in table.entries if e.height.value and e.volume.value is not None]
    if len(entries) < 2:
        return
    marks = np.array([entry.height.value for entry in entries])
    values = np.array([entry.volume.value for entry in entries])
    half = 0.5 * 10.0 ** -max(entry.volume.decimals for entry in entries) * (1 + 1e-9)
    low, high = (values - half) / marks, (values + half) / marks
    if low.max() > high.min():
        spared = [np.delete(low, k).max() <= np.delete(high, k).min() for k in range(len(entries))]
        part = float(np.median(values / marks))
        worst = (
            int(np.argmax(spared)) if any(spared) else int(np.argmax(abs(values - marks * part)))
        )
        entry = entries[worst]
        rest = np.delete(values, worst).sum() / np.delete(marks, worst).sum()
        expected = rest * marks[worst]
        about = f"{expected:.{entry.volume.decimals}f}"
        text = message(
            "lint_odd_part",
            "found {found}; expected about {about}, in proportion to the others",
            found=entry.volume.text,
            about=about,
        )
        log.problem(table.name, text, entry.row, entry.volume_column)
        return
    _check_size(table, entries, float(low.max()), float(high.min()), main, log)


def _check_size(table, entries, low, high, main, log):
    if main is None or table.height_unit_m is None or table.volume_unit_m3 is None:
        return
    unit = table.volume_unit_m3 / table.height_unit_m
    least, most = main
    if high * unit < least * (1 - _AS_THE_TABLE) or low * unit > most * (1 + _AS_THE_TABLE):
        text = message(
            "lint_parts_size",
            "parts of {part:.6g} a mark; expected {least:.6g} to {most:.6g}, as the table rises",
            part=0.5 * (low + high),
            least=least / unit,
            most=most / unit,
        )
        log.problem(table.name, text, entries[0].row, entries[0].volume_column)
