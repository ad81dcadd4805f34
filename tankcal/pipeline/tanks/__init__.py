"""From a checked job to the body of its tank: every part, with the corrections that are on."""

from tankcal.pipeline.tanks.common import as_declared, thermal_scale
from tankcal.pipeline.tanks.vertical import (
    critical_zone,
    insets_of,
    shell_volume,
    shell_zero,
    vertical_body,
)

__all__ = [
    "as_declared",
    "body_of",
    "critical_zone",
    "heeled_body",
    "insets_of",
    "shell_volume",
    "thermal_scale",
    "zero_height",
]


def body_of(job, survey, switches=None, uncertain=True):
    """The tank of a job.

    survey     what was surveyed: the `wall.Wall` of a vertical tank, the `meshes.Mesh` of one that
               is given as a mesh, the `scan.Scan` of another that has points, else None
    switches   which corrections are on; those of the job when None
    uncertain  whether the points' covariance is propagated, too (sizes of corrections need none)
    """
    switches = job.switches if switches is None else switches
    if job.tank.kind == "vertical":
        return vertical_body(job, survey, switches, uncertain)
    from tankcal.pipeline.tanks.solid import solid_body

    return solid_body(job, survey, switches)


def heeled_body(job, survey, trim, list_):
    """The tank of a ship at tangents of trim and list; levels are soundings along its pipe."""
    from tankcal.pipeline.tanks.solid import solid_body

    return solid_body(job, survey, job.switches, (trim, list_))


def zero_height(job, survey):
    """Level of the table's zero (dip 0) in the frame of the parts, m."""
    if job.tank.kind == "vertical":
        return shell_zero(job, survey)
    from tankcal.pipeline.tanks.solid import solid_zero

    return solid_zero(job)
