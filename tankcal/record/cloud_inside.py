"""The part of the record that says what scans from inside showed beside the wall."""

import numpy as np

from tankcal.record.schema import Saved, key


class ThingSeen(Saved):
    """Something in the tank: a proposed row of deadwood.csv, never taken off by itself."""

    name: str = key("proposed, once in the job")
    kind: str = key('"column", "box", "level surface" or "pit"')
    bottom_m: float = key("dip of its lowest point, above the table's zero")
    top_m: float = key("of its highest")
    volume_m3: float | None = key("negative takes room, a pit gives it; null: nothing tells it")
    u_m3: float | None = key("standard uncertainty of that")
    box_m3: float | None = key("volume of the box round what is seen; null: a pit")
    points: int | None = key("that it was told by; null: a pit")
    confirmed: bool = key("whether deadwood.csv has a row of that name")


class InsideSeen(Saved):
    """The bottom as scans from inside show it, and what stands on it."""

    seen_share: float = key("of the plan that shows the bottom")
    cell_m: float = key("side of a cell of the plan")
    cells: int = key("that show the bottom")
    points: int = key("heights that its surface was made through, means of cells")
    scatter_mm: float = key("standard deviation of the height of a cell, as its neighbours show it")
    mirrored: int = key("points under the bottom as in a mirror: it is wet where there are many")
    roof_share: float | None = key("of the plan that shows a roof; null: none is seen")
    roof_low_m: float | None = key("above the table's zero: 5 % of its points lie lower")
    roof_high_m: float | None = key("the same: 5 % lie higher")
    things: list[ThingSeen] = key("what stands in the tank, then pits")


def inside_of(result, zero_m):
    """`InsideSeen` of a result whose bottom was found in its clouds; None of another.

    zero_m  height of the table's zero in the frame of the tank, m
    """
    inside = result.clouded.inside
    if inside is None:
        return None
    bottom, roof = inside.bottom, inside.bottom.roof
    return InsideSeen(
        seen_share=bottom.seen_share,
        cell_m=bottom.grid.cell_m,
        cells=int(np.count_nonzero(bottom.is_bottom & bottom.in_plan)),
        points=len(inside.points.xyz_m),
        scatter_mm=1000 * bottom.scatter_m,
        mirrored=bottom.mirrored,
        roof_share=roof and roof.share,
        roof_low_m=roof and roof.low_m - zero_m,
        roof_high_m=roof and roof.high_m - zero_m,
        things=_things(inside, {one.name for one in result.job.deadwood}, zero_m),
    )


def _things(inside, confirmed, zero_m):
    from tankcal.pipeline.cloud_bottom import deadwood_rows

    found = []
    pairs = zip(inside.proposals, deadwood_rows(inside, zero_m), strict=True)
    for one, (name, low, high, volume, u) in pairs:
        found.append(
            ThingSeen(
                name=name,
                kind=one.kind,
                bottom_m=low,
                top_m=high,
                volume_m3=volume if np.isfinite(volume) else None,
                u_m3=u if np.isfinite(u) else None,
                box_m3=one.box_m3,
                points=one.points,
                confirmed=name in confirmed,
            )
        )
    return found
