"""Check of a product at check points: kind "product" of camera.json."""

from typing import Literal

from tankcal.calibration.product.check import ADVISED, AxisCheck, Precision, Reached
from tankcal.record.camera_versions import CameraFile
from tankcal.record.schema import Saved, fill_from, key, to_plain


class PartJudged(Saved):
    """Differences of a part."""

    part: str = key('"plan" (x and y together) or "height"')
    n: int = key("points")
    rmse_m: float = key("of the differences")
    rmse_unbiased_m: float = key("of the differences less their significant means")
    largest_m: float = key("largest magnitude")


class ProductNote(Saved):
    """A note: few_points, no_tests, share_means_all, axis_without_points, ..."""

    code: str = key("fewer points than `advised`; than 2; than 10 (90 % are all points); ...")
    n: float = key("points, or the number of the axis")


class LimitsUsed(Saved):
    """The limit table."""

    name: str = key("of the table")
    source: str = key("of its limits")
    share: float = key("of the points that must lie within the tolerance, 0 to 1")
    verified: bool | None = key("whether they were read in the text itself; null: unknown")
    remark: str = key("to be printed with the table")
    code: str | None = key("of a shipped table")


class ClassJudged(Saved):
    """A class of a scale: reached with `share` of the points within tolerance_m, rmse_m in sd_m."""

    part: str = key('"plan" or "height"')
    scale: str = key('text, such as "1000"')
    grade: str = key("name of the class")
    tolerance_m: float = key("that a share of the points must meet")
    sd_m: float = key("bound of the RMSE")
    n: int = key("points")
    as_is: Reached = key("by the differences")
    unbiased: Reached = key("by the differences less their significant means")
    precision: list[Precision] = key("of each axis")
    precise: bool | None = key("whether all axes passed; null: not determined")


class BestClass(Saved):
    """The best class of a scale; null: no class is reached."""

    part: str = key('"plan" or "height"')
    scale: str = key('text, such as "1000"')
    grade: str | None = key("by the differences")
    grade_unbiased: str | None = key("by the differences less their significant means")


class Difference(Saved):
    """Product minus truth at a point; only existing axes; null: not known."""

    point: str = key("name")
    dx_m: float | None = key("along x", optional=True)
    dy_m: float | None = key("along y", optional=True)
    dz_m: float | None = key("along z", optional=True)


class ProductFile(CameraFile, kw_only=True):
    """Accuracy of a product from differences at check points."""

    kind: Literal["product"] = key("product", default="product")
    alpha: float = key("level of the tests of bias (two-sided) and of precision (upper)")
    n: int = key("points")
    axes: list[AxisCheck] = key("each axis")
    parts: list[PartJudged] = key("plan and height if known")
    notes: list[ProductNote] = key("on the check")
    advised: int = key("number of points advised for a test of accuracy")
    table: LimitsUsed | None = key("null: no limits were requested")
    verdicts: list[ClassJudged] = key("each class")
    best: list[BestClass] = key("each scale")
    differences: list[Difference] = key("each point")


def product_of(check):
    """Return the `ProductFile` of a ProductCheck."""
    return fill_from(
        ProductFile,
        check,
        n=len(check.names),
        axes=check.checks,
        parts=[fill_from(PartJudged, part, largest_m=part.size_m.max()) for part in check.parts],
        notes=[ProductNote(*note) for note in check.notes],
        advised=ADVISED,
        table=fill_from(LimitsUsed, check.table),
        verdicts=[fill_from(ClassJudged, verdict) for verdict in check.verdicts],
        best=_best_classes(check),
        differences=[
            {"point": name}
            | {f"d{axis}_m": value for axis, value in zip(check.axes, row, strict=True)}
            for name, row in zip(check.names, check.difference_m, strict=True)
        ],
    )


def plain_product(check):
    """Return the `ProductFile` of a ProductCheck, as plain data."""
    return to_plain(product_of(check))


def _best_classes(check):
    scales = dict.fromkeys((verdict.part, verdict.scale) for verdict in check.verdicts)
    return [
        BestClass(part, scale, check.best(part, scale), check.best(part, scale, unbiased=True))
        for part, scale in scales
    ]
