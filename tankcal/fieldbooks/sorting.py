"""Classification of readings: hits of the wall, control targets, targets that tie set-ups."""

import re
from collections import Counter
from dataclasses import dataclass
from fnmatch import fnmatchcase

from tankcal.messages import message

SAID = ("WALL", "HIT", "PAREDE", "PARED")  # initial letters of codes and names of hits
SHOWN = 8
_RANGE = re.compile(r"(\d{1,9})-(\d{1,9})")


@dataclass(frozen=True)
class Sorted:
    """Readings by kind; each a tuple of Reading.

    Attributes
    ----------
    hits : tuple
        Reflectorless readings of the wall.
    control : tuple
        Repeated readings of control targets, for drift.
    ties : tuple
        Readings of targets that tie set-ups.
    """

    hits: tuple
    control: tuple
    ties: tuple


def is_meant(shot, patterns):
    """Return whether a pattern (1-200, or with * and ?) matches the name or code of a shot."""
    for pattern in patterns:
        limits = _RANGE.fullmatch(pattern)
        if limits and shot.point.isascii() and shot.point.isdigit():
            if int(limits[1]) <= int(shot.point[:18]) <= int(limits[2]):
                return True
        elif any(fnmatchcase(text.upper(), pattern.upper()) for text in (shot.point, shot.code)):
            return True
    return False


def says_hit(shot):
    """Return whether the name or the code identifies a shot as a hit."""
    return any(text.upper().startswith(SAID) for text in (shot.point, shot.code))


def sort_readings(readings, choices, known, log, leave_out):
    """Return the Sorted readings of all books.

    Parameters
    ----------
    readings : list of Reading
    choices : Choices
    known : set of str
        Points with known coordinates.
    log : Log
    leave_out : callable
        leave_out(what, Reading), called for each reading that is not used.
    """
    hits, control, others = [], [], []
    for reading in readings:
        shot = reading.shot
        if is_meant(shot, choices.leave):
            leave_out(message("left_by_choice", "left out by choice"), reading)
        elif is_meant(shot, choices.control):
            control.append(reading)
        elif is_meant(shot, choices.check) or (
            is_meant(shot, choices.hits) if choices.hits else says_hit(shot)
        ):
            hits.append(reading)
        else:
            others.append(reading)
    if not hits and not choices.no_hits:
        _refuse_without_hits(readings, choices, log)
    whole = [reading for reading in hits if None not in _values(reading.shot)]
    for reading in hits:
        if None in _values(reading.shot):
            leave_out(message("hit_not_whole", "hits without direction, zenith angle or distance"),
                      reading)  # fmt: skip
    setups_of_hits = {reading.shot.setup for reading in whole}
    targets = _targets(control, others, setups_of_hits, choices, known, leave_out)
    return Sorted(tuple(whole), *targets)


def _values(shot):
    """Return direction, zenith angle and distance."""
    return shot.direction_deg, shot.zenith_deg, shot.distance_m


def _targets(control, others, of_hits, choices, known, leave_out):
    """Return (control readings, ties), from the number of readings of each target.

    of_hits  indices of the set-ups of hits; a single set-up needs no tie
    """
    targets = sorted(
        (*others, *control), key=lambda reading: (reading.shot.setup, reading.shot.row)
    )
    setups, asked = {}, {id(reading) for reading in control}
    for reading in targets:
        setups.setdefault(reading.shot.point, set()).add(reading.shot.setup)
    times = Counter((reading.shot.setup, reading.shot.point) for reading in targets)
    are_several = len({reading.shot.setup for reading in targets} | of_hits) > 1
    again, ties = [], []
    for reading in targets:
        name = reading.shot.point
        is_tie = choices.no_hits or (are_several and (len(setups[name]) > 1 or name in known))
        is_again = id(reading) in asked or (
            times[reading.shot.setup, name] > 1 and not (choices.control or choices.no_hits)
        )
        if is_tie:
            ties.append(reading)
        if is_again:
            again.append(reading)
        if not is_tie and not is_again:
            what = message(
                "ties_nothing",
                "targets that tie no set-ups: read once, from one set-up or from the only set-up",
            )
            leave_out(what, reading)
    return tuple(again), tuple(ties)


def _refuse_without_hits(readings, choices, log):
    """Report that no reading is a hit."""
    names = _join_ranges([reading.shot.point for reading in readings])
    shown = [*names[:SHOWN], *(["..."] if len(names) > SHOWN else [])]
    text = message(
        "which_are_hits",
        "none of the points {names} is identified as a hit; expected --hits with names or "
        "codes, such as --hits '1-200' or --hits 'W*', or --no-hits",
        names=", ".join(shown) or "-",
    )
    log.problem("--hits", text)


def _join_ranges(names):
    """Return names in their order, with consecutive numbers as 1-200."""
    runs = []
    for name in dict.fromkeys(names):
        if name.isascii() and name.isdigit() and len(name) < 10:
            number = int(name)
            if runs and isinstance(runs[-1], list) and runs[-1][1] == number - 1:
                runs[-1][1] = number
                continue
            runs.append([number, number])
        else:
            runs.append(name[:30])
    return [
        run if isinstance(run, str) else str(run[0]) if run[0] == run[1] else f"{run[0]}-{run[1]}"
        for run in runs
    ]
