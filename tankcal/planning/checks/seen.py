"""Photographs and set-ups that see too little."""

from tankcal.job.tables import Log

FEWEST = 3  # points that a photograph has to see


def refuse_blind(plan, seen):
    """Raise InputError for photographs and set-ups that see too little, a line for each ring.

    seen  visibility.Visibility
    """
    log, blind = Log(), {}
    for k, photo in enumerate(plan.photos):
        count, targets = (int(seen.on_photo[k, :n].sum()) for n in (None, len(plan.targets.names)))
        if count < FEWEST or not targets:
            found = _seen(count, targets)
            blind.setdefault(photo.place, []).append((f"photograph {photo.name}", found))
    for k, setup in enumerate(plan.setups):
        if not seen.on_setup[k].any():
            blind.setdefault(setup.place, []).append((f"set-up {setup.name}", "nothing"))
    for (file, row, name), ones in blind.items():
        who, found = ones[0]
        more = f", and {len(ones) - 1} more of this ring" if len(ones) > 1 else ""
        log.problem(
            file,
            f"{who} sees {found}{more}: targets are outside its frame, behind it, seen at too flat "
            "an angle (limits.incidence_deg) or hidden; expected it to see 3 points or more,"
            " targets among them",
            row,
            name,
        )
    log.stop_if_problems()


def _seen(count, targets):
    if not count:
        return "nothing"
    return f"{count} points only" if targets else f"no target (other points: {count})"
