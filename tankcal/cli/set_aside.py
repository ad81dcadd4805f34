"""Names of rejected observations: wall points, circumferences, offsets, survey readings."""

from tankcal.messages import message

NAMED = 5  # of each kind


def lines_set_aside(result, adjustment):
    """Yield a line (Message) with the first names for each kind of rejected observations.

    Parameters
    ----------
    result : Result or None
        None: only the survey was adjusted.
    adjustment : NetworkAdjustment or None
    """
    kinds = [_readings(adjustment)]
    if result is not None:
        kinds = [_points(result), _straps(result), _offsets(result), *kinds]
    for rejected in kinds:
        names = list(dict.fromkeys(rejected.names))
        if len(names) > NAMED:
            yield message(
                "set_aside_and_more",
                "  {what}: {names} and {more} more (see the working papers)",
                what=rejected.what,
                names=names[:NAMED],
                more=len(names) - NAMED,
            )
        elif names:
            yield message("set_aside_named", "  {what}: {names}", what=rejected.what, names=names)


class _RejectedKind:
    """Kind of rejected observations and their names."""

    def __init__(self, what, names=()):
        self.what, self.names = what, tuple(names)


def _points(result):
    what = message("set_aside_points", "points rejected")
    if result.accepted is None:
        return _RejectedKind(what)
    kept = {int(i) for i in result.accepted}
    return _RejectedKind(
        what, (name for i, name in enumerate(result.job.points.names) if i not in kept)
    )


def _straps(result):
    what, straps = message("set_aside_straps", "circumferences rejected"), result.straps
    if straps is None:
        return _RejectedKind(what)
    gone = straps.adjusted[~straps.accepted]
    return _RejectedKind(what, (_name_with_row(straps.reduced[i].strap) for i in gone))


def _name_with_row(strap):
    return message("named_in_row", "{name} (row {row})", name=strap.name, row=str(strap.row))


def _offsets(result):
    what, read = message("set_aside_offsets", "offsets rejected"), result.read
    if read is None or result.job.lines is None:
        return _RejectedKind(what)
    gone = read.places[read.are("offsets")][~read.tests_of("offsets")[2]]
    return _RejectedKind(what, (_name_with_level(result.job.lines.offsets[i]) for i in gone))


def _name_with_level(offset):
    return message("named_at_level", "line {line} at {level_m:g} m (row {row})", line=offset.line,
                   level_m=offset.level_m, row=str(offset.row))  # fmt: skip


def _readings(adjustment):
    """Return the rejected readings of the survey, largest test statistic first."""
    what = message("set_aside_readings", "readings rejected")
    removed = () if adjustment is None else adjustment.removed
    worst = sorted(removed, key=lambda reading: -abs(reading.w))
    return _RejectedKind(what, (_name_with_file(reading) for reading in worst))


def _name_with_file(reading):
    return message(
        "named_in_file",
        "{ends} ({file}, row {row})",
        ends="-".join(map(str, reading.ids)),
        file=reading.file,
        row="-" if reading.row is None else str(reading.row),
    )
