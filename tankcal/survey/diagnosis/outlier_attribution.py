"""Are the readings that were set aside blunders, or victims of something wrong that was kept?

A search for blunders believes the majority and what is held fixed. Of single blunders it leaves
their traces everywhere; where it took far more readings of one thing (a point with known
coordinates, a photo, an instrument) than of all others, that thing is told:

    P(k or more of n | p) < 0.001 / number of things,   p = (K + 1) / (N + 2)

with k of its n values set aside and K of the N values of everything else.
"""

from collections import defaultdict

import numpy as np
from scipy.special import betainc

from tankcal.errors import Problem
from tankcal.messages import join_with_or, list_some, message
from tankcal.survey.diagnosis.double_names import image_point_label
from tankcal.survey.network.separability import alternatives
from tankcal.survey.network.survey import IMAGES

LEVEL = 0.001
MANY = 0.12  # share of all values set aside, above which these are hardly single blunders
SOME = 0.02  # share above which what is held fixed is doubted for once
LISTED = 4
TESTED = 60  # readings set aside of which it is asked whether others might have been


def find_one_sided_losses(readings, known):
    """Problem rows on things that lost many more of their values than everything else.

    readings  Readings                  known  Known control
    """
    used = readings.where(~readings.check & (readings.columns["file"] != "cameras.toml"))
    total, gone = len(used), int(used.removed.sum())
    if not gone:
        return []
    things = defaultdict(lambda: [0, 0])
    rows = (used.columns[name].tolist() for name in ("kind", "file", "ids", "removed"))
    for *one, removed in zip(*rows, strict=True):
        for thing in _things(*one, known):
            things[thing][0] += 1
            things[thing][1] += removed
    found = []
    for (file, name), (n, k) in things.items():
        p = (gone - k + 1) / (total - n + 2)
        if k > 2 and n < total and betainc(k, n - k + 1, p) < LEVEL / len(things):
            told = _far_more(name, k, n) if file == "control.csv" else _much_of_photo(name, k, n)
            row = known.row.get(name) if file == "control.csv" else None
            found.append((k / n, Problem(file, told, row)))
    found.sort(key=lambda pair: -pair[0])
    return [*_lost_control(used), *(one for _, one in found[:LISTED]), *_many(gone, total)]


def _things(kind, file, ids, known):
    """(file, name) of what a value hangs on."""
    if kind == "image coordinate":
        yield file, ids[0]
    for name in dict.fromkeys(ids):
        if name in known.row and not kind.startswith("control coordinate"):
            yield "control.csv", name


def _far_more(name, k, n):
    return message(
        "point_lost_much",
        "{gone} of the {count} values measured to point {point} were rejected, far more than of"
        " other points: its coordinates may be wrong, not the readings",
        gone=k,
        count=n,
        point=name,
    )


def _much_of_photo(name, k, n):
    return message(
        "photo_lost_much",
        "{gone} of the {count} values of photo {photo} were rejected, far more than of "
        "others: check the whole photo",
        gone=k,
        count=n,
        photo=name,
    )


def _lost_control(readings):
    """Known coordinates that were set aside."""
    gone = [
        one
        for one in readings.where(readings.removed)
        if one.kind.startswith("control coordinate") and np.isfinite(one.residual)
    ]
    return [
        Problem(one.file, _lost(one), one.row, f"{one.element}_m") for one in gone[: 2 * LISTED]
    ]


def _lost(one):
    return message(
        "control_set_aside",
        "{axis} of {point} was rejected: given as {value_m:.4f} (sd {sd_m:.4f}), but the "
        "readings give {here_m:.4f}",
        axis=one.element,
        point=one.ids[0],
        value_m=one.value,
        sd_m=one.sd,
        here_m=one.value + one.residual,
    )


def _many(gone, total):
    if gone < 3 or gone <= MANY * total:
        return []
    text = message(
        "many_set_aside",
        "{gone} of {total} values ({percent:.0f} %) were rejected: more than single blunders "
        "explain; first check what is held fixed, the scales and the standard deviations",
        gone=gone,
        total=total,
        percent=100 * gone / total,
    )
    return [Problem("job.toml", text, None, "adjustment.snooping")]


def find_undecided_outliers(adjusted, removed, held, held_trace):
    """Problem rows of readings set aside in whose place others might have been.

    removed     tuple of network.snooping.Removed, the worst first
    held        network.reactions.Reactions of held coordinates        held_trace  their Trace
    """
    found = []
    for one in removed[:TESTED]:
        others = alternatives(adjusted, one.source, one.row, held)
        if others:
            names = [_named(adjusted, held_trace, *other) for other in others]
            text = message(
                "undecided",
                "{reading} was rejected, but the error may equally be in {others}: the "
                "readings cannot decide",
                reading=_named(adjusted, held_trace, one.source, one.row),
                others=_either(names),
            )
            trace = adjusted.survey.table(one.source).trace
            found.append(Problem(trace.file, text, trace.rows[one.row]))
    if len(found) > LISTED:
        text = message(
            "more_undecided",
            "the same is true of {more} more readings that were rejected",
            more=len(found) - LISTED,
        )
        found[LISTED:] = [Problem("job.toml", text, None, "adjustment.snooping")]
    return found


def _either(names):
    """Readings of which each may be the wrong one."""
    if len(names) > LISTED:
        return message("one_of", "one of {names}", names=list_some(names, LISTED))
    return join_with_or(names)


def _named(adjusted, held_trace, source, row):
    """A reading in words."""
    one = adjusted.survey.table(source)
    trace = held_trace if one is None else one.trace
    ids = trace.ids[row]
    if source == IMAGES:
        return image_point_label(*ids)
    kind = "control coordinate" if one is None else one.kind
    of = trace.table.replace("_", " ") or kind.removesuffix(" of a further system")
    name, kind = (
        " ".join(filter(None, ["-".join(ids), trace.element[row][0]])),
        of.removesuffix("s"),
    )
    if trace.rows[row] is None:
        return message("reading", "{kind} {name}", kind=kind, name=name)
    row = trace.rows[row]
    return message("reading_in_row", "{kind} {name} (row {row})", kind=kind, name=name, row=row)


def count_set_aside(survey):
    """Number of values that the survey of an adjustment leaves out."""
    return sum(one.rows * int(np.sum(~one.in_use)) for one in survey.tables.values())
