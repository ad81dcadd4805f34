"""The rows of the capacity table: its step, its fine zones, and how many rows they make."""

from itertools import pairwise

from tankcal.job.checks.common import is_not_given, missing_beside, tell
from tankcal.messages import message

MAX_TABLE_ROWS = 25_000  # a 20 m tank in millimetres; its certificate has 90 pages
COARSE_STEP_M = 0.5
INCH_STEPS_M = {"ft-in-8": 0.0254 / 8, "ft-in-16": 0.0254 / 16}


def check_steps(table, extent, raw, log):
    """Is the step given where it must be, credible, and finer in the fine zones?

    table   the values of the section; extent  as known, `height_m` may be None
    """
    step = INCH_STEPS_M.get(table["height_unit"], table["step_m"])
    _check_presence(table, raw, log)
    if step is not None:
        _check_step(step, table, extent.height_m, raw, log)
    _check_zones(table["fine_zones"] or (), extent, raw, log)
    fine, zones = table["fine_step_m"], table["fine_zones"] or ()
    ratio = 0.0 if None in (fine, step) else step / fine
    if ratio and (ratio < 1.5 or abs(ratio - round(ratio)) > 1e-6):
        expected = message(
            "fine_step_no_part",
            "found {fine:g}; expected a whole part of the step of the table, {step:g} m",
            fine=fine,
            step=step,
        )
        tell(log.problem, raw, "table", "fine_step_m", expected)
    elif fine is not None and sum(high - low for low, high in zones) / fine > MAX_TABLE_ROWS:
        expected = message(
            "fine_rows_too_many",
            "found {fine:g}; expected at most {most} rows in the fine zones",
            fine=fine,
            most=MAX_TABLE_ROWS,
        )
        tell(log.problem, raw, "table", "fine_step_m", expected)


def _check_presence(table, raw, log):
    def tell_problem(key, expected):
        tell(log.problem, raw, "table", key, expected)

    inches, step = table["height_unit"] in INCH_STEPS_M, table["step_m"]
    if inches and step is not None:
        tell_problem(
            "step_m",
            message(
                "step_beside_inches",
                "found {step:g}; expected a blank: {unit} is a step",
                step=step,
                unit=table["height_unit"],
            ),
        )
    bound = is_not_given(raw, "table", "max_interpolation_error_l")
    if not inches and bound and is_not_given(raw, "table", "step_m"):
        expected = message(
            "step_missing",
            "missing; expected the step of the capacity table, or max_interpolation_error_l, or "
            "height_unit = ft-in-8 or ft-in-16",
        )
        tell_problem("step_m", expected)
    for given, lacking in (("fine_step_m", "fine_zones"), ("fine_zones", "fine_step_m")):
        if table[given] is not None and is_not_given(raw, "table", lacking):
            tell_problem(lacking, missing_beside(given))
    if table["fine_step_m"] is not None and (inches or is_not_given(raw, "table", "step_m")):
        expected = message(
            "fine_step_without_step",
            "found beside no step_m; expected fine zones only in a table with step_m",
        )
        tell_problem("fine_step_m", expected)


def _check_step(step, table, height, raw, log):
    key = "step_m" if table["step_m"] is not None else "height_unit"
    if height is None:
        return
    if step >= height:
        expected = message(
            "step_above_height",
            "found {step:g}; expected less than the height, {height:g} m: in millimetres?",
            step=step,
            height=height,
        )
        tell(log.problem, raw, "table", key, expected)
    elif height / step > MAX_TABLE_ROWS:
        expected = message(
            "table_too_long",
            "{rows:.0f} rows in the table, expected at most {most}",
            rows=height / step,
            most=MAX_TABLE_ROWS,
        )
        tell(log.problem, raw, "table", key, expected)
    elif step > COARSE_STEP_M:
        expected = message(
            "coarse_step",
            "{step_m:g} m is a coarse step for a table: is it in another unit?",
            step_m=step,
        )
        tell(log.warning, raw, "table", key, expected)


def _check_zones(zones, extent, raw, log):
    def tell_problem(expected):
        tell(log.problem, raw, "table", "fine_zones", expected)

    top = extent.top_m if extent.top_m is not None else extent.height_m
    for low, high in zones:
        if low >= high:
            expected = message(
                "zone_upside_down",
                "found {low:g}-{high:g}; expected the lower dip first",
                low=low,
                high=high,
            )
            tell_problem(expected)
        elif top is not None and high > top + 1e-9:
            expected = message(
                "zone_above_top",
                "found {low:g}-{high:g}; expected dips up to {top:g} m: in another unit?",
                low=low,
                high=high,
                top=top,
            )
            tell_problem(expected)
    for (low, high), (next_low, next_high) in pairwise(sorted(zones)):
        if next_low < high:
            expected = message(
                "zones_overlap",
                "{low:g}-{high:g} and {next_low:g}-{next_high:g} overlap; expected apart",
                low=low,
                high=high,
                next_low=next_low,
                next_high=next_high,
            )
            tell_problem(expected)
