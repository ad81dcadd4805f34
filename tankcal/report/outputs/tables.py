"""The CSV files: tables of the record in metres, millimetres and degrees, one row a thing."""

import numpy as np
import pandas as pd

from tankcal.job.covariance import MAX_POINTS
from tankcal.report.outputs.csv_files import write_csv
from tankcal.text.digits import PROGRAM, decimals_of_rows, fixed

IN_SMALL_UNITS = {"mm": ("um", 1e3), "m": ("mm", 1e3), "rad": ("arcsec", 648000 / np.pi)}
IN_LARGE_UNITS = {"rad": ("deg", 180 / np.pi)}
LEAST_DECIMALS = 6  # micrometres, square millimetres, millilitres
FILES = (
    "points.csv",
    "points_cov.npz",
    "sections.csv",
    "capacity.csv",
    "photos.csv",
    "cameras.csv",
    "groups.csv",
    "residuals.csv",
)


def write_tables(record, directory):
    """Write every table of the record that has rows, as CSV."""
    tables = {
        "points": points_table(record),
        "sections": _sections_table(record),
        "capacity": _capacity_table(record),
    }
    if record["adjustment"]:
        tables |= {
            "photos": pd.DataFrame(record["adjustment"]["photos"]),
            "cameras": cameras_table(record["adjustment"]),
            "groups": _groups_table(record["adjustment"]),
            "residuals": residuals_table(record["adjustment"]),
        }
    for name, table in tables.items():
        if len(table):
            in_metres = name in ("points", "sections", "capacity")
            style = f"%.{LEAST_DECIMALS}f" if in_metres else "%.12g"
            write_csv(table, directory / f"{name}.csv", style)


def write_covariance(adjustment, directory):
    """Write points_cov.npz: the full covariance of all points, as a job reads it.

    Of more points than a job may have with a full covariance there is none; the covariance of each
    point by itself is in the record.
    """
    if len(adjustment.names) <= MAX_POINTS:
        np.savez(
            directory / "points_cov.npz",
            covariance_m2=adjustment.full_covariance_m2(),
            points=np.array(adjustment.names, dtype=str),
        )


def points_table(record):
    """Every point with its sds; of an adjusted survey also rays and error ellipsoid at 95 %."""
    reason = {row["point"]: row["reason"] for row in record["rejected"]}
    of_tank = record["capacity"] is not None
    adjusted = {row["point"]: row for row in (record["adjustment"] or {}).get("points", [])}
    rows = []
    for row in record["points"]:
        one = {key: row[key] for key in ("point", "x_m", "y_m", "z_m")} | _sds_mm(row["cov_m2"])
        if adjusted:
            one |= _of_adjustment(adjusted.get(row["point"]))
        if of_tank:
            one |= {
                "course": row["course"],
                "section": row["section"],
                "generatrix": row["generatrix"],
                "residual_mm": _in_mm(row["residual_m"]),
                "used": "yes" if row["used"] else "no",
                "reason": reason.get(row["point"], ""),
            }
        rows.append(one)
    return pd.DataFrame(rows)


def _of_adjustment(point):
    if point is None:
        return {}
    a, b, c = point["ellipsoid_m"]
    return {
        "kind": point["kind"],
        "rays": point["rays"],
        "fixed": "".join(axis for axis, held in zip("xyz", point["fixed"], strict=True) if held),
        "spherical_sd_mm": _in_mm(point["spherical_sd_m"]),
        "quadratic_sd_mm": _in_mm(point["quadratic_sd_m"]),
        "ellipsoid95_a_mm": _in_mm(a),
        "ellipsoid95_b_mm": _in_mm(b),
        "ellipsoid95_c_mm": _in_mm(c),
        "ellipsoid95_azimuth_deg": point["ellipsoid_azimuth_deg"],
        "ellipsoid95_elevation_deg": point["ellipsoid_elevation_deg"],
    }


def _in_mm(value_m):
    return None if value_m is None else 1000 * value_m


def _sections_table(record):
    return pd.DataFrame(record["sections"]).drop(
        columns=["points", "azimuth_deg", "residual_m", "outline", "modes"], errors="ignore"
    )


