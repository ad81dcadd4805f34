"""Horizontal cylinder of strapped rings: inside radii and their uncertainty."""

from tankcal.pipeline.tanks.common import inside_end, is_warmed, thermal_scale
from tankcal.tank.body import SolidPart
from tankcal.tank.lying import RingedTank

SURVEYED = ("ring_radii", "dip_radius", "ring_waves")


def ringed_part(job, wall, switches):
    """`SolidPart` of a `wall.RingedWall`."""
    scale, lying = thermal_scale(job, switches), job.horizontal
    ends_m = lying.thickness_m * switches.plate
    insets = [
        switches.plate * ring.thickness_m + switches.paint * ring.paint_m for ring in job.rings
    ]
    radii = wall.radius_m - insets
    tank = RingedTank(
        tuple(float(scale * radius) for radius in radii),
        tuple(scale * ring.length_m for ring in job.rings),
        end_a=inside_end(lying.end_a, 2 * float(wall.radius_m[0]), ends_m, scale),
        end_b=inside_end(lying.end_b, 2 * float(wall.radius_m[-1]), ends_m, scale),
        tilt=lying.tilt,
        dip_from_a_m=scale * lying.dip_from_a_m,
        dip_direction=lying.dip_direction,
    )
    features = wall.features_at(lying.dip_from_a_m)
    warmed = is_warmed(job, switches)
    is_used = {
        "plate_thickness": switches.plate and any(ring.thickness_m for ring in job.rings),
        "paint": switches.paint and any(ring.paint_m for ring in job.rings),
    }
    return SolidPart(
        tank,
        scale,
        job.material.expansion_per_k,
        warmed=warmed,
        surveyed=SURVEYED,
        factors=tuple(
            factor.mapped(lambda columns: scale * columns) for factor in features.factors(job)
        ),
        unused=tuple(name for name, is_relevant in is_used.items() if not is_relevant),
        read_with=features.read_with() if warmed else {},
    )
