"""From the checked rings.csv to the `Ring`s of a tank, in SI, and their diameter."""

import numpy as np

from tankcal.job.assembly import gauged_plate
from tankcal.job.model.parts import Ring
from tankcal.job.structure import structure
from tankcal.job.tapes import gauged


def make_rings(tables):
    """Build the `Ring`s from end A to end B from tables without problems."""
    gauge_means = gauged(tables["thickness"])
    return tuple(
        structure(Ring, cells | gauged_plate(gauge_means.get(cells["ring"])), name=cells["ring"])
        for cells in tables["rings"].records()
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
