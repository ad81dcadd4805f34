"""Attribution of outliers: blunders in readings, or valid readings rejected because of an error in
another item that was kept.

Data snooping trusts the majority and whatever is held fixed. Single blunders occur everywhere. If
one item (a point with known coordinates, a photo, an instrument) lost far more readings than all
others, that item is reported:

    P(k or more of n | p) < 0.001 / number of items,   p = (K + 1) / (N + 2)

with k of its n values rejected and K of the N values of all other items.
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
MANY = 0.12  # share of rejected values above which single blunders are improbable
SOME = 0.02  # share above which held quantities are tested
LISTED = 4
TESTED = 60  # rejected readings examined for alternatives


def find_one_sided_losses(readings, known):
    """Problem rows on items that lost far more of their values than all others.

    Parameters
    ----------
    readings : Readings
    known : Known

    Returns
    -------
    list of Problem
    """
    used = readings.where(~readings.check & (readings.columns["file"] != "cameras.toml"))
    total, gone = len(used), int(used.removed.sum())
    if not gone:
        return []
    things = defaultdict(lambda: [0, 0])
    rows = (used.columns[name].tolist() for name in ("kind", "file", "ids", "removed"))
    for *identity, removed in zip(*rows, strict=True):
        for thing in _things(*identity, known):
            things[thing][0] += 1
            things[thing][1] += removed
    suspects = []
    for (file, name), (n, k) in things.items():
        # Laplace estimate of the rate of rejection of everything else.
        p = (gone - k + 1) / (total - n + 2)
        # betainc(k, n - k + 1, p) is the binomial probability of k or more rejections.
        if k > 2 and n < total and betainc(k, n - k + 1, p) < LEVEL / len(things):
            text = _far_more(name, k, n) if file == "control.csv" else _much_of_photo(name, k, n)
            row = known.row.get(name) if file == "control.csv" else None
            suspects.append((k / n, Problem(file, text, row)))
    suspects.sort(key=lambda pair: -pair[0])
    return [
        *_lost_control(used),
        *(identity for _, identity in suspects[:LISTED]),
        *_many(gone, total),
    ]


def _things(kind, file, ids, known):
    """Yield (file, name) of the items on which a value depends."""
    if kind == "image coordinate":
        yield file, ids[0]
    for name in dict.fromkeys(ids):
        if name in known.row and not kind.startswith("control coordinate"):
            yield "control.csv", name


def _far_more(name, k, n):
    """Sentence about a control point with many rejected readings."""
    return message(
        "point_lost_much",
        "{gone} of the {count} values measured to point {point} were rejected, far more than of"
        " other points: its coordinates may be wrong, not the readings",
        gone=k,
        count=n,
        point=name,
    )


def _much_of_photo(name, k, n):
    """Sentence about a photo with many rejected points."""
    return message(
        "photo_lost_much",
        "{gone} of the {count} values of photo {photo} were rejected, far more than of "
        "others: check the whole photo",
        gone=k,
        count=n,
        photo=name,
    )


def _lost_control(readings):
    """Problem rows of rejected known coordinates."""
    rejected = [
        reading
        for reading in readings.where(readings.removed)
        if reading.kind.startswith("control coordinate") and np.isfinite(reading.residual)
    ]
    return [
        Problem(
            reading.file, _lost_coordinate_sentence(reading), reading.row, f"{reading.element}_m"
        )
        for reading in rejected[: 2 * LISTED]
    ]


def _lost_coordinate_sentence(reading):
    """Sentence about a rejected known coordinate."""
    return message(
        "control_set_aside",
        "{axis} of {point} was rejected: given as {value_m:.4f} (sd {sd_m:.4f}), but the "
        "readings give {here_m:.4f}",
        axis=reading.element,
        point=reading.ids[0],
        value_m=reading.value,
        sd_m=reading.sd,
        here_m=reading.value + reading.residual,
    )


def _many(gone, total):
    """Problem rows if more values were rejected than single blunders explain."""
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
    """Problem rows of rejected readings for which another reading may be wrong instead.

    Parameters
    ----------
    adjusted : network.Adjusted
    removed : sequence of network.snooping.Removed
        The worst first.
    held : network.reactions.Reactions
        Reactions of held coordinates.
    held_trace : Trace

    Returns
    -------
    list of Problem
    """
    problems = []
    for rejected in removed[:TESTED]:
        others = alternatives(adjusted, rejected.source, rejected.row, held)
        if others:
            names = [
                _reading_in_words(adjusted, held_trace, *alternative) for alternative in others
            ]
            text = message(
                "undecided",
                "{reading} was rejected, but the error may equally be in {others}: the "
                "readings cannot decide",
                reading=_reading_in_words(adjusted, held_trace, rejected.source, rejected.row),
                others=_either(names),
            )
            trace = adjusted.survey.table(rejected.source).trace
            problems.append(Problem(trace.file, text, trace.rows[rejected.row]))
    if len(problems) > LISTED:
        text = message(
            "more_undecided",
            "the same is true of {more} more readings that were rejected",
            more=len(problems) - LISTED,
        )
        # Further cases are counted in one line.
        problems[LISTED:] = [Problem("job.toml", text, None, "adjustment.snooping")]
    return problems


def _either(names):
    """A list of alternatives, in words."""
    if len(names) > LISTED:
        return message("one_of", "one of {names}", names=list_some(names, LISTED))
    return join_with_or(names)


def _reading_in_words(adjusted, held_trace, source, row):
    """A reading in words."""
    observations = adjusted.survey.table(source)
    trace = held_trace if observations is None else observations.trace
    ids = trace.ids[row]
    if source == IMAGES:
        return image_point_label(*ids)
    kind = "control coordinate" if observations is None else observations.kind
    table_name = trace.table.replace("_", " ") or kind.removesuffix(" of a further system")
    name, kind = (
        " ".join(filter(None, ["-".join(ids), trace.element[row][0]])),
        table_name.removesuffix("s"),
    )
    if trace.rows[row] is None:
        return message("reading", "{kind} {name}", kind=kind, name=name)
    row = trace.rows[row]
    return message("reading_in_row", "{kind} {name} (row {row})", kind=kind, name=name, row=row)


def count_set_aside(survey):
    """Number of values that an adjusted survey rejects."""
    return sum(table.rows * int(np.sum(~table.in_use)) for table in survey.tables.values())
