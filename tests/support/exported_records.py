"""Records with any table in them (a kept record whose rows are replaced), and closed forms."""

import gzip
import json
from copy import deepcopy
from functools import cache
from pathlib import Path

import numpy as np

from tankcal.record import migrated, save
from tankcal.record.covariance_factor import factor_of
from tankcal.tank.dips import interpolation_errors

_KEPT = Path(__file__).parents[1] / "records" / "1" / "cluttered.json.gz"


@cache
def _kept():
    return migrated(json.loads(gzip.decompress(_KEPT.read_bytes())), "record.json")


def record_with(height, volume, own_m3=0.0, **changes):
    """A record, as plain data, whose table has these rows and errs by own_m3 between them."""
    record = deepcopy(_kept())
    rows = len(height)
    table = record["capacity"]
    top = factor_of(table)[-1:].tolist()
    for key, value in table.items():
        if isinstance(value, list) and key not in ("inputs", "input_kind"):
            table[key] = [value[-1]] * rows
    table["height_m"], table["volume_m3"] = (np.asarray(one).tolist() for one in (height, volume))
    table["factor"] = [{"rows": rows, "weights": [[1.0]] * rows, "factor_m3": top}]
    record["interpolation"] = {"largest_m3": own_m3, "at_m": 0.0}
    record["roof"] = None
    return record | changes


def written_record(folder, height, volume, own_m3=0.0, **changes):
    """The path of such a record in a folder."""
    path = folder / "record.json"
    save(record_with(height, volume, own_m3, **changes), path)
    return path


def exact_record(folder, volume, height, edges=()):
    """A record of a closed form at these rows, with what straight lines between them err."""
    own = interpolation_errors(volume, height, edges).largest_m3
    return written_record(folder, height, volume(height), own)


TOP_S1 = 8.4


def lying(h, radius=1.2, length=10.0):
    h = np.clip(h, 0, 2 * radius)
    across = np.sqrt(2 * radius * h - h**2)
    return length * (radius**2 * np.arccos(1 - h / radius) - (radius - h) * across)


def ellipsoidal(h, radius=1.2, depth=0.6):
    return lying(h, radius) + np.pi * depth * h**2 * (1 - h / (3 * radius))


def sphere(h, diameter=12.0):
    return np.pi * h**2 * (diameter / 2 - h / 3)


def tank_s1(h):
    """Tank S-1 with the head of 850 kg/m3, first order, and deadwood of -0.35 m3."""
    total, bottom = -0.35 * np.clip((h - 0.5) / 0.4, 0, 1), 0.0
    for radius, height, plate in zip(
        (7.203189, 7.203171, 7.203422, 7.203563, 7.203165),
        (1.8, 1.8, 1.8, 1.5, 1.5),
        (0.009, 0.008, 0.007, 0.006, 0.006),
        strict=True,
    ):
        low, high = np.maximum(h - bottom - height, 0), np.maximum(h - bottom, 0)
        swelling = 850 * 9.80665 * radius**2 / (206e9 * plate)
        total = total + np.pi * radius**2 * (high - low)
        total += np.pi * radius * swelling * (high**2 - low**2)
        bottom += height
    return total


def rows(volume, top, step):
    h = np.arange(round(top / step) + 1) * step
    return h, volume(h)
