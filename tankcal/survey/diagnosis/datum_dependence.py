"""Which results of a survey depend on what was chosen to hold the frame, and which do not.

A quantity does not depend on the choice when no motion or scaling that the observations leave open
changes it (`network.datum.dependent` tests single ones). Silva (1995) blamed ill-conditioning for
sds of 1.37 m with another fixed station: coordinates, and their sds, are of the datum; the shape,
and its sds, is not.
"""

from dataclasses import dataclass


@dataclass(frozen=True)
class Dependence:
    """Names of quantities, in words: those that depend on the datum, and those that do not."""

    depends: tuple
    independent: tuple


def datum_dependence(report):
    """The Dependence that follows from a DatumReport."""
    if not report.defect:
        return Dependence((), ("every result",))
    depends = ["coordinates of points and photos", "their standard deviations and ellipsoids"]
    independent = ["residuals, redundancy numbers and sigma0", "angles and ratios of distances"]
    lengths = ["distances and radii with their standard deviations"]
    (independent if report.scale else depends).extend(lengths)
    upright = ["heights above a level plane, tilt and plumb of the shell"]
    (independent if report.vertical else depends).extend(upright)
    volumes = ["volumes and the capacity table with their uncertainty"]
    (independent if report.scale and report.vertical else depends).extend(volumes)
    return Dependence(tuple(depends), tuple(independent))
