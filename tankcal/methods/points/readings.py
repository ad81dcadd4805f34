"""From the checked points.csv and points_cov.npz to `Points`, in SI."""

import numpy as np

from tankcal.job.covariance import read_covariance
from tankcal.job.tables import COVARIANCE_FILE
from tankcal.survey.points import Points


def make_points(tables, raw):
    """Build `Points` from tables and registers without problems."""
    table, covariance = tables["points"], raw.archives.get(COVARIANCE_FILE)
    sd_m = None
    if table.columns["sx_mm"] is not None:
        sd_m = np.column_stack([table.of(f"s{axis}_mm") for axis in "xyz"]).astype(float) / 1000
    return Points(
        names=tuple(table.of("point")),
        xyz_m=np.column_stack([table.of(f"{axis}_m") for axis in "xyz"]).astype(float),
        sd_m=sd_m,
        covariance_m2=None if covariance is None else read_covariance(covariance),
        section=tuple(table.of("section")),
        generatrix=tuple(table.of("generatrix")),
        rows=table.rows,
    )
