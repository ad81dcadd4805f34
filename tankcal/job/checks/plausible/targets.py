"""Plausibility of the distance of targets from the wall."""

import numpy as np

from tankcal.job.checking import has_rows
from tankcal.job.plausibility import FLAT, RAISED, TARGET_MM
from tankcal.messages import message


def check_targets(values, tables, log):
    """Warn once about offsets that do not fit the kind of target.

    An offset is subtracted from every radius, and no reading of the survey contradicts it.
    """
    table = tables["targets"]
    if not has_rows(table):
        return
    kind = values["checks"]["targets"] or FLAT
    offset = np.nan_to_num(table.numbers("offset_mm"))
    least, most = TARGET_MM[kind]
    outliers = np.flatnonzero((offset < least) | (offset > most))
    if len(outliers) == 0:
        return
    worst = outliers[int(np.argmax(np.abs(offset[outliers])))]
    text = message(
        "target_offset_strange",
        "{found_mm:g} mm from the wall to the centre of the target, {count} targets of {all} so;"
        " expected {least_mm:g} to {most_mm:g} mm with checks.targets = {kind}: is it in another"
        " unit or the constant of a prism, or are the targets {other}?",
        found_mm=float(offset[worst]),
        count=len(outliers),
        all=len(offset),
        least_mm=least,
        most_mm=most,
        kind=kind,
        other=RAISED if kind == FLAT else FLAT,
    )
    log.warning(table.file, text, table.rows[worst], "offset_mm")
