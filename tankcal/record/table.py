"""The capacity table in the record, with what stands beside its rows."""

from tankcal.pipeline.chain import PARTS
from tankcal.record.covariance_factor import FactorBlock, blocks_of
from tankcal.record.schema import Finite, Saved, filled_from, key
from tankcal.record.statements import intervals_of
from tankcal.tank.dips import ProportionalParts, dip_label

LEAST_PART_M3 = 1e-4  # last place of a printed part: an error below it is not told apart


class CapacityTable(Saved):
    """The capacity table and its covariance: its factor, in blocks, times the transpose of that."""

    zero: str = key("what heights count from, a code")
    zero_m: Finite = key("height of the zero above the bottom")
    height_m: list[Finite] = key("dips of the rows, above the zero")
    dip: list[str] = key("the same as text in the table's unit")
    volume_m3: list[Finite] = key("below the dip")
    u_m3: list[Finite] = key("standard uncertainty")
    U_m3: list[Finite] = key("expanded uncertainty")
    k: list[Finite] = key("coverage factor")
    dof: list[float] = key("degrees of freedom; null: infinite")
    area_m2: list[float] = key("derivative of the volume by the dip")
    for_use: list[bool] = key("false inside the critical zone of a floating roof")
    low_m3: list[Finite] = key("interval that counts")
    high_m3: list[Finite] = key("interval that counts")
    interval: list[str] = key('where it comes from: "gum", or "monte_carlo", which does not agree')
    stated_U_m3: list[Finite] = key("as printed: the larger distance of the ends from the volume")
    inputs: list[str] = key("name of each column of the factor")
    input_kind: list[str] = key("kind of input, see below")
    factor: list[FactorBlock] = key("rows x inputs, in blocks of rows")


class InterpolationError(Saved):
    """The largest error of linear interpolation between two rows."""

    largest_m3: float = key("of a volume")
    at_m: float = key("dip where it is")


class PartsOfRows(Saved):
    """What 1 to 9 millimetres add to a row of a centimetre table."""

    parts: int = key("of a row")
    zones: list[ProportionalParts] = key("between joints and edges; only where the error is small")
    largest_m3: float | None = key("largest error, at least the last place that is printed")


class VolumesOfDensity(Saved):
    """The volumes of the same rows for a further density of the liquid."""

    density_kg_m3: float = key("of the liquid")
    volume_m3: list[Finite] = key("of each row")


class GrossShell(Saved):
    """The shell as surveyed, without any correction, over its full height."""

    volume_m3: float = key("of the shell")
    area_m2: float = key("mean")


def capacity_of(result):
    """The `CapacityTable` of a result, each column of the factor named."""
    table = result.table
    kinds = [source.kind for source in table.sources for _ in range(source.columns_m3.shape[1])]
    counts = {kind: kinds.count(kind) for kind in kinds}
    numbers = [kinds[: i + 1].count(kind) for i, kind in enumerate(kinds)]
    return filled_from(
        CapacityTable,
        table,
        zero=zero_of(result),
        zero_m=result.zero_m,
        dip=[dip_label(height, result.job.table.height_unit) for height in table.height_m],
        for_use=table.for_use(table.height_m),
        **intervals_of(result),
        inputs=[
            kind if counts[kind] == 1 else f"{kind} {number}"
            for kind, number in zip(kinds, numbers, strict=True)
        ],
        input_kind=kinds,
        factor=blocks_of(table.factor_m3),
    )


def proportional_parts_of(result):
    """`PartsOfRows`: what the millimetres of a dip add to a row, zone by zone."""
    zones = result.proportional_parts
    largest_m3 = max((_printed_error_m3(zone) for zone in zones), default=None)
    return PartsOfRows(PARTS, zones, largest_m3)


def _printed_error_m3(zone):
    return max(abs(zone.deviation_m3), LEAST_PART_M3)


def densities_of(result):
    """The `VolumesOfDensity` of each further density of the liquid."""
    return [VolumesOfDensity(*one) for one in result.by_density.items()]


def zero_of(result):
    """What heights of the table count from, as a code."""
    if result.job.ship is not None:
        return "pipe_bottom"
    if result.job.datum.dip_plate_z_m is not None:
        return "dip_plate"
    return "bottom" if result.job.tank.kind == "vertical" else f"{result.job.tank.kind}_bottom"


def gross_of(result):
    """`GrossShell` of a tank; None for a tank without courses."""
    shell = result.gross
    if shell is None:
        return None
    top_row_m = result.table.height_m[-1] + result.zero_m
    over_m = top_row_m - result.body.highest_m  # as the corrections, so that they add up
    area = float(shell.area_m2(shell.height_m)[0])
    volume = float(shell.volume_m3(shell.height_m)[0]) + over_m * area
    return GrossShell(volume, volume / (shell.height_m + over_m))
