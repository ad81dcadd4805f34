"""Readings by tape of a known wall: the reduction of the job, inverted."""

from dataclasses import replace

import numpy as np

from tankcal.survey.strapping import reduce_straps

CLOSE_M, ROUNDS = 1e-12, 20  # convergence limit and largest number of iterations


def observe_straps(job, wall, errors):
    """Return tape readings whose reduction gives the perimeters of the wall, by iteration."""
    strapping, diameter = job.strapping, job.tank.nominal_diameter_m
    shell_c = job.survey.shell_temperature_c
    girth = np.array([wall.girth_m(strap.course, strap.level_m) for strap in strapping.straps])
    reduced = reduce_straps(strapping, shell_c, diameter)
    # Errors are added to the reduced perimeters, in which the standard deviations are defined.
    girth += errors.draw([strap.sd_m for strap in reduced])
    girth += [
        sum(errors.draw_cause(e.kind, e.name) * e.by_m for e in strap.effects) for strap in reduced
    ]
    # The reduction (temperature, tension, friction) depends on the reading: invert by iteration.
    for _ in range(ROUNDS):
        reduced = reduce_straps(strapping, shell_c, diameter)
        short = girth - [strap.circumference_m for strap in reduced]
        straps = zip(strapping.straps, short, strict=True)
        strapping = replace(
            strapping,
            straps=tuple(
                replace(strap, reading_m=strap.reading_m + float(by)) for strap, by in straps
            ),
        )
        if np.abs(short).max() < CLOSE_M:
            break
    return strapping
