"""Dataclasses in SI from checked values, by the names of their attributes.

A name in a job ends with its unit: thickness_mm, tilt_mm_per_m, e_gpa. The attribute of a dataclass
has the same stem and ends with the SI unit: thickness_m, tilt, e_pa. `structure` therefore finds
and converts each value by its name. A `Field` needs no second declaration of its unit.
"""

from dataclasses import MISSING, fields

import numpy as np

from tankcal.units import ARCSEC, GON

# Unit at the end of a name in a job: unit at the end of the attribute, and conversion. Values are
# divided by 1000, not multiplied by 0.001, which has no exact binary form.
_CONVERSIONS = {
    "_mm_per_m": ("", lambda value: value / 1000),
    "_mm": ("_m", lambda value: value / 1000),
    "_um": ("_mm", lambda value: value / 1000),  # of images, whose unit is mm
    "_l": ("_m3", lambda value: value / 1000),
    "_percent": ("", lambda value: value / 100),
    "_ppm": ("", lambda value: value / 1e6),
    "_deg": ("_rad", np.radians),
    "_arcsec": ("_rad", lambda value: value * ARCSEC),
    "_bar": ("_pa", lambda value: 1e5 * value),
    "_mpa": ("_pa", lambda value: 1e6 * value),
    "_gpa": ("_pa", lambda value: 1e9 * value),
}
_RADIANS = {"deg": np.pi / 180, "gon": GON, "dms": np.pi / 180}  # by the ending of a column


def to_si(values):
    """Convert the numbers of a dict of keys or of columns to SI.

    Parameters
    ----------
    values : dict of {str: object}
        Values by name; numbers, arrays, tuples of numbers, words in place of a number, or None.

    Returns
    -------
    dict of {str: object}
        Values by the name with the SI unit. Words, None and names without a unit are unchanged.

    Examples
    --------
    >>> to_si({"thickness_mm": 8.0, "height_m": 2.4, "paint_mm": None})
    {'thickness_m': 0.008, 'height_m': 2.4, 'paint_m': None}
    """
    converted = {}
    for name, value in values.items():
        unit = next((unit for unit in _CONVERSIONS if name.endswith(unit)), None)
        if unit is None:
            converted[name] = value
            continue
        si_unit, convert = _CONVERSIONS[unit]
        converted[name.removesuffix(unit) + si_unit] = _convert(value, convert)
    return converted


def _convert(value, convert):
    if value is None or isinstance(value, str):
        return value
    if isinstance(value, list | tuple):
        return tuple(float(convert(part)) for part in value)
    return convert(value) if isinstance(value, np.ndarray) else float(convert(value))


def structure(cls, values, **others):
    """Build a dataclass from checked values.

    Parameters
    ----------
    cls : type
        A dataclass, in SI.
    values : dict of {str: object}
        Checked values by their names in the job; further values are left out.
    **others
        Attributes that need more than a conversion, in place of a value of that name.

    Returns
    -------
    cls
        A blank value takes the default of its attribute, or None without a default.

    Examples
    --------
    >>> from tankcal.job.model import Course
    >>> structure(Course, {"height_m": 2.4, "thickness_mm": 8.0, "paint_mm": None}, name="I")
    Course(name='I', height_m=2.4, thickness_m=0.008, paint_m=0.0, welds_rad=None)
    """
    converted, arguments = to_si(values), dict(others)
    for field in fields(cls):
        if field.name in others or field.name not in converted:
            continue
        has_default = field.default is not MISSING or field.default_factory is not MISSING
        if converted[field.name] is not None or not has_default:
            arguments[field.name] = converted[field.name]
    return cls(**arguments)


def angle_in_rad(table, name):
    """Angle of each row, shape (n,), rad, from any of its units; nan where it is blank."""
    angle = np.full(len(table.rows), np.nan)
    for unit, factor in _RADIANS.items():
        column = f"{name}_{unit}"
        if table.columns.get(column) is not None:
            given = table.numbers(column) * factor
            angle = np.where(np.isnan(given), angle, given)
    return angle
