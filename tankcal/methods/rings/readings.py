"""From the checked rings.csv to the `Ring`s of a tank, in SI, and their diameter."""

import numpy as np

from tankcal.job.assembly import plate_and_paint
from tankcal.job.model.parts import Ring
from tankcal.job.strapping import gauged


def make_rings(tables):
    """Build the `Ring`s from end A to end B from tables without problems."""
    table, gauge_means = tables["rings"], gauged(tables["thickness"])
    columns = map(table.of, ("ring", "length_m", "thickness_mm", "paint_mm", "lap"))
    return tuple(
        Ring(
            name,
            length_m,
            *plate_and_paint(
                (thickness_mm or 0.0) / 1000, (paint_mm or 0.0) / 1000, gauge_means.get(name)
            ),
            lap,
        )
        for name, length_m, thickness_mm, paint_mm, lap in zip(*columns, strict=True)
    )


def estimate_diameter_m(tables):
    """Approximate inside diameter of strapped rings, m; None without readings of a tape."""
    if tables["circumferences"] is None:
        return None
    readings = [value for value in tables["circumferences"].of("reading_m") if value is not None]
    plates = [value for value in tables["rings"].of("thickness_mm") if value is not None]
    if not readings:
        return None
    # Subtract two plates from the outside diameter, mm to m.
    return float(np.median(readings) / np.pi - 2e-3 * (np.median(plates) if plates else 0.0))
