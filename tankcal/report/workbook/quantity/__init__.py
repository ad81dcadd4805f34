"""The sheet Quantity: from two dips to the quantity of product and its U, by formulas.

The formulas compute the steps of `tankcal ticket` (docs/ticket.md): volume corrections in closed
form or by Newton iterations, and U by analytic sensitivities. Results outside a range are refused.
"""

from dataclasses import dataclass

from tankcal.report.uncertainty.stated import read_room_levels
from tankcal.report.workbook.calculator.service import refused_word
from tankcal.report.workbook.calculator.table import Places, Table, quoted
from tankcal.report.workbook.look import ACCENT, INPUT, LINE_PT, MUTED, number_format
from tankcal.report.workbook.quantity import correction, uncertainty
from tankcal.report.workbook.quantity.correction import NONE, STATES
from tankcal.tank.gauging import FIELDS_OF_U, UNCERTAINTIES, UNITS_OF_U
from tankcal.text.digits import NOTHING, fixed, shortest
from tankcal.text.words import marks_of

__all__ = ["quantity_sheets"]


FORM, WORKINGS = "quantity", "quantity_workings"
_WIDTHS = (52, 19, 19, 19, 17, 9)  # widths of the columns, letters
_FIRST_ROW = 3
# Limits of a range, rounded to two decimals so that the shown range is never wider.
_CEILING, _FLOOR = "-INT(-100*[{key}]+1E-6)/100", "INT(100*[{key}]+1E-6)/100"
_WRONG = "#B00020"  # colour of refusals

# Sentences on the input; the first ones concern valid input.
GOOD = ("fine", "opening_blank", "water_below")
REFUSED = (
    "correction_blank", "no_choice", "group_blank", "group_unused", "base_blank", "base_other",
    "alpha_unused", "alpha_range", "density_range", "density_is_blank", "typed_base",
    "sample_blank", "sample_unused", "sw_range", "name_blank", "name_unused", "u_wrong",
    "no_base_density", "base_density_range", "sample_range", "cnp_decimals", "closing_blank",
    "dip_and_ullage", "no_dip", "no_number", "no_reference", "outside_table", "critical",
    "water_above", "water_at_roof", "liquid_blank", "ambient_blank", "product_first",
    "liquid_range", "factor_blank", "factor_unused", "negative",
)  # fmt: skip
KEYS = (*GOOD, *REFUSED)


@dataclass(frozen=True)
class Input:
    """Input cell: key, list of its choices or None, number format, unit, initial value."""

    key: str
    choices: str | None = None
    digits: int | str | None = None
    unit: str = ""
    value: float | None = None


_PRODUCT = (
    Input("correction", "corrections"),
    Input("group", "groups"),
    Input("base", "bases"),
    Input("alpha", digits="0.000E+00", unit="1/K"),
    Input("density", digits=2, unit="kg/m³"),
    Input("density_is", "density_kinds"),
    Input("sample", digits=2, unit="°C"),
    Input("hydrometer", "bases"),
    Input("sw", digits=3, unit="%"),
    Input("name"),
    Input("insulated", "yes_no"),
)
_GAUGING = (
    Input("dip", digits=4, unit="m"),
    Input("ullage", digits=4, unit="m"),
    Input("water", digits=4, unit="m"),
    Input("liquid", digits=2, unit="°C"),
    Input("ambient", digits=2, unit="°C"),
    Input("factor", digits=6),
)
_U = tuple(
    Input(key, digits="0.0E+00" if name == "u_expansion_per_k" else "0.0##",
          unit=UNITS_OF_U[name], value=UNCERTAINTIES[name])
    for name, key in FIELDS_OF_U.items()
)  # fmt: skip
# Results: key of the label, cell of each state or of both, digits, unit.
_STEPS = (
    ("tov", "tov_volume", 3, "m³"), ("fw", "fw", 3, "m³"), ("shell", "shell", 2, "°C"),
    ("ctsh", "ctsh", 6, ""), ("vcf", "vcf", 6, ""), ("rho_t", "rho_t", 2, "kg/m³"),
    ("fra", "fra", 3, "m³"), ("gov", "gov", 3, "m³"), ("gsv", "gsv", 3, "m³"),
    ("csw", "csw", 6, ""), ("nsv", "nsv", 3, "m³"), ("mass", "mass", 0, "kg"),
    ("air", "air", 6, ""), ("weight", "weight", 0, "kg"),
)  # fmt: skip


