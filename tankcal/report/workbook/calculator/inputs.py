"""The cells that are typed into: what each takes, and what it says."""

from dataclasses import dataclass

from tankcal.report.workbook.calculator import products
from tankcal.report.workbook.calculator.service import SHELL_C
from tankcal.report.workbook.look import ACCENT, INPUT, number_format
from tankcal.text.digits import fixed, shortest
from tankcal.text.words import marks_of


@dataclass(frozen=True)
class Input:
    """One open cell: its key, what it opens with (None: blank), digits, unit, and what it takes.

    low, high  of a number; None for a choice from the list of products
    check      key of the line whose sentence stands beside it
    name       of its cell, the same in every language
    """

    key: str
    value: float | None
    digits: int
    unit: str
    low: float | None
    high: float | None
    check: str
    name: str


def inputs_of(table):
    """The inputs from the top down, in groups: the tank now, a volume, a delivery."""
    heights, volumes = table.height_m, table.volume_m3
    ends = heights[0], max(heights[-1], round(heights[-1], table.digits))
    base = table.job["table"]["reference_temperature_c"]
    liquid_c = products.LEAST_C, products.MOST_C
    densities = products.LEAST_KG_M3, products.MOST_KG_M3
    factors = products.LEAST_FACTOR, products.MOST_FACTOR
    most_m3 = max(max(volumes), round(max(volumes), 3))

    def dip(key, row, name):
        return Input(key, heights[row], table.digits, "m", *ends, f"{key}_state", name)

    found = [
        dip("dip", table.at, "dip_m"),
        Input("shell", base, 1, "°C", *SHELL_C, "shell_state", "shell_temperature"),
        Input("product", None, 0, "", None, None, "product_state", "product_chosen"),
        Input("density", None, 1, "kg/m³", *densities, "density_state", "density_at_base"),
        Input("liquid", base, 1, "°C", *liquid_c, "liquid_state", "liquid_temperature"),
        Input("factor", None, 5, "", *factors, "factor_state", "own_factor"),
        Input(
            "wanted",
            volumes[table.at],
            3,
            "m³",
            min(volumes),
            most_m3,
            "wanted_state",
            "wanted_volume",
        ),
    ]
    if table.capacity["inputs"]:
        found += [
            dip("low_dip", table.low, "delivery_low_dip"),
            dip("high_dip", table.at, "delivery_high_dip"),
        ]
    return found


def write_input(book, sheet, row, one):
    """The cell of an input in column B, with its label, unit, name and validation."""
    look = {"bg_color": INPUT, "border": 1, "border_color": ACCENT, "locked": False, "bold": True}
    look |= {"align": "right" if one.low is not None else "left", "font_size": 11}
    sheet.set_row(row, 18)
    book.put(sheet, row, 0, book.word(f"inputs.{one.key}", of="calculator"), bold=True)
    if one.value is None:
        shown = {} if one.low is None else {"num_format": number_format(one.digits)}
        sheet.write_blank(row, 1, None, book.format(**look, **shown))
    else:
        book.put(sheet, row, 1, one.value, num_format=number_format(one.digits), **look)
    book.put(sheet, row, 2, one.unit, indent=1)
    book.name(one.name, sheet, row, row, 1)
    rule = _list(book) if one.low is None else _numbers(book, one)
    sheet.data_validation(row, 1, row, 1, {**rule, "ignore_blank": True})


def _numbers(book, one):
    marks = marks_of(book.words)
    low, high = _ends(one, marks)
    said = {"low": low, "high": high, "unit": one.unit}
    return {
        "validate": "decimal",
        "criteria": "between",
        "minimum": one.low,
        "maximum": one.high,
        "input_title": book.word(f"short.{one.key}", of="calculator"),
        "input_message": book.word(f"prompts.{one.key}", of="calculator", **said),
        "error_title": book.word("texts.error_title", of="calculator"),
        "error_message": book.word(f"errors.{_kind(one)}", of="calculator", **said),
    }


def _kind(one):
    """Which message of refusal belongs to an input."""
    if one.check.endswith("dip_state"):
        return "dip"
    return "wanted" if one.key == "wanted" else "number"


def _ends(one, marks):
    """The least and the largest value, as they are said."""
    if one.unit in ("m", "m³"):
        return fixed(one.low, one.digits, marks), fixed(one.high, one.digits, marks)
    return shortest(one.low, marks), shortest(one.high, marks)


def _list(book):
    return {
        "validate": "list",
        "source": "=product_groups",
        "input_title": book.word("short.product", of="calculator"),
        "input_message": book.word("prompts.product", of="calculator"),
        "error_title": book.word("texts.error_title", of="calculator"),
        "error_message": book.word("errors.product", of="calculator"),
    }
