"""Deliveries of a recalculated calculator against `tankcal.tank.deliveries`, the second method."""

import numpy as np

from tankcal.tank.deliveries import deliveries

K_RELATIVE = 1e-10  # of k: beta distribution, or the expansion in 1/dof


def held_against_deliveries(typed, table, cases, figure):
    """Second method: tankcal.tank.deliveries on the table itself.

    A delivery down to the empty tank has the stated U of the volume at its upper dip instead.
    """
    low, high = ([case[f"delivery_{end}_dip"] for case in cases] for end in ("low", "high"))
    expected = deliveries(table, low, high)
    is_part = np.interp(low, table.height_m, table.volume_m3) > 0
    for line, values, relative in (
        ("delivered", expected.volume_m3, 1e-9),
        ("delivered_u", expected.u_m3, 1e-9),
        ("delivery_dof", expected.dof, 1e-9),
        ("delivered_k", expected.k, K_RELATIVE),
        ("delivered_U", expected.U_m3, 1e-9),
        ("delivered_relative", expected.relative, 1e-9),
    ):
        of_all = line in ("delivered", "delivery_dof")
        kept = [at for at, part in enumerate(is_part) if part or of_all]
        found = np.array([typed.line(line)[at] for at in kept], dtype=float)
        worst = np.max(np.abs(found / np.minimum(np.asarray(values)[kept], 1e99) - 1))
        assert worst <= relative, line
        if figure:
            figure(
                f"calculator: {line}, largest relative difference, {len(cases)} deliveries", worst
            )
    return expected