def _capacity_table(record):
    """Rows in metres and cubic metres; further columns only where the job asks for them."""
    capacity, spec = record["capacity"], record["job"]["table"]
    if capacity is None:
        return pd.DataFrame()
    U, simulated = capacity["stated_U_m3"], [one != "gum" for one in capacity["interval"]]
    digits = decimals_of_rows(U, least=LEAST_DECIMALS)
    columns = {
        "height_m": capacity["height_m"],
        "volume_m3": _to_digits(capacity["volume_m3"], digits),
        "u_m3": _to_digits(capacity["u_m3"], digits),
        "k": [None if one else k for one, k in zip(simulated, capacity["k"], strict=True)],
        "U_m3": _to_digits(U, digits),
        "low_m3": _to_digits(capacity["low_m3"], digits),
        "high_m3": _to_digits(capacity["high_m3"], digits),
        "interval": capacity["interval"],
    }
    if spec["height_unit"] != "m":
        columns["dip"] = capacity["dip"]
    for other in record["densities"]:
        columns[f"volume_m3_at_{other['density_kg_m3']:g}_kg_m3"] = _to_digits(
            other["volume_m3"], digits
        )
    if not all(capacity["for_use"]):
        columns["for_use"] = ["yes" if good else "no" for good in capacity["for_use"]]
    return pd.DataFrame(columns)


def _to_digits(values, decimals):
    """Volumes to the digits of their U, the same for all columns of a row."""
    return [fixed(value, places, PROGRAM) for value, places in zip(values, decimals, strict=True)]


def _sds_mm(covariance):
    diagonal = [None] * 3 if covariance is None else [covariance[i][i] for i in range(3)]
    return {
        f"s{axis}_mm": None if variance is None else 1000 * variance**0.5
        for axis, variance in zip("xyz", diagonal, strict=True)
    }


def cameras_table(adjustment):
    """One row a parameter: value, sd, effect at the edge of the image, correlations."""
    rows = []
    for camera in adjustment["cameras"]:
        for i, name in enumerate(camera["parameters"]):
            row = {
                "camera": camera["camera"],
                "photos": " ".join(camera["photos"] or []),
                "parameter": name,
                "value": camera["values"][i],
                "sd": camera["sds"][i],
                "unit": camera["units"][i],
                "scope": camera["scopes"][i],
                "state": camera["states"][i],
                "edge_um": camera["edge_um"][i],
            }
            if name in camera["free"]:
                its = camera["correlation"][camera["free"].index(name)]
                row |= {f"r_{other}": r for other, r in zip(camera["free"], its, strict=True)}
            rows.append(row)
    return pd.DataFrame(rows)


def _groups_table(adjustment):
    """One row a group; sd and rms in um, mm or arcsec."""
    rows = []
    for group in adjustment["groups"]:
        unit, factor = IN_SMALL_UNITS.get(group["unit"], (group["unit"], 1.0))
        small = {
            key: None if group[key] is None else factor * group[key]
            for key in ("sd_smallest", "sd_largest", "rms")
        }
        rows.append({**group, **small, "unit": unit})
    return pd.DataFrame(rows)


def residuals_table(adjustment):
    """One row a reading: value in mm, m or degrees; residual, sd and mdb in um, mm or arcsec."""
    found = adjustment["residuals"]
    width = max(map(len, found["ids"]), default=0)
    ids = zip(*(_padded(names, width) for names in found["ids"]), strict=True)
    large = [IN_LARGE_UNITS.get(unit, (unit, 1.0)) for unit in found["unit"]]
    small = [IN_SMALL_UNITS.get(unit, (unit, 1.0)) for unit in found["unit"]]
    columns = {
        "kind": found["kind"],
        **{f"id_{number}": names for number, names in enumerate(ids, 1)},
        "element": found["element"],
        "value": _in_units(found["value"], large),
        "value_unit": [unit for unit, _ in large],
        **{key: _in_units(found[key], small) for key in ("residual", "sd", "mdb")},
        "unit": [unit for unit, _ in small],
        "redundancy": found["redundancy"],
        "w": found["w"],
        "tau": found["tau"],
        "effect_mm": [_in_mm(value) for value in found["effect_m"]],
        **{key: [_YES[one] for one in found[key]] for key in ("controlled", "removed", "check")},
        "repeats": found["repeats"],
        "file": found["file"],
        "row": found["row"],
    }
    return pd.DataFrame(columns, dtype=object)


_YES = {True: "yes", False: "no"}


def _in_units(values, units):
    """Values times the factors of their units; None stays."""
    return [
        None if value is None else value * factor
        for value, (_, factor) in zip(values, units, strict=True)
    ]


def _padded(ids, width):
    return [*ids, *[""] * (width - len(ids))]