def number(key):
    """Return the number of a sentence, from 1."""
    return KEYS.index(key) + 1


def quantity_sheets(book, record):
    """Write the form, all inputs blank, and its workings."""
    table = Table(record)
    workings = [
        *correction.codes(),
        *correction.checks(number),
        *correction.density_rows(number),
        *correction.rows(record, number),
        *uncertainty.rows(table),
    ]
    rows, results = _addresses(workings)
    form = _Form(book, Places(book, rows, KEYS), results, _sentences(book, table))
    form.write(read_room_levels(record))
    _workings_sheet(book, workings, form.places, form.texts)


def _addresses(workings):
    """Return ({key: (sheet, row, column)}, {key: result for a blank form})."""
    rows, row = {}, _FIRST_ROW + 1
    for entry in _PRODUCT:
        rows[entry.key] = (FORM, row, 1)
        row += 1
    row += 3
    for entry in _GAUGING:
        for column, state in enumerate(STATES, start=1):
            rows[f"{entry.key}_{state}"] = (FORM, row, column)
        row += 1
    row += 2
    for entry in _U:
        rows[entry.key] = (FORM, row, 1)
        row += 1
    results = {}
    for row, line in enumerate(workings, start=_FIRST_ROW):
        for column, cell in enumerate(line.cells, start=1):
            rows[cell.key] = (WORKINGS, row, column)
            results[cell.key] = cell.result
    return rows, results


def _sentences(book, table):
    """Return the sentences in the order of `KEYS`."""
    marks = marks_of(book.words)
    critical = table.critical or (0.0, 0.0)
    values = {
        "first": fixed(table.height_m[0], 4, marks),
        "last": fixed(table.height_m[-1], 4, marks),
        "critical_low": fixed(critical[0], 4, marks),
        "critical_high": fixed(critical[1], 4, marks),
        "factor_low": shortest(correction.FACTORS[0], marks),
        "factor_high": shortest(correction.FACTORS[1], marks),
    }
    refused = refused_word(book)
    texts = [book.word(f"sentences.{key}", of="quantity", **values) for key in KEYS]
    return [f"{refused} {text}" if key in REFUSED else text
            for key, text in zip(KEYS, texts, strict=True)]  # fmt: skip


