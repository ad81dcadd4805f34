"""Columns of points.csv."""

from tankcal.job.fields import Field, number, positive


def _sd(axis):
    """Return the column of the standard deviation of a coordinate."""
    return positive(
        f"s{axis}_mm",
        f"standard deviation of {axis}, millimetres; for all points or for none",
        1000,
        in_full=True,
    )


def _coordinate(axis, limit):
    """Return the column of a coordinate."""
    note = f"coordinate {axis}, metres"
    return number(f"{axis}_m", note, -limit, limit, required=True)


POINTS = (
    Field("point", "name", "name of the point, unique in the file", required=True),
    _coordinate("x", 1e8),
    _coordinate("y", 1e8),
    _coordinate("z", 1e5),
    _sd("x"),
    _sd("y"),
    _sd("z"),
    Field("section", "name", "name of the ring of points; blank: assigned by height"),
    Field("generatrix", "name", "name of the vertical line of points"),
)
EXAMPLES = {
    "points": [
        {"point": "P101", "x_m": 6.4987, "y_m": 0.0213, "z_m": 0.9502, "section": "1"},
        {"point": "P102", "x_m": 6.2761, "y_m": 1.6834, "z_m": 0.9498, "section": "1"},
    ],
}
