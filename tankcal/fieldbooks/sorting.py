"""Which readings are bare hits of the wall, which are control targets, which tie set-ups."""

import re
from collections import Counter
from dataclasses import dataclass
from fnmatch import fnmatchcase

from tankcal.messages import message

SAID = ("WALL", "HIT", "PAREDE", "PARED")  # a code or name that begins so is a bare hit
SHOWN = 8
_RANGE = re.compile(r"(\d{1,9})-(\d{1,9})")


@dataclass(frozen=True)
class Sorted:
    """Readings by what they are; each a tuple of Reading.

    hits     of the bare wall
    control  of control targets, read again to see a drift
    ties     of targets that tie set-ups
    """

    hits: tuple
    control: tuple
    ties: tuple


def is_meant(shot, patterns):
    """Whether a pattern means the name or the code of a shot: a range 1-200, or with * and ?"""
    for pattern in patterns:
        limits = _RANGE.fullmatch(pattern)
        if limits and shot.point.isascii() and shot.point.isdigit():
            if int(limits[1]) <= int(shot.point[:18]) <= int(limits[2]):
                return True
        elif any(fnmatchcase(one.upper(), pattern.upper()) for one in (shot.point, shot.code)):
            return True
    return False


def says_hit(shot):
    """Whether its name or its code calls a shot a hit."""
    return any(one.upper().startswith(SAID) for one in (shot.point, shot.code))


def sort_readings(readings, choices, known, log, leave_out):
    """Sorted readings of all books.

    choices    Choices of the user
    known      names of points whose coordinates are known
    leave_out  leave_out(what, Reading): told of each reading that is not used
    """
    hits, control, others = [], [], []
    for one in readings:
        shot = one.shot
        if is_meant(shot, choices.leave):
            leave_out(message("left_by_choice", "left out by choice"), one)
        elif is_meant(shot, choices.control):
            control.append(one)
        elif is_meant(shot, choices.check) or (
            is_meant(shot, choices.hits) if choices.hits else says_hit(shot)
        ):
            hits.append(one)
        else:
            others.append(one)
    if not hits and not choices.no_hits:
        _refuse_without_hits(readings, choices, log)
    whole = [one for one in hits if None not in _values(one.shot)]
    for one in hits:
        if None in _values(one.shot):
            leave_out(message("hit_not_whole", "hits without direction, zenith angle or distance"),
                      one)  # fmt: skip
    return Sorted(tuple(whole), *_targets(control, others, {one.shot.setup for one in whole},
                                           choices, known, leave_out))  # fmt: skip


def _values(shot):
    return shot.direction_deg, shot.zenith_deg, shot.distance_m


def _targets(control, others, of_hits, choices, known, leave_out):
    """(control readings, ties): of targets that nobody called so, by how often they were read.

    of_hits  places of the set-ups of hits; one set-up alone needs no tie
    """
    targets = sorted((*others, *control), key=lambda one: (one.shot.setup, one.shot.row))
    setups, asked = {}, {id(one) for one in control}
    for one in targets:
        setups.setdefault(one.shot.point, set()).add(one.shot.setup)
    times = Counter((one.shot.setup, one.shot.point) for one in targets)
    are_several = len({one.shot.setup for one in targets} | of_hits) > 1
    again, ties = [], []
    for one in targets:
        name = one.shot.point
        is_tie = choices.no_hits or (are_several and (len(setups[name]) > 1 or name in known))
        is_again = id(one) in asked or (
            times[one.shot.setup, name] > 1 and not (choices.control or choices.no_hits)
        )
        if is_tie:
            ties.append(one)
        if is_again:
            again.append(one)
        if not is_tie and not is_again:
            what = message(
                "ties_nothing",
                "targets that tie no set-ups: read once, from one set-up or from the only set-up",
            )
            leave_out(what, one)
    return tuple(again), tuple(ties)


def _refuse_without_hits(readings, choices, log):
    names = _in_ranges([one.shot.point for one in readings])
    shown = [*names[:SHOWN], *(["..."] if len(names) > SHOWN else [])]
    text = message(
        "which_are_hits",
        "none of the points {names} is identified as a hit; expected --hits with names or "
        "codes, such as --hits '1-200' or --hits 'W*', or --no-hits",
        names=", ".join(shown) or "-",
    )
    log.problem("--hits", text)


def _in_ranges(names):
    """Names in their order, runs of numbers as 1-200."""
    found = []
    for name in dict.fromkeys(names):
        if name.isascii() and name.isdigit() and len(name) < 10:
            number = int(name)
            if found and isinstance(found[-1], list) and found[-1][1] == number - 1:
                found[-1][1] = number
                continue
            found.append([number, number])
        else:
            found.append(name[:30])
    return [
        one if isinstance(one, str) else str(one[0]) if one[0] == one[1] else f"{one[0]}-{one[1]}"
        for one in found
    ]
