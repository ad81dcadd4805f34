"""Columns that tables of several methods of measurement have.

They are not in the package `contract`, whose complete lists include the columns of the methods: a
method imports this module while those lists are being made.
"""

from tankcal.job.fields import Field

ANGLE_UNITS = ("deg", "gon", "dms")
FULL_CIRCLE = {"deg": 360, "gon": 400, "dms": 360}
SURFACES = ("paint", "rust", "tape")  # surfaces with separate biases of ranging
USE = Field(
    "use",
    "choice",
    "check: only compared with the adjusted values; blank: adjust",
    choices=("adjust", "check"),
)
NOTE = Field("note", "text", "remark for the reader")


def angle_fields(name, note, circles=(0, 1)):
    """Return the columns of an angle, a column for each unit of ANGLE_UNITS.

    Parameters
    ----------
    name : str
        Name of the columns without the unit.
    note : str
        Note of the columns without the unit, which is added before the first semicolon.
    circles : tuple of float, optional
        Lower and upper bound, in parts of the full circle.

    Returns
    -------
    tuple of Field
    """
    quantity, semicolon, condition = note.partition(";")
    words = {
        "deg": "degrees",
        "gon": "gon",
        "dms": "degrees, minutes and seconds: 123 04 05.6",
    }
    return tuple(
        Field(
            f"{name}_{unit}",
            "dms" if unit == "dms" else "number",
            f"{quantity}, {words[unit]}{semicolon}{condition}",
            low=circles[0] * FULL_CIRCLE[unit],
            high=circles[1] * FULL_CIRCLE[unit],
        )
        for unit in ANGLE_UNITS
    )


def readings_by_tape(reading_note):
    """Return the columns of a tape reading of a circumference, and of its conditions."""
    return (
        _number("reading_m", reading_note, 0.3, 1000, required=True),
        _number(
            "s_mm", "standard deviation of one reading, millimetres", 0, 100, required=True,
            above_low=True,
        ),
        Field(
            "instrument", "name", "tape of instruments.toml; blank: the only tape there except"
            " masters",
        ),
        _number(
            "temperature_c",
            "temperature of the tape, degrees Celsius; blank: equal to the shell temperature",
            -60,
            120,
        ),
        _number(
            "tension_n",
            "pull at the ends of the tape, newtons; for a tape without friction the mean round"
            " the tank; blank: tension of the certificate",
            0,
            1000,
            above_low=True,
        ),
    )  # fmt: skip


def _number(name, note, low, high, required=False, above_low=False):
    return Field(name, "number", note, required=required, low=low, high=high, above_low=above_low)
