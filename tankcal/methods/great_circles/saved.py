"""Saved part of a strapped sphere, and the tables that print it: readings, corrections, tapes."""

import numpy as np

from tankcal.methods.strapping.saved import TAPES, TapeUsed, convert_to_ppm, tapes_of
from tankcal.record.schema import Saved, key
from tankcal.report.tables.table import Column, Table

_STEPS = ("certificate", "temperature", "tension", "tape_thickness", "rise", "sag")


class CircleReading(Saved):
    """A reading of a tape round a sphere, and the great circle that it gives."""

    circle: str = key("name; repeats share it")
    kind: str = key('"equator" or "meridian"')
    azimuth_deg: float | None = key("of the plane of a meridian; null: the equator")
    tape: str = key("name")
    reading_m: float = key("as read")
    certificate_m: float = key("correction by the certificate of the tape, or by its master")
    temperature_m: float = key("correction for the temperature of the tape")
    tension_m: float = key("correction for its pull")
    tape_thickness_m: float = key("correction for half the thickness of the tape")
    rise_m: float = key("correction for what keeps it off the shell")
    sag_m: float = key("correction for where it hangs free")
    circumference_m: float = key("of the painted shell, after these corrections")
    sd_m: float = key("of it, of what no other reading shares")
    difference_m: float = key("from the great circle of the ellipsoid")
    w: float | None = key("departure from what all others show over its sd; null: uncontrolled")
    used: bool = key("false: only compared")
    row: int | None = key("of the file")


class GreatCirclesRecord(Saved):
    """A strapped sphere: every reading with its corrections, tapes, and the ellipsoid."""

    readings: list[CircleReading] = key("in the order of the file")
    tapes: list[TapeUsed] = key("those that were read")
    axis_a_m: float = key("longer horizontal semi-axis of the painted outside")
    axis_b_m: float = key("shorter one")
    axis_c_m: float = key("vertical one")
    axis_a_azimuth_deg: float = key("of the longer one, clockwise from +y")
    ovality_m: float = key("standard deviation assumed of its ovality where no strap tells it")
    oblateness_assumed: bool = key("whether how flat it is was assumed, too")
    form_m: float = key("standard deviation assumed of its radius beyond the ellipsoid")


def save_great_circles(result):
    """`GreatCirclesRecord` of a result."""
    from tankcal.geometry.great_ellipses import horizontal_axes

    sphere = result.surveys["great_circles"]
    a, b, azimuth = horizontal_axes(sphere.fit.unknowns)
    return GreatCirclesRecord(
        readings=_readings(sphere),
        tapes=tapes_of(sphere.tapes, result.job.surveys["great_circles"].strapping),
        axis_a_m=a,
        axis_b_m=b,
        axis_c_m=float(sphere.fit.unknowns[3]),
        axis_a_azimuth_deg=float(np.degrees(azimuth % np.pi)),
        ovality_m=sphere.prior.ovality_m,
        oblateness_assumed=sphere.fit.by_prior.shape[1] == 3,
        form_m=float(np.sqrt(sphere.variances_m2.sum())),
    )


def _readings(sphere):
    w = np.full(len(sphere.reduced), np.nan)
    w[sphere.adjusted] = sphere.w
    azimuths = np.degrees(sphere.azimuth_rad)
    return [
        CircleReading(
            circle=reading.strap.name,
            kind=reading.strap.course,
            azimuth_deg=azimuth,
            tape=reading.strap.tape,
            reading_m=reading.strap.reading_m,
            **{f"{step}_m": reading.steps_m[step] for step in _STEPS},
            circumference_m=reading.circumference_m,
            sd_m=reading.sd_m,
            difference_m=reading.circumference_m - length,
            w=w_of_reading,
            used=not reading.strap.check,
            row=reading.strap.row,
        )
        for reading, azimuth, length, w_of_reading in zip(
            sphere.reduced, azimuths, sphere.length_m, w, strict=True
        )
    ]


def sizes_inside(result):
    """Semi-axes inside of a strapped sphere, as surveyed: {name: (value, unit)}."""
    job = result.job
    plate = job.sphere.thickness_m if job.switches.plate else 0.0
    inside = result.surveys["great_circles"].solid(plate)
    return {
        "semi_axis_a": (inside.a_m, "m"),
        "semi_axis_b": (inside.b_m, "m"),
        "semi_axis_c": (inside.c_m, "m"),
    }


_BOTH = "circles circle_corrections"

CIRCLES = Table(
    "circles",
    (
        Column("circle", sheet="circle", width=12, csv="circle", on=_BOTH),
        Column("azimuth_deg", "deg", decimals=1, on="circles", heading="line_azimuth",
               sheet="circle_azimuth_deg", csv="azimuth_deg"),
        Column("tape", on="circles", sheet="tape", width=12, csv="tape"),
        Column("reading_m", "m", decimals=4, on=_BOTH, sheet="strap_reading_m", csv="reading_m"),
        *(
            Column(f"{step}_m", "mm", decimals=2, heading=f"strap_{step}", on="circle_corrections",
                   sheet=f"strap_{step}_mm", csv=f"{step}_mm", csv_unit="mm")
            for step in _STEPS
        ),
        Column("circumference_m", "m", decimals=4, heading="strap_circumference_m", on=_BOTH,
               sheet="strap_circumference_m", csv="circumference_m"),
        Column("sd_m", "mm", decimals=2, heading="strap_sd", on="circles", sheet="strap_sd_mm",
               csv="s_mm", csv_unit="mm"),
        Column("difference_m", "mm", decimals=1, heading="circle_difference", on="circles",
               sheet="circle_difference_mm", csv="difference_mm", csv_unit="mm"),
        Column("w", decimals=1, on="circles", sheet="w", width=8, csv="w"),
        Column("used", sheet="used", width=8, csv="used", on="circles"),
    ),
    rows=lambda record: record["great_circles"]["readings"],
    csv_style="%.6f",
)  # fmt: skip

TAPES_OF_SPHERE = Table(
    "tapes",
    TAPES.columns,
    rows=lambda record: [convert_to_ppm(tape) for tape in record["great_circles"]["tapes"]],
)
