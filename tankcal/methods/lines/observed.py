"""Offsets of a known wall from reference lines: the reduction of the job, inverted."""

from dataclasses import replace

from tankcal.planning.wall.design_tables import OFF_WALL_M
from tankcal.planning.wall.nominal_readings import plates_of


def observe_offsets(job, wall, errors):
    """Return offsets from vertical lines.

    A larger radius lowers them outside and raises them inside.
    """
    lines, first = job.lines, job.courses[0].name
    constant = wall.nominal_m + plates_of(job)[first]
    offsets = []
    for reading, off in zip(
        lines.offsets, errors.draw([offset.sd_m for offset in lines.offsets]), strict=True
    ):
        line, plummet = lines.of(reading)
        place = reading.course, reading.level_m, line.azimuth_rad
        radius = float(wall.radius_m(*place, inside=line.inside))
        away = radius - wall.nominal_m if line.inside else constant - radius
        leans = lines.by_collimation_m(reading) * errors.collimation_rad(plummet)
        away += OFF_WALL_M + (leans if line.inside else -leans)
        away /= (1 + plummet.correction) * (1 + errors.scale(plummet))
        offsets.append(replace(reading, offset_m=away + float(off)))
    return replace(lines, offsets=tuple(offsets))
