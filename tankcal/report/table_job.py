"""The folder of a job that was made of a former table."""

import numpy as np

from tankcal.report.folders import refuse_foreign, replaced

COVARIANCE = "radii_cov.npz"
FILES = (
    *("job.toml", "courses.csv", "radii.csv", COVARIANCE, "bottom.csv", "deadwood.csv"),
    "uncertainty.csv",
)


def refuse_foreign_job(directory):
    """Raise InputError when `directory` holds what `write_job` did not write."""
    refuse_foreign(directory, FILES)


def write_job(job, directory):
    """Write the files of a `JobOfTable`, all or nothing; returns their names."""
    has_radii = job.covariance_m2 is not None
    names = [name for name in FILES if name in job.texts or (name == COVARIANCE and has_radii)]
    with replaced(directory) as folder:
        for name, text in job.texts.items():
            (folder / name).write_text(text, encoding="utf-8")
        if has_radii:
            np.savez(
                folder / COVARIANCE,
                covariance_m2=job.covariance_m2,
                courses=np.array(job.courses, dtype=str),
            )
    return names
