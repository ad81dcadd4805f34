"""The columns of the tables of the field sheets: the same on paper and in the workbook."""

from tankcal.report.plain import Column
from tankcal.report.planning import rows

ARC, OFF, HEIGHT = (Column(key, "m", decimals=3) for key in ("arc_m", "off_m", "height_m"))
AZIMUTH = Column("azimuth_rad", "rad deg", decimals=1)
IN_COURSE = Column("height_in_course_m", "m", decimals=3)
POINT, DONE = Column("point"), Column("done", nothing="____", words="marks")
LEVELS = (Column("row"), Column("course"), IN_COURSE, HEIGHT, Column("targets", decimals=0))
LINES = (Column("line"), ARC)
TARGETS = (POINT, Column("course"), IN_COURSE, HEIGHT, ARC, DONE)
OTHERS = (POINT, ARC, OFF, HEIGHT, DONE)
STATIONS = (
    Column("station"), ARC, OFF, HEIGHT, AZIMUTH, Column("camera"),
    Column("photographs", decimals=0), Column("rolls"),
)  # fmt: skip
PHOTOGRAPHS = (
    Column("photo"), Column("station"), Column("turn_rad", "rad deg", decimals=1),
    Column("tilt_rad", "rad deg", decimals=1), Column("roll_rad", "rad deg", decimals=0),
    Column("points", decimals=0), Column("file", nothing="_" * 12), DONE,
)  # fmt: skip
SETUPS = (
    Column("setup"), ARC, OFF, HEIGHT, Column("instrument"), Column("sets", decimals=0),
    Column("points", decimals=0), Column("sights"),
    Column("direction_sd_rad", "rad arcsec", decimals=1),
    Column("zenith_sd_rad", "rad arcsec", decimals=1), Column("distance_sd_m", "mm", decimals=1),
)  # fmt: skip
TIES = (
    Column("tape"), Column("what", words="ties"), Column("from"), Column("to"),
    Column("expected_m", "m", decimals=2), Column("sd_m", "mm", decimals=1),
    Column("instrument"), Column("reading", decimals=0),
    Column("value", nothing="_" * 14, words="marks"), Column("temperature", nothing="_" * 6),
)  # fmt: skip
BASES = (
    Column("setup"), Column("to"), Column("bar"),
    Column("expected_m", "m", decimals=2, heading="base"),
    Column("expected_rad", "rad deg", decimals=3, heading="expected_m"),
    Column("angle_sd_rad", "rad arcsec", decimals=1, heading="sd_m"),
    Column("reading", decimals=0), Column("value", nothing="_" * 14, words="marks"),
)  # fmt: skip
CONTROL = (
    POINT, ARC, OFF, HEIGHT, Column("sx_m", "mm", decimals=1), Column("sy_m", "mm", decimals=1),
    Column("sz_m", "mm", decimals=1),
)  # fmt: skip
CAMERAS = (
    Column("camera"), Column("width_mm", "image mm", decimals=1),
    Column("height_mm", "image mm", decimals=1), Column("c_mm", "image mm", decimals=2),
    Column("photographs", decimals=0), Column("readings", decimals=0),
    Column("sd_mm", "image um", decimals=1),
)  # fmt: skip
INSTRUMENTS = (
    Column("instrument"), Column("kind", words="instruments"), Column("certificate"),
    Column("u_scale", "share ppm", digits=3),
)  # fmt: skip


def field_tables(prediction):
    """{name: (rows, columns)} of every table of the field sheets that has rows."""
    plan = prediction.plan
    found = {
        "levels": (rows.levels(prediction), LEVELS),
        "lines": (rows.lines(prediction), LINES),
        "targets": (rows.targets(prediction), TARGETS),
        "others": (rows.others(prediction), OTHERS),
        "stations": (rows.stations(plan), STATIONS),
        "photographs": (rows.photographs(prediction), PHOTOGRAPHS),
        "setups": (rows.setups(prediction), SETUPS),
        "ties": (rows.ties(prediction), TIES),
        "bases": (rows.bases(prediction), BASES),
        "control": (rows.control(plan), CONTROL),
        "cameras": (rows.cameras(plan), CAMERAS),
        "instruments": (rows.instruments(plan), INSTRUMENTS),
    }
    return {name: table for name, table in found.items() if table[0]}