class _Form:
    """Writer of the sheet of the form."""

    def __init__(self, book, places, results, texts):
        self.book, self.places, self.results, self.texts = book, places, results, texts
        self.sheet = book.sheet(FORM, tab="input")
        book.widths(self.sheet, *_WIDTHS)

    def write(self, room_names):
        """Write inputs, results and notes."""
        row = self._heading(_FIRST_ROW, self._word("headings.product"))
        for entry in _PRODUCT:
            row = self._inputs(row, entry, [entry.key])
        row = self._remark(row, "product")
        row = self._heading(row + 1, self._word("headings.gauging"), ("opening", "closing"))
        for entry in _GAUGING:
            row = self._inputs(row, entry, [f"{entry.key}_{state}" for state in STATES])
        row = self._heading(row + 1, self._word("headings.uncertainty"))
        for entry in _U:
            row = self._inputs(row, entry, [entry.key])
        row = self._heading(row + 1, self._word("headings.results"),
                            ("opening", "closing", "difference", "expanded", "k"))  # fmt: skip
        for state in STATES:
            row = self._remark(row, f"state_{state}")
        for label, cells, digits in (
            ("rho_b", {"rho_b": "[{key}]"}, 3),
            ("rho_range", {"rho_low": _CEILING, "rho_high": _FLOOR}, 2),
            ("t_range", {"t_low": _CEILING, "t_high": _FLOOR}, 2),
        ):
            self._label(row, label, "°C" if label == "t_range" else "kg/m³")
            for column, (key, shown) in enumerate(cells.items(), start=1):
                self._result(row, column, key, digits, shown=shown)
            row += 1
        for label, key, digits, unit in _STEPS:
            row = self._step(row, label, key, digits, unit)
        row = self._rooms(row, room_names)
        for key in ("steps", "uncertainty", "typed", "hidden"):
            workings = self.book.sheet_name(WORKINGS)
            text = self.book.word(f"notes.{key}", of="quantity", workings=workings)
            self.book.paragraph(self.sheet, row, text, _WIDTHS, font_color=MUTED)
            row += 1
        self.sheet.fit_to_pages(1, 1)

    def _heading(self, row, text, columns=(), first=1):
        """Write a heading with the names of columns from `first`; return the next row."""
        self.book.heading(self.sheet, row, text, len(_WIDTHS))
        look = self.book.format(bold=True, align="right", font_color=ACCENT, bottom=1,
                                bottom_color=ACCENT)  # fmt: skip
        for column, name in enumerate(columns, start=first):
            self.sheet.write_string(row, column, self._word(f"columns.{name}"), look)
        return row + 1

    def _word(self, key):
        return self.book.word(key, of="quantity")

    def _label(self, row, key, unit):
        text = self._word(f"labels.{key}")
        self.book.put(self.sheet, row, 0, f"{text} ({unit})" if unit else text)

    def _inputs(self, row, entry, keys):
        """Write the label and the open cells of an input; return the next row."""
        self._label(row, entry.key, entry.unit)
        look = {"bg_color": INPUT, "border": 1, "border_color": ACCENT, "locked": False}
        shown = {} if entry.digits is None else {"num_format": number_format(entry.digits)}
        form = self.book.format(**look, align="right", **shown)
        for key in keys:
            _, _, column = self.places.place(key)
            if entry.value is None:
                self.sheet.write_blank(row, column, None, form)
            else:
                self.sheet.write_number(row, column, entry.value, form)
            self.book.name(f"quantity_{key}", self.sheet, row, row, column)
            if entry.choices:
                source = {"validate": "list", "source": f"=quantity_{entry.choices}"}
                self.sheet.data_validation(row, column, row, column, {
                    **source, "error_title": self.book.word("texts.error_title", of="calculator"),
                    "error_message": self._word("texts.choose"),
                })  # fmt: skip
        return row + 1

    def _remark(self, row, key):
        """Write the sentence on a state across the sheet; refusals are red."""
        name = {"product": "product", "state_o": "opening", "state_c": "closing"}[key]
        self.book.put(self.sheet, row, 0, self._word(f"columns.{name}"), bold=True, valign="top")
        sentence = f"[{key}]"
        if key != "product":
            state = key[-1]
            below = f"AND([{key}]=#fine,ISNUMBER([water_{state}]))"
            sentence = (
                f"IF({below},IF([water_{state}]*(1-[has_water_{state}])>0,#water_below,#fine)"
            )
            sentence += f",[{key}])"
        formula = self.places.formula(f"INDEX(quantity_sentences,{sentence})", FORM)
        look = self.book.format(font_color=ACCENT, align="left", valign="top", text_wrap=True)
        self.book.set_height(self.sheet, row, 2 * LINE_PT)
        self.sheet.merge_range(row, 1, row, len(_WIDTHS) - 1, "", look)
        text = self.texts[int(self.results[key]) - 1]
        self.sheet.write_formula(row, 1, formula, look, text)
        refused = refused_word(self.book)
        criteria = f'=LEFT($B${row + 1},{len(refused)})="{quoted(refused)}"'
        wrong = self.book.format(font_color=_WRONG, bold=True)
        rule = {"type": "formula", "criteria": criteria, "format": wrong}
        self.sheet.conditional_format(row, 1, row, 1, rule)
        return row + 1

    def _result(self, row, column, key, digits, strong=False, shown="[{key}]"):
        """Write a number of the workings, by a formula `shown`; a dash if it is no number."""
        bold = {"bold": True} if strong else {}
        look = self.book.format(align="right", num_format=number_format(digits), **bold)
        text = f"IF(ISNUMBER([{key}]),{shown.format(key=key)},{NONE})"
        formula = self.places.formula(text, FORM)
        self.sheet.write_formula(row, column, formula, look, NOTHING)

    def _step(self, row, label, key, digits, unit):
        """Write a step: both gaugings, and for a quantity the difference with U and k."""
        is_quantity = label in uncertainty.QUANTITIES
        self._label(row, label, unit)
        for column, state in enumerate(STATES, start=1):
            self._result(row, column, f"{key}_{state}", digits)
        if is_quantity:
            self._result(row, 3, f"moved_{label}", digits, strong=True)
            self._result(row, 4, f"U_{label}", digits, strong=True)
            self._result(row, 5, f"k_{label}", 2)
        return row + 1

    def _rooms(self, row, names):
        """Write the volumes to the operating levels, if the tank has any; return the next row."""
        if not names:
            return row
        words = {name: self.book.word(f"labels.ticket_{name}", of="ticket")
                 for name in ("rooms", *names)}  # fmt: skip
        row = self._heading(row, words["rooms"], ("level", "volume", "expanded", "k"), first=2)
        for name in names:
            self.book.put(self.sheet, row, 0, f"{words[name]} (m³)")
            self._result(row, 2, f"fill_level_{name}", 4)
            self._result(row, 3, f"room_{name}", 3, strong=True)
            self._result(row, 4, f"U_{name}", 3, strong=True)
            self._result(row, 5, f"k_{name}", 2)
            row += 1
        return row


