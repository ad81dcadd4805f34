"""A product check as plain lists and dicts, ready for JSON.

format         "tankcal-camera/2"            kind  "product"
alpha          level of the tests of bias (two-sided) and of precision (upper)
n              number of points
axes           [{axis: "x" | "y" | "z", part: "plan" | "height", n,
                 mean_m, sd_m, t, t_limit, biased (true, false or null: cannot be said),
                 rmse_m, rmse_unbiased_m (less the mean, where it is significant),
                 largest_m, largest_point,
                 precision: null or PRECISION (against an expected sd)}]
               null: too few points; t is null, too, where nothing scatters
parts          [{part, n, rmse_m, rmse_unbiased_m, largest_m}], plan: x and y together
notes          [{code, n}]: "few_points" (fewer than `advised`), "no_tests" (fewer than 2),
               "share_means_all" (fewer than 10: 90 % of them are all of them),
               "axis_without_points" (n: number of the axis), "no_plan", "no_height" (the table
               has limits of a part that cannot be judged)
advised        points that a test of accuracy should have
table          null or {name, source, verified, remark, share, code (of a shipped table, else null)}
verdicts       [{part, scale (text, such as "1000"), grade, tolerance_m, sd_m, n,
                 as_is: REACHED, unbiased: REACHED (less the significant means),
                 precision: [PRECISION of each axis], precise (true, false, null)}]
best           [{part, scale, grade, grade_unbiased}], null: no class is reached; a class is
               reached when `share` of the points lie within tolerance_m and rmse_m within sd_m
differences    [{point, dx_m, dy_m, dz_m}] product minus truth; null: not known; only the axes
               that there are

PRECISION      {axis, sigma_m, chi2, limit, passed}; null: fewer than two points
REACHED        {within (points), share (0 to 1), rmse_m, reached,
                why: [] or some of "too_few_points" (under 3), "share_too_small",
                "rmse_too_large"}
"""

from dataclasses import asdict

from tankcal.calibration.product.check import ADVISED
from tankcal.record.camera_versions import FORMAT
from tankcal.record.plain_data import plain


def as_json(check):
    """The dict of a ProductCheck, as the head of this module describes it."""
    return {
        "format": FORMAT,
        "kind": "product",
        "alpha": check.alpha,
        "n": len(check.names),
        "axes": [asdict(one) for one in check.checks],
        "parts": [
            {
                "part": one.part,
                "n": one.n,
                "rmse_m": one.rmse_m,
                "rmse_unbiased_m": one.rmse_unbiased_m,
                "largest_m": float(one.size_m.max()),
            }
            for one in check.parts
        ],
        "notes": [{"code": code, "n": n} for code, n in check.notes],
        "advised": ADVISED,
        "table": _table(check.table),
        "verdicts": [_verdict(one) for one in check.verdicts],
        "best": _best(check),
        "differences": [
            {
                "point": name,
                **{f"d{axis}_m": plain(value) for axis, value in zip(check.axes, row, strict=True)},
            }
            for name, row in zip(check.names, check.difference_m, strict=True)
        ],
    }


def _table(table):
    if table is None:
        return None
    return {key: value for key, value in vars(table).items() if key != "limits"}


def _verdict(one):
    row = {**asdict(one), "precise": one.precise}
    for key in ("as_is", "unbiased"):
        row[key]["why"] = list(row[key]["why"])
    row["precision"] = list(row["precision"])
    return row


def _best(check):
    scales = dict.fromkeys((one.part, one.scale) for one in check.verdicts)
    return [
        {
            "part": part,
            "scale": scale,
            "grade": check.best(part, scale),
            "grade_unbiased": check.best(part, scale, unbiased=True),
        }
        for part, scale in scales
    ]
