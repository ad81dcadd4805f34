"""Input cells of the calculator, with their limits and messages."""

from dataclasses import dataclass

from tankcal.report.workbook.calculator import products
from tankcal.report.workbook.calculator.service import SHELL_C
from tankcal.report.workbook.look import ACCENT, INPUT, number_format
from tankcal.text.digits import fixed, shortest
from tankcal.text.words import marks_of


@dataclass(frozen=True)
class Input:
    """Input cell of the form.

    Attributes
    ----------
    key : str
        Key of the cell and of its label.
    value : float or None
        Initial value; None: blank.
    digits : int
        Decimals.
    unit : str
        Printed unit.
    low, high : float or None
        Limits of a number; None: a choice from the list of products.
    check : str
        Key of the line with the sentence beside the cell.
    name : str
        Name of the cell, which does not depend on the language.
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
    """Return the inputs from the top: dip and product, a volume, a delivery (list of Input)."""
    heights, volumes = table.height_m, table.volume_m3
    ends = heights[0], max(heights[-1], round(heights[-1], table.digits))
    base = table.job["table"]["reference_temperature_c"]
    liquid_c = products.LEAST_C, products.MOST_C
    densities = products.LEAST_KG_M3, products.MOST_KG_M3
    factors = products.LEAST_FACTOR, products.MOST_FACTOR
    most_m3 = max(max(volumes), round(max(volumes), 3))

    def dip(key, row, name):
        return Input(key, heights[row], table.digits, "m", *ends, f"{key}_state", name)

    inputs = [
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
        inputs += [
            dip("low_dip", table.low, "delivery_low_dip"),
            dip("high_dip", table.at, "delivery_high_dip"),
        ]
    return inputs


def write_input(book, sheet, row, entry):
    """Write an input into column B, with label, unit, name and validation.

    Parameters
    ----------
    book : Book
        Workbook.
    sheet : Sheet
        Sheet of the form.
    row : int
        Row of the cell, from 0.
    entry : Input
        Input to write.
    """
    look = {"bg_color": INPUT, "border": 1, "border_color": ACCENT, "locked": False, "bold": True}
    look |= {"align": "right" if entry.low is not None else "left", "font_size": 11}
    sheet.set_row(row, 18)
    book.put(sheet, row, 0, book.word(f"inputs.{entry.key}", of="calculator"), bold=True)
    if entry.value is None:
        shown = {} if entry.low is None else {"num_format": number_format(entry.digits)}
        sheet.write_blank(row, 1, None, book.format(**look, **shown))
    else:
        book.put(sheet, row, 1, entry.value, num_format=number_format(entry.digits), **look)
    book.put(sheet, row, 2, entry.unit, indent=1)
    book.name(entry.name, sheet, row, row, 1)
    rule = (
        {
            "validate": "list",
            "source": "=product_groups",
            "input_title": book.word("short.product", of="calculator"),
            "input_message": book.word("prompts.product", of="calculator"),
            "error_title": book.word("texts.error_title", of="calculator"),
            "error_message": book.word("errors.product", of="calculator"),
        }
        if entry.low is None
        else _numbers(book, entry)
    )
    sheet.data_validation(row, 1, row, 1, {**rule, "ignore_blank": True})


def _numbers(book, entry):
    marks = marks_of(book.words)
    low, high = _ends(entry, marks)
    values = {"low": low, "high": high, "unit": entry.unit}
    return {
        "validate": "decimal",
        "criteria": "between",
        "minimum": entry.low,
        "maximum": entry.high,
        "input_title": book.word(f"short.{entry.key}", of="calculator"),
        "input_message": book.word(f"prompts.{entry.key}", of="calculator", **values),
        "error_title": book.word("texts.error_title", of="calculator"),
        "error_message": book.word(f"errors.{_kind(entry)}", of="calculator", **values),
    }


def _kind(entry):
    """Return the key of the error message of an input."""
    if entry.check.endswith("dip_state"):
        return "dip"
    return "wanted" if entry.key == "wanted" else "number"


def _ends(entry, marks):
    """Return the smallest and largest value as texts."""
    if entry.unit in ("m", "m³"):
        return fixed(entry.low, entry.digits, marks), fixed(entry.high, entry.digits, marks)
    return shortest(entry.low, marks), shortest(entry.high, marks)
