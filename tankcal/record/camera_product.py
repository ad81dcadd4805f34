"""A product check as it is saved: kind "product" of camera.json."""

from typing import Literal

from tankcal.calibration.product.check import ADVISED, AxisCheck, Precision, Reached
from tankcal.record.camera_versions import CameraFile
from tankcal.record.schema import Saved, filled_from, key, to_plain


class PartJudged(Saved):
    """Differences of a part."""

    part: str = key('"plan" (x and y together) or "height"')
    n: int = key("points")
    rmse_m: float = key("as the differences are")
    rmse_unbiased_m: float = key("less the significant means")
    largest_m: float = key("largest magnitude")


class ProductNote(Saved):
    """What should be read: few_points, no_tests, share_means_all, axis_without_points, ..."""

    code: str = key("fewer than `advised`; than 2; than 10: 90 % of them are all of them; ...")
    n: float = key("points, or the number of the axis")


class LimitsUsed(Saved):
    """The limit table."""

    name: str = key("of the table")
    source: str = key("where its limits were read")
    share: float = key("of the points that must lie within the tolerance, 0 to 1")
    verified: bool | None = key("whether they were read in the text itself; null: not said")
    remark: str = key("what is to stand beside it")
    code: str | None = key("of a shipped table")


class ClassJudged(Saved):
    """A class of a scale: reached with `share` of the points within tolerance_m, rmse_m in sd_m."""

    part: str = key('"plan" or "height"')
    scale: str = key('text, such as "1000"')
    grade: str = key("name of the class")
    tolerance_m: float = key("that a share of the points must keep")
    sd_m: float = key("bound of the RMSE")
    n: int = key("points")
    as_is: Reached = key("as the differences are")
    unbiased: Reached = key("less the significant means")
    precision: list[Precision] = key("of each axis")
    precise: bool | None = key("whether all of them passed; null: cannot be said")


class BestClass(Saved):
    """The best class of a scale; null: none is reached."""

    part: str = key('"plan" or "height"')
    scale: str = key('text, such as "1000"')
    grade: str | None = key("as the differences are")
    grade_unbiased: str | None = key("less the significant means")


class Difference(Saved):
    """Product minus truth at a point; only the axes that there are; null: not known."""

    point: str = key("name")
    dx_m: float | None = key("along x", optional=True)
    dy_m: float | None = key("along y", optional=True)
    dz_m: float | None = key("along z", optional=True)


class ProductFile(CameraFile, kw_only=True):
    """What differences at check points say of a product."""

    kind: Literal["product"] = key("product", default="product")
    alpha: float = key("level of the tests of bias (two-sided) and of precision (upper)")
    n: int = key("points")
    axes: list[AxisCheck] = key("each axis")
    parts: list[PartJudged] = key("plan and height where known")
    notes: list[ProductNote] = key("what should be read")
    advised: int = key("points that a test of accuracy should have")
    table: LimitsUsed | None = key("null: no limits were asked for")
    verdicts: list[ClassJudged] = key("each class")
    best: list[BestClass] = key("each scale")
    differences: list[Difference] = key("each point")


def product_of(check):
    """The `ProductFile` of a ProductCheck."""
    return filled_from(
        ProductFile,
        check,
        n=len(check.names),
        axes=check.checks,
        parts=[filled_from(PartJudged, one, largest_m=one.size_m.max()) for one in check.parts],
        notes=[ProductNote(*one) for one in check.notes],
        advised=ADVISED,
        table=filled_from(LimitsUsed, check.table),
        verdicts=[filled_from(ClassJudged, one) for one in check.verdicts],
        best=_best(check),
        differences=[
            {"point": name}
            | {f"d{axis}_m": value for axis, value in zip(check.axes, row, strict=True)}
            for name, row in zip(check.names, check.difference_m, strict=True)
        ],
    )


def as_json(check):
    """The same as plain data."""
    return to_plain(product_of(check))


def _best(check):
    scales = dict.fromkeys((one.part, one.scale) for one in check.verdicts)
    return [
        BestClass(part, scale, check.best(part, scale), check.best(part, scale, unbiased=True))
        for part, scale in scales
    ]
