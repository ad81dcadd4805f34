"""Check that photographs and set-ups see enough points."""

from tankcal.job.tables import Log
from tankcal.messages import message

FEWEST = 3  # fewest points on a photograph


def refuse_blind(plan, seen):
    """Raise InputError for photographs and set-ups that see too few points.

    One message per ring.
    """
    log, blind = Log(), {}
    for k, photo in enumerate(plan.photos):
        count, targets = (int(seen.on_photo[k, :n].sum()) for n in (None, len(plan.targets.names)))
        if count < FEWEST or not targets:
            text = _seen(count, targets)
            blind.setdefault(photo.place, []).append(
                (message("plan_a_photograph", "photograph {photo}", photo=photo.name), text)
            )
    for k, setup in enumerate(plan.setups):
        if not seen.on_setup[k].any():
            blind.setdefault(setup.place, []).append(
                (message("plan_a_setup", "set-up {setup}", setup=setup.name), "nothing")
            )
    for (file, row, name), ones in blind.items():
        who, text = ones[0]
        more = (
            message("plan_more_of_ring", ", and {more} more of this ring", more=len(ones) - 1)
            if len(ones) > 1
            else ""
        )
        log.problem(
            file,
            message(
                "plan_sees_too_little",
                "{who} sees {found}{more}: targets are outside its frame, behind it, seen at too "
                "flat an angle (limits.incidence_deg) or hidden; expected it to see 3 points or "
                "more, targets among them",
                who=who,
                found=text,
                more=more,
            ),
            row,
            name,
        )
    log.stop_if_problems()


def _seen(count, targets):
    if not count:
        return _nothing()
    if not targets:
        return message("plan_no_target", "no target (other points: {count})", count=count)
    if count == 1:
        return message("plan_one_point_only", "{count} point only", count=count)
    return message("plan_points_only", "{count} points only", count=count)


def _nothing():
    return message("plan_nothing", "nothing")
