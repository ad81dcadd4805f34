"""What stands in a tank of any kind."""

from tankcal.tank.fittings import deadwood


def deadwood_part(items, zero_m):
    """The declared deadwood as a part; its heights are dips, zero_m the level of dip 0."""
    return deadwood(
        [item.name for item in items],
        [item.bottom_m + zero_m for item in items],
        [item.top_m + zero_m for item in items],
        [item.volume_m3 for item in items],
        [item.u_m3 for item in items],
    )
