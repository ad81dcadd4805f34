"""Progress and remaining time of a long step."""

from tankcal.messages import message

LEAST_S = 2.0  # time before the remaining time is estimated, s
MILLION = 1_000_000  # from here on counts are shown in millions


def describe_progress(done, total, fresh, seconds):
    """Return the progress and the remaining time of a long step; for millions also the rate.

    Parameters
    ----------
    done, total : int
    fresh : int
        The part of `done` that was completed within `seconds`.
    seconds : float
    """
    left = ""
    if seconds >= LEAST_S and fresh > 0 and done < total:
        rest = (total - done) * seconds / fresh
        if rest < 100:
            left = message("part_seconds_left", ", about {count:.0f} s left", count=rest)
        else:
            left = message("part_minutes_left", ", about {count:.0f} min left", count=rest / 60)
    if total < MILLION:
        return message("part_done", "{done}/{total}{left}", done=done, total=total, left=left)
    return message(
        "part_millions_done",
        "{done:.1f}/{total:.1f} million, {rate:.1f} million/s{left}",
        done=done / MILLION,
        total=total / MILLION,
        rate=fresh / MILLION / max(seconds, 1e-3),
        left=left,
    )
