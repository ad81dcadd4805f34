"""Keys of instruments.toml for ranging on the bare wall, without a reflector."""

from tankcal.job.fields import Field

USUAL_INCIDENCE_MM = 1.0  # default standard uncertainty of the bias at 60 degrees incidence, mm
RANGING = (  # keys of instruments.toml for ranging on the wall
    Field(
        "s_mm",
        "number",
        "standard deviation of a distance to the bare wall, millimetres",
        low=0,
        high=1e3,
        above_low=True,
    ),
    Field(
        "s_arcsec",
        "number",
        "standard deviation of a direction or a zenith angle to the bare wall, seconds of arc",
        low=0,
        high=1e4,
        above_low=True,
    ),
    Field(
        "u_incidence_mm",
        "number",
        "standard uncertainty of the ranging bias at 60 degrees of incidence, relative to"
        " perpendicular incidence, millimetres; blank: 1",
        low=0,
        high=100,
    ),
)
