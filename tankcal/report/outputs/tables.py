"""The CSV files: tables of the record in metres, millimetres and degrees."""

import numpy as np

from tankcal.job.covariance import MAX_POINTS
from tankcal.methods.base import methods
from tankcal.record.columns import count_rows
from tankcal.report.outputs.csv_files import write_table
from tankcal.report.tables import (
    capacity,
    readings,
    ship,
    survey,
    tank,
)
from tankcal.text.digits import PROGRAM, decimals_of_rows, fixed

LEAST_DECIMALS = 6  # smallest number of decimals: volumes to millilitres
FILES = (
    "points.csv",
    "points_cov.npz",
    "sections.csv",
    *(file for method in methods() for file in method.csv_files),
    "capacity.csv",
    "ship_corrections.csv",
    "photos.csv",
    "cameras.csv",
    "groups.csv",
    "residuals.csv",
)


def write_tables(record, directory):
    """Write all tables of the record with rows as CSV files."""
    tables = {
        "points": (survey.POINTS, survey.point_columns(record)),
        "sections": (tank.SECTIONS, None),
    }
    for method in methods():
        if record.get(method.name):
            tables |= {name: (table, None) for name, table in method.csv_tables(record).items()}
    if record["capacity"]:
        tables["capacity"] = capacity.capacity_table(record), _capacity(record)
    if record.get("ship"):
        tables["ship_corrections"] = ship.CORRECTIONS, ship.corrections_columns(record)
    if record["adjustment"]:
        cameras, observed = (record["adjustment"][key] for key in ("cameras", "residuals"))
        free = dict.fromkeys(name for camera in cameras for name in camera["free"])
        tables |= {
            "photos": (survey.PHOTOS, None),
            "cameras": (survey.camera_table(free), None),
            "groups": (readings.GROUPS, None),
            "residuals": (readings.READINGS, readings.convert_units(observed)),
        }
    for name, (table, columns) in tables.items():
        rows = table.rows(record) if columns is None else columns
        if len(rows) and (columns is None or count_rows(columns)):
            write_table(table, directory / f"{name}.csv", rows)


def write_covariance(adjustment, directory):
    """Write points_cov.npz, the full covariance matrix of all points, in the format of a job.

    The file is omitted if the survey exceeds the limit of a job with a full covariance matrix. The
    record contains the covariance matrix of each point.
    """
    if len(adjustment.names) <= MAX_POINTS:
        np.savez(
            directory / "points_cov.npz",
            covariance_m2=adjustment.full_covariance_m2(),
            points=np.array(adjustment.names, dtype=str),
        )


def _capacity(record):
    """Return the columns of the capacity table, with volumes rounded to the digits of U."""
    columns = capacity.capacity_columns(record)
    digits = decimals_of_rows(columns["stated_U_m3"], least=LEAST_DECIMALS)
    return {
        key: [fixed(value, places, PROGRAM) for value, places in zip(values, digits, strict=True)]
        if "_m3" in key
        else values
        for key, values in columns.items()
    }