def _workings_sheet(book, workings, places, texts):
    """Write the workings, the constants, the choices and the sentences."""
    sheet = book.sheet(WORKINGS, book.word("texts.workings", of="calculator"), tab="origin")
    book.widths(sheet, 26, *[18] * 11)
    look = book.format(align="right")
    for row, line in enumerate(workings, start=_FIRST_ROW):
        label = book.word(f"labels.{line.label}", of="quantity") if line.label else ""
        book.put(sheet, row, 0, f"{line.symbol} {label}".strip())
        for column, cell in enumerate(line.cells, start=1):
            formula = places.formula(cell.formula, WORKINGS)
            sheet.write_formula(row, column, formula, look, cell.result)
    row = _FIRST_ROW + len(workings) + 1
    for names, values in (
        (("low", "high", "k0", "k1", "k2"), correction.constants()),
        (("classes", "p1", "p2", "p3", "p4"), correction.classes()),
    ):
        for column, name in enumerate(names, start=1):
            book.name(f"quantity_{name}", sheet, row, row + len(values) - 1, column)
            for below, line in enumerate(values):
                sheet.write_number(row + below, column, line[column - 1], look)
        row += len(values) + 1
    for name, entries in (*_choices(book).items(), ("sentences", texts)):
        for below, text in enumerate(entries):
            book.put(sheet, row + below, 0, text)
        book.name(f"quantity_{name}", sheet, row, row + len(entries) - 1, 0)
        row += len(entries) + 1


def _choices(book):
    """Return {name of a list: its entries in the language}."""

    def words(*keys):
        return [book.word(f"choices.{key}", of="quantity") for key in keys]

    return {
        "corrections": [
            "D1250-04",
            "D1250-80",
            *words("cnp", "cnp_unrounded", "constant", "typed"),
        ],
        "groups": words(*correction.GROUPS),
        "bases": list(correction.BASES),
        "density_kinds": words("base", "observed"),
        "yes_no": [book.words["yes_no"][key] for key in ("yes", "no")],
    }
