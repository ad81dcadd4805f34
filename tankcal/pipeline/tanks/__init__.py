"""From a checked job to the body of its tank: all parts, with the enabled corrections."""

from tankcal.pipeline.tanks.common import as_surveyed, filled_with, thermal_scale
from tankcal.pipeline.tanks.vertical import (
    critical_zone,
    insets_of,
    shell_volume,
    shell_zero,
    vertical_body,
)

__all__ = [
    "as_surveyed",
    "body_of",
    "critical_zone",
    "filled_with",
    "insets_of",
    "shell_volume",
    "thermal_scale",
    "zero_height",
]


def body_of(job, survey, switches=None, uncertain=True):
    """`Body` of the tank of a job.

    Parameters
    ----------
    job : Job
    survey : wall.Wall, meshes.Mesh, scan.Scan or None
        Survey: the wall of a vertical tank, the mesh of a tank given as a mesh, the scan of another
        tank with points, otherwise None.
    switches : optional
        Enabled corrections; None: those of the job.
    uncertain : bool
        Whether to propagate the covariance of the points; sizes of corrections do not need it.
    """
    switches = job.switches if switches is None else switches
    if job.tank.kind == "vertical":
        return vertical_body(job, survey, switches, uncertain)
    from tankcal.pipeline.tanks.solid import solid_body

    return solid_body(job, survey, switches)


def zero_height(job, survey):
    """Level of the table's zero (dip 0) in the frame of the parts, m."""
    if job.tank.kind == "vertical":
        return shell_zero(job, survey)
    from tankcal.pipeline.tanks.solid import solid_zero

    return solid_zero(job)
