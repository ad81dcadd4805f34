"""Reading of tickets: ticket.toml for one ticket, a CSV file beside it for many."""

from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace
from functools import cached_property
from pathlib import Path

import numpy as np

from tankcal.job.checking import missing_beside, refuse_repeated
from tankcal.job.contract.keys import CSV
from tankcal.job.entries import ColumnValues, read_columns
from tankcal.job.fields import Field, choice, number, positive
from tankcal.job.folder import read_csv
from tankcal.job.tables import Log, read_bytes
from tankcal.messages import message
from tankcal.products.quantity.chain import (
    QUANTITIES,
    STATES,
    Gauging,
    Product,
    Transfer,
    follow_chain,
)
from tankcal.products.quantity.factor_table import read_factor_table
from tankcal.products.quantity.results import find_slips
from tankcal.products.settings import fill_blanks, read_sections
from tankcal.record.manifest import digest_of
from tankcal.tank.gauging import LIMITS, UNCERTAINTIES
from tankcal.tank.volume_correction.corrections import CORRECTIONS, TABLE, Ethanol, FactorTable
from tankcal.tank.volume_correction.petroleum import (
    BASES_C,
    DEGREES,
    GROUPS,
    OutsideRangeError,
    glass_correction,
)
from tankcal.text.display import volume_text

MOST_TICKETS = 100_000
COLUMNS = ("value", "u", "dof", "k", "U")  # of `Tickets.frame`
GLASS = {"glass 15C": "15C", "glass 20C": "20C", "glass 60F": "60F"}
COMPARED = ("gov_m3", "gsv_m3", "nsv_m3", "mass_kg", "weight_kg")
COEFFICIENT = "coefficient"

# Notes on the keys are in [ticket.notes] of the words of each language.
TICKET = (
    Field("number", "text", ""),
    Field("date", "date", ""),
    Field("by", "text", ""),
    Field("customer", "text", ""),
    Field("note", "text", ""),
    number("coverage_probability", "", 0.5, 0.9999),
)
PRODUCT = (
    Field("name", "text", ""),
    choice(
        "correction", message("ticket_note_correction", "standard of the volume correction"),
        (*CORRECTIONS,), required=True,
    ),
    choice("group", "", (*GROUPS, COEFFICIENT)),
    choice("base", "", (*BASES_C,)),
    positive("alpha_per_k", "", 0.01),
    Field("factor_table", "text", ""),
    positive("density_kg_m3", "", LIMITS["density_kg_m3"][1]),
    choice(
        "density_is",
        message(
            "ticket_note_density_is",
            "base: at the base temperature; observed: at density_temperature_c",
        ),
        ("base", "observed"), required=True,
    ),
    number("density_temperature_c", "", *LIMITS["density_temperature_c"]),
    choice("hydrometer", "", (*GLASS,)),
    number("sw_percent", "", *LIMITS["sw_percent"]),
    positive("air_kg_m3", "", 2),
    number("weights_kg_m3", "", 1000, 20_000),
)  # fmt: skip
SHELL = (
    Field("insulated", "flag", ""),
    positive("expansion_per_k", "", 1e-3),
)
GAUGING = (
    number("dip_m", "", *LIMITS["dip_m"]),
    number("ullage_m", "", *LIMITS["ullage_m"]),
    number("water_dip_m", "", *LIMITS["water_dip_m"]),
    number("temperature_c", "", *LIMITS["temperature_c"]),
    number("ambient_c", "", *LIMITS["ambient_c"]),
    number("pressure_kpa", "", 0, 20_000),
    number("reference_height_m", "", 0, 200),
)
COMPARISON = (
    choice("quantity", "", COMPARED),
    positive("value", "", 1e9),
    number("U", "", 0, 1e9),
    Field("source", "text", ""),
)
_HIGH = {"u_tape_ppm": 10_000, "u_sw_percent": 10, "u_vcf_percent": 10, "u_expansion_per_k": 1e-4}
UNCERTAINTY = tuple(number(name, "", 0, _HIGH.get(name, 100)) for name in UNCERTAINTIES)
SECTIONS = {
    "ticket": TICKET,
    "product": PRODUCT,
    "shell": SHELL,
    **dict.fromkeys(STATES, GAUGING),
    "compared": COMPARISON,
    "uncertainty": UNCERTAINTY,
    "csv": CSV,
}
# Columns of a CSV file replace the keys of the TOML file for each ticket.
_PRODUCT_KEYS = tuple(field.name for field in PRODUCT)
_OF_PRODUCT = ("density_kg_m3", "density_temperature_c", "sw_percent")
ROWS = (
    Field("ticket", "name", message("ticket_note_ticket", "number of the ticket"), required=True),
    Field("date", "date", ""),
    *(
        Field(f"{state}_{field.name}", field.kind, "", low=field.low, high=field.high)
        for state in STATES
        for field in GAUGING
    ),
    *(field for field in PRODUCT if field.name in _OF_PRODUCT),
    positive("compared_value", "", 1e9),
)
_KEY_OF_COLUMN = {
    "ticket": ("ticket", "number"),
    "date": ("ticket", "date"),
    "compared_value": ("compared", "value"),
    **{name: ("product", name) for name in _OF_PRODUCT},
    **{f"{state}_{field.name}": (state, field.name) for state in STATES for field in GAUGING},
}
_COLUMN_OF_KEY = {".".join(place): column for column, place in _KEY_OF_COLUMN.items()}

_READINGS = [field for field in fields(Gauging) if field.name != "table_error_m3"]

SETTINGS_NAME = message("ticket_settings", "settings of the ticket")  # in place of a file

# Slips of the hand: limits of a plausible input.
HOTTEST_C = 60.0  # a hotter light product is probably in degrees Fahrenheit
COLDEST_HEAVY = 900.0  # kg/m3; heavier products are heated
LEAST_SW_PERCENT = 0.005  # a smaller value is probably a fraction
HOTTEST_AIR_C = 50.0  # a hotter air is probably in degrees Fahrenheit
MOST_REFERENCE_SHIFT_M = 0.003  # repeatability of manual gauging, from memory


@dataclass(frozen=True)
class Tickets:
    """Checked tickets of a tank, and their quantities.

    `print` shows the net standard volume of each ticket.

    Attributes
    ----------
    names : tuple of str
        Name of each ticket.
    sections : dict
        {section: {key: value}} of the TOML file.
    transfer : Transfer
    compared : tuple or None
        (quantity, values (n,), U or None, source) of the other party.
    warnings : tuple of Problem
    files : dict
        {name of an input file: its SHA-256}.
    columns : ColumnValues or None
        Columns of the CSV file of many tickets.
    """

    names: tuple[str, ...]
    sections: dict
    transfer: Transfer
    compared: tuple | None
    warnings: tuple = ()
    files: Mapping = field(default_factory=dict)
    columns: ColumnValues | None = None

    @cached_property
    def quantities(self):
        """{state: `Quantities`}, with "moved" for closing less opening."""
        return self.transfer.quantities()

    @property
    def settings_name(self):
        """Name of the settings for messages: that of their file, if they have one."""
        return next(iter(self.files), SETTINGS_NAME)

    @property
    def result_state(self):
        """State of the main result: "moved", or "closing" for a stock."""
        return "moved" if "moved" in self.quantities else "closing"

    def __str__(self):
        result, place = self.quantities[self.result_state], QUANTITIES.index("nsv_m3")
        rows = zip(*(part[:, place] for part in (result.value, result.U, result.k)), strict=True)
        moved = ", closing less opening," if self.result_state == "moved" else ""
        return "\n".join(
            f"{name}: NSV{moved} {volume_text(*row)}"
            for name, row in zip(self.names, rows, strict=True)
        )

    def frame(self):
        """Quantities as a DataFrame: value, u, dof, k, U by ticket, state and quantity."""
        import pandas

        rows = [
            (name, state, quantity, *(getattr(result, key)[row, place] for key in COLUMNS))
            for row, name in enumerate(self.names)
            for state, result in self.quantities.items()
            for place, quantity in enumerate(QUANTITIES)
        ]
        index = ["ticket", "state", "quantity"]
        return pandas.DataFrame(rows, columns=[*index, *COLUMNS]).set_index(index)

    def budget(self, quantity="nsv_m3", state=None, ticket=0):
        """Budget of a quantity as a DataFrame; the squares of `contribution` add up to u squared.

        Parameters
        ----------
        quantity : str, optional
            One of QUANTITIES.
        state : {"opening", "closing", "moved"}, optional
            None: "moved", or "closing" for a stock.
        ticket : int, optional
            Index of the ticket.

        Returns
        -------
        pandas.DataFrame
            Columns contribution (m3 or kg) and share (of the variance), the largest first.
        """
        import pandas

        result = self.quantities[state or self.result_state]
        place = QUANTITIES.index(quantity)
        parts = {name: part[ticket, place] for name, part in result.contributions.items()}
        frame = pandas.DataFrame({"contribution": parts})
        frame["share"] = frame.contribution**2 / result.u[ticket, place] ** 2
        return frame.sort_values("share", ascending=False, kind="stable")

    def single(self, ticket):
        """A single ticket by its index: `Tickets` of the settings with the values of its row.

        The document of a ticket can so be computed again from its own inputs.
        """
        if self.columns is None:
            return self
        sections = {name: dict(content) for name, content in self.sections.items()}
        for column, (section, key) in _KEY_OF_COLUMN.items():
            value = self.columns.of(column)[ticket]
            if value is not None:
                sections[section][key] = value
        correction = self.transfer.product.correction
        factors = correction if isinstance(correction, FactorTable) else None
        single = read_tickets(self.transfer.table, sections, factors=factors)
        return replace(single, files=self.files)

    def write(self, folder, language=None):
        """Write the document of a single ticket; see `report.ticket.write_ticket`.

        Raises
        ------
        ValueError
            For several tickets; `single` selects a ticket.
        """
        if len(self.names) > 1:
            raise ValueError(f"found {len(self.names)} tickets; expected a single ticket, such as "
                             "tickets.single(0)")  # fmt: skip
        from tankcal.products.quantity.results import document_file
        from tankcal.report.ticket import write_ticket

        return write_ticket(document_file(self), folder, language)


def read_tickets(table, settings, rows=None, factors=None):
    """Read and check tickets of a tank.

    Parameters
    ----------
    table : TankTable
    settings : path or dict
        ticket.toml, or its content as {section: {key: value}}.
    rows : path, optional
        CSV file with one ticket in each row; its columns replace keys of `settings`.
    factors : FactorTable, optional
        Table of volume correction factors in place of the file `factor_table`.

    Returns
    -------
    Tickets

    Raises
    ------
    InputError
        With every problem of the files.
    """
    tickets = _read(table, settings, rows, factors)
    correction = tickets.transfer.product.correction
    factors = correction if isinstance(correction, FactorTable) else None
    slips = find_slips(tickets, lambda sections: _read(table, sections, None, factors))
    return replace(tickets, warnings=(*tickets.warnings, *slips))


def _read(table, settings, rows, factors):
    """`Tickets` without a search for slips that explain a contradiction."""
    log, paths = Log(), []
    if isinstance(settings, Mapping):
        folder, name = Path.cwd(), SETTINGS_NAME
    else:
        settings = Path(settings).absolute()  # "." has a name for messages
        paths.append(settings)
        folder, name = settings.parent, settings.name
    sections, places, marks = read_sections(settings, SECTIONS, log, name)
    if rows is not None:
        rows = Path(rows).absolute()
        paths.append(rows)
    columns = None if rows is None else _read_rows(rows, marks, name, log)
    # Without a readable file, or with an unknown key or column, values would seem to be missing.
    if not all(_is_known(problem.column) for problem in log.problems):
        log.stop_if_problems()
    source = _Source(name, sections, places, columns, log)
    product = sections["product"]
    if factors is None and product["correction"] == TABLE and product["factor_table"]:
        path = folder / product["factor_table"]
        paths.append(path)
        factors = read_factor_table(path, product["base"] or "20C", marks, log, name)
    correction = _correction(source, factors)
    single = (sections["ticket"]["number"] or "1",)
    names = single if columns is None else tuple(columns.of("ticket"))
    # A gauging with a single value is part of the ticket: its missing values are reported below.
    states = [state for state in STATES if source.has_any(state)]
    if "closing" not in states:
        source.tell("closing.dip_m", message("ticket_no_closing", "missing; expected the "
                    "gauging after the transfer, or of the stock"))  # fmt: skip
    compared = _other_quantity(source)
    gaugings, taped = {}, {}
    for state in states:
        gaugings[state], taped[state] = _gauging(source, state, table)
    product = _product(source, correction, table)
    if correction is not None and sections["product"]["density_is"] is not None:
        _refuse_outside_correction(source, gaugings, product)
        _refuse_negative(source, table, gaugings, product)
    _warn_of_slips(source, gaugings, product)
    _warn_of_high_legs(source, table, gaugings)
    log.stop_if_problems()
    given = sections["uncertainty"]
    u = fill_blanks(given, UNCERTAINTIES)
    if given["u_sw_percent"] is None:  # without a measurement, no sediment is part of the ticket
        is_measured = np.isfinite(source.numbers("product.sw_percent"))
        u["u_sw_percent"] = np.where(is_measured, u["u_sw_percent"], 0.0)
    probability = sections["ticket"]["coverage_probability"] or 0.95
    transfer = Transfer(table, gaugings, taped, product, u, probability)
    files = {path.name: digest_of(path) for path in paths}
    return Tickets(names, sections, transfer, compared, tuple(log.warnings), files, columns)


def _read_rows(path, marks, settings_file, log):
    """`ColumnValues` of a CSV file of tickets; None after a problem."""
    data = None if marks is None else read_bytes(path, log)
    raw = None if data is None else read_csv(path.name, data, *marks, log, settings_file)
    if raw is None:
        return None
    columns = read_columns(None, raw, log, ROWS)
    if columns.columns["ticket"] is not None:
        refuse_repeated(columns, "ticket", log)
    if columns.is_empty:
        log.problem(path.name, message("ticket_no_rows", "no rows; expected a ticket in each row"))
    if len(columns.rows) > MOST_TICKETS:
        expected = message("ticket_many_rows", "{count} tickets; expected at most {most}",
                           count=len(columns.rows), most=MOST_TICKETS)  # fmt: skip
        log.problem(path.name, expected)
    return columns


def _is_known(column):
    """Whether a ticket has a key or column."""
    section, _, key = (column or "").partition(".")
    is_key = any(key == field.name for field in SECTIONS.get(section, ()))
    return is_key or any(column == field.name for field in ROWS)


class _Source:
    """Values of the keys for all tickets, from the CSV file if it has the column."""

    def __init__(self, file, sections, places, columns, log):
        self.file, self.sections, self.places = file, sections, places
        self.columns, self.log = columns, log
        self.count = 1 if columns is None else len(columns.rows)

    def column(self, key):
        """Name of the column of "section.key", or None if the CSV file does not have it."""
        column = _COLUMN_OF_KEY.get(key)
        is_there = self.columns is not None and self.columns.columns.get(column) is not None
        return column if is_there else None

    def has(self, key):
        """Whether the key or its column has a value."""
        section, _, name = key.partition(".")
        return self.column(key) is not None or self.sections[section][name] is not None

    def has_any(self, state):
        """Whether a key of the state has a value, in the TOML file or in a column."""
        return any(value is not None for value in self.sections[state].values()) or any(
            self.column(key) is not None and np.isfinite(self.numbers(key)).any()
            for key in (f"{state}.{field.name}" for field in GAUGING)
        )

    def numbers(self, key, default=np.nan):
        """Values (n,) of a key; blank: the default."""
        section, _, name = key.partition(".")
        fixed = self.sections[section][name]
        values = np.full(self.count, default if fixed is None else fixed, dtype=float)
        column = self.column(key)
        if column is not None:
            cells = self.columns.numbers(column)
            values = np.where(np.isnan(cells), values, cells)
        # An invalid value is not replaced: the ticket would be checked with another value.
        return np.where(self.is_faulty(key), np.nan, values)

    def is_faulty(self, key):
        """Whether the value of each ticket has a problem already, shape (n,)."""
        if not self.log.problems:
            return np.zeros(self.count, dtype=bool)
        if self.column(key) is None:
            return np.full(self.count, self.log.has(*self._place(key)))
        return np.array([self.log.has(*self._place(key, row)) for row in range(self.count)])

    def is_without_problem(self):
        """Whether each ticket has no problem so far, in its row or in the TOML file, shape (n,)."""
        rows = {problem.row if self.columns and problem.file == self.columns.file else None
                for problem in self.log.problems}  # fmt: skip
        if None in rows:
            return np.zeros(self.count, dtype=bool)
        if self.columns is None:
            return np.ones(self.count, dtype=bool)
        return np.array([row not in rows for row in self.columns.rows])

    def _place(self, key, ticket=0):
        """(file, row, name) of the value of a ticket."""
        section, _, _ = key.partition(".")
        column = self.column(key)
        if column is None:
            return self.file, self.places.get(key, self.places.get(section)), key
        return self.columns.file, self.columns.rows[ticket], column

    def tell(self, key, expected, ticket=0, *, is_warning=False):
        """Report on a key of a ticket, in the row of the file that contains it.

        A value with a problem has no further report.
        """
        file, row, name = self._place(key, ticket)
        if self.log.has(file, row, name):
            return
        report = self.log.warning if is_warning else self.log.problem
        report(file, expected, row, name)

    def tell_each(self, key, is_wrong, expected, *, is_warning=False):
        """Report on each ticket with `is_wrong`; expected(ticket) is its message."""
        for ticket in np.flatnonzero(is_wrong):
            self.tell(key, expected(ticket), ticket, is_warning=is_warning)
            if self.column(key) is None:
                return


def _correction(source, factors):
    """Volume correction of the section [product]; None after a problem."""
    product = source.sections["product"]
    if product["correction"] is None:
        return None
    make, needed = CORRECTIONS[product["correction"]]
    keys = {key: product[key] for key in needed}
    if "group" in needed and product["group"] == COEFFICIENT:
        keys |= {"group": None, "alpha_per_k": product["alpha_per_k"]}
        needed = (*needed, "alpha_per_k")
    is_complete = True
    if product["correction"] == TABLE:
        keys["factor_table"] = factors
        if source.sections["uncertainty"]["u_vcf_percent"] is None:
            text = message("ticket_table_u", "missing; expected the standard uncertainty of the "
                           "factors of your table, in percent")  # fmt: skip
            source.tell("uncertainty.u_vcf_percent", text)
            is_complete = False
    for key in ("group", "base", "alpha_per_k", "factor_table"):
        if product[key] is not None and key not in needed:
            _refuse_without_use(source, key, product, make)
    for key in needed:
        if product[key] is None:
            source.tell(f"product.{key}", missing_beside(f"correction = {product['correction']}"))
            is_complete = False
    return make(**keys) if is_complete else None


def _refuse_without_use(source, key, product, make):
    """Refuse a key that the volume correction does not use; the base may repeat its own base."""
    if key == "base":
        base_c = make().base_c
        if abs(BASES_C[product["base"]] - base_c) < 1e-9:
            return
        text = message(
            "ticket_other_base",
            "found {base}, but the base of this volume correction is {own:.4g} {unit}; expected no "
            "base, or another correction", base=product["base"], own=base_c, unit=DEGREES,
        )  # fmt: skip
    else:
        text = message(
            "ticket_without_use",
            "not used by correction = {correction}{group}; expected no such key",
            correction=product["correction"],
            group=f", group = {product['group']}" if key == "alpha_per_k" and product["group"]
            else "",
        )  # fmt: skip
    source.tell(f"product.{key}", text)


def _gauging(source, state, table):
    """(`Gauging` of a state, lengths read on the tape)."""
    dip, ullage = source.numbers(f"{state}.dip_m"), source.numbers(f"{state}.ullage_m")
    both = np.isfinite(dip) & np.isfinite(ullage)
    text = message("ticket_dip_and_ullage", "given together with a dip; expected only one of them")
    source.tell_each(f"{state}.ullage_m", both, lambda _: text)
    neither = np.isnan(dip) & np.isnan(ullage) & ~source.is_faulty(f"{state}.ullage_m")
    text = message("ticket_no_dip", "missing; expected the dip, or the ullage")
    source.tell_each(f"{state}.dip_m", neither, lambda _: text)
    by_ullage = np.isfinite(ullage)
    if by_ullage.any() and table.reference_height_m is None:
        text = message("ticket_no_reference", "found an ullage, but the record has no reference "
                       "height; expected a dip")  # fmt: skip
        source.tell_each(f"{state}.ullage_m", by_ullage, lambda _: text)
        by_ullage[:] = False
    level = np.where(by_ullage, (table.reference_height_m or 0.0) - ullage, dip)
    _warn_of_reference(source, state, table)
    _refuse_levels(source, state, table, level, by_ullage)
    temperature = source.numbers(f"{state}.temperature_c")
    text = message("ticket_no_temperature", "missing; expected the temperature of the liquid")
    source.tell_each(f"{state}.temperature_c", np.isnan(temperature), lambda _: text)
    ambient = source.numbers(f"{state}.ambient_c")
    if not source.sections["shell"]["insulated"] and not source.is_faulty("shell.insulated").any():
        text = message("ticket_no_ambient", "missing; expected the temperature of the air, because "
                       "the shell is not insulated")  # fmt: skip
        source.tell_each(f"{state}.ambient_c", np.isnan(ambient), lambda _: text)
    water = source.numbers(f"{state}.water_dip_m")
    lowest, dead_m3 = table.height_m[0], table.volume_m3[0]
    text = message(
        "ticket_water_below",
        "below the first row of the table, {low:.4f} m, at which the volume is {volume:.3f} m3: no "
        "free water is subtracted", low=lowest, volume=dead_m3,
    )  # fmt: skip
    is_below = (water > 0) & (water < lowest) & (dead_m3 > 0)
    source.tell_each(f"{state}.water_dip_m", is_below, lambda _: text, is_warning=True)
    water = np.where((water > 0) & (water >= lowest), water, np.nan)
    gauging = Gauging(
        level, water, temperature, ambient, source.numbers(f"{state}.pressure_kpa", 0)
    )
    return gauging, np.where(by_ullage, -ullage, level)


def _warn_of_reference(source, state, table):
    """Warn if the reference height read at the gauging is not that of the table."""
    key = f"{state}.reference_height_m"
    read = source.numbers(key)
    if table.reference_height_m is None:
        text = message("ticket_no_reference_in_table", "not compared: the record has no reference "
                       "height")  # fmt: skip
        source.tell_each(key, np.isfinite(read), lambda _: text, is_warning=True)
        return

    def moved(ticket):
        return message(
            "ticket_reference_moved",
            "{read:.4f} m, and {table:.4f} m in the table: the zero of the tape, the dip plate or "
            "the reference point differs from that of the table by {shift:+.1f} mm",
            read=read[ticket], table=table.reference_height_m,
            shift=1000 * (read[ticket] - table.reference_height_m),
        )  # fmt: skip

    is_moved = np.abs(read - table.reference_height_m) > MOST_REFERENCE_SHIFT_M + 1e-9
    source.tell_each(key, is_moved, moved, is_warning=True)


def _refuse_levels(source, state, table, level, by_ullage):
    """Refuse dips outside the table, in the critical zone of a roof, and below the water."""
    low, high = table.height_m[0], table.height_m[-1]

    def outside(ticket):
        return message("ticket_outside_table", "the dip is {dip:.4f} m; expected a dip in the table"
                       ", {low:.4f} to {high:.4f} m", dip=level[ticket], low=low,
                       high=high)  # fmt: skip

    def key_of(is_ullage):
        return f"{state}.ullage_m" if is_ullage else f"{state}.dip_m"

    is_outside = np.isfinite(level) & table.is_outside(level)
    for is_ullage in (False, True):
        source.tell_each(key_of(is_ullage), is_outside & (by_ullage == is_ullage), outside)
    if table.roof is not None:
        text = message(
            "ticket_critical",
            "the floating roof does not float below {top:.4f} m; expected a dip above",
            top=table.roof.critical_top_m,
        )
        is_critical = ~is_outside & table.is_critical(level)
        for is_ullage in (False, True):
            source.tell_each(key_of(is_ullage), is_critical & (by_ullage == is_ullage),
                             lambda _: text)  # fmt: skip
    water = source.numbers(f"{state}.water_dip_m")
    source.tell_each(
        f"{state}.water_dip_m",
        water >= level,
        lambda ticket: message(
            "ticket_water_above",
            "found {water:.4f} m; expected a dip below the liquid at {dip:.4f} m",
            water=float(water[ticket]), dip=float(level[ticket]),
        ),
    )  # fmt: skip
    if table.roof is not None and table.is_roof_in_table:
        bottom = table.roof.critical_bottom_m
        text = message(
            "ticket_water_at_roof",
            "the table subtracts the roof from {bottom:.4f} m upwards; expected a dip of the free "
            "water below", bottom=bottom,
        )  # fmt: skip
        is_high = (water > bottom) & (water < level)
        source.tell_each(f"{state}.water_dip_m", is_high, lambda _: text)


def _product(source, correction, table):
    """`Product` of the tickets."""
    given = source.sections["product"]
    density = source.numbers("product.density_kg_m3")
    text = message("ticket_no_density", "missing; expected the density of the product")
    source.tell_each("product.density_kg_m3", np.isnan(density), lambda _: text)
    source.tell_each(
        "product.density_kg_m3",
        density < LIMITS["density_kg_m3"][0],
        lambda ticket: message(
            "ticket_density_unit",
            "found {density:g}; expected kg/m³: is it a relative density, or in g/cm³?",
            density=float(density[ticket]),
        ),
    )  # fmt: skip
    sample, glass = None, np.ones(source.count)
    if given["density_is"] == "observed":
        sample = source.numbers("product.density_temperature_c")
        text = message("ticket_no_sample", "missing; expected the temperature of the sample, "
                       "because the density is an observed density")  # fmt: skip
        source.tell_each("product.density_temperature_c", np.isnan(sample), lambda _: text)
        if given["hydrometer"] is not None:
            glass = glass_correction(sample, GLASS[given["hydrometer"]])
        contained = getattr(correction, "glass_scale", None)
        if contained is not None:  # the correction expects a reading of a glass hydrometer
            glass = glass / glass_correction(sample, contained)
    elif source.is_faulty("product.density_is").any():
        pass  # the kind of density is not known
    elif given["hydrometer"] is not None or source.has("product.density_temperature_c"):
        text = message("ticket_density_at_base", "given with a density at the base; expected "
                       "density_is = observed, or no temperature of a sample and no hydrometer"
                       )  # fmt: skip
        key = "hydrometer" if given["hydrometer"] is not None else "density_temperature_c"
        source.tell(f"product.{key}", text)
    expansion = source.sections["shell"]["expansion_per_k"] or table.expansion_per_k
    return Product(
        correction,
        density,
        sample,
        glass,
        source.numbers("product.sw_percent", 0.0) / 100,
        np.full(source.count, expansion),
        bool(source.sections["shell"]["insulated"]),
        given["air_kg_m3"] or 1.2,
        given["weights_kg_m3"] or 8000.0,
    )


def _warn_of_slips(source, gaugings, product):
    """Warn of inputs that are probably in another unit or of another kind."""
    text = message("ticket_hot", "more than {limit:g} degC for a light product: is it in degrees "
                   "Fahrenheit?", limit=HOTTEST_C)  # fmt: skip
    measured = {f"{state}.temperature_c": gauging.temperature_c
                for state, gauging in gaugings.items()}  # fmt: skip
    if product.sample_c is not None:
        measured["product.density_temperature_c"] = product.sample_c
    for key, celsius in measured.items():
        is_hot = (celsius > HOTTEST_C) & (product.density < COLDEST_HEAVY)
        source.tell_each(key, is_hot, lambda _: text, is_warning=True)
    air = message("ticket_hot_air", "more than {limit:g} degC in the air: is it in degrees "
                  "Fahrenheit?", limit=HOTTEST_AIR_C)  # fmt: skip
    for state, gauging in gaugings.items():
        is_hot = gauging.ambient_c > HOTTEST_AIR_C
        source.tell_each(f"{state}.ambient_c", is_hot, lambda _: air, is_warning=True)
    if len(gaugings) == 2:
        opening, closing = (gaugings[state].level_m for state in STATES)
        source.tell_each(
            "closing.dip_m",
            opening == closing,
            lambda ticket: message(
                "ticket_equal_dips", "{dip:.4f} m, as in the opening gauging: was it copied?",
                dip=float(closing[ticket]),
            ),
            is_warning=True,
        )  # fmt: skip
    share = 100 * product.water_share
    fraction = message("ticket_sw_fraction", "less than {limit:g} %: is it a fraction?",
                       limit=LEAST_SW_PERCENT)  # fmt: skip
    source.tell_each("product.sw_percent", (share > 0) & (share < LEAST_SW_PERCENT),
                     lambda _: fraction, is_warning=True)  # fmt: skip


def _warn_of_high_legs(source, table, gaugings):
    """Warn of dips at which another table applies to a floating roof on high legs."""
    if not table.high_legs_m:
        return
    low, high = table.high_legs_m
    text = message(
        "ticket_high_legs",
        "between {low:g} m and {high:g} m the table is that of the usual legs; with the roof on "
        "high legs, take the volume from the second table of the certificate",
        low=low,
        high=high,
    )
    for state, gauging in gaugings.items():
        is_between = (gauging.level_m > low) & (gauging.level_m < high)
        source.tell_each(f"{state}.dip_m", is_between, lambda _: text, is_warning=True)


def _refuse_outside_correction(source, gaugings, product):
    """Report tickets outside the range of the volume correction."""
    is_complete = np.isfinite(product.density)
    if product.sample_c is not None:
        is_complete &= np.isfinite(product.sample_c)
    rows = np.flatnonzero(is_complete)

    def density_at_base(rows):
        return _select_product(product, rows).base_density()

    def name_of(error):
        is_sample = error.quantity == "temperature_c"
        return f"product.{'density_temperature_c' if is_sample else error.quantity}"

    rows = _rows_inside(source, product, rows, density_at_base, name_of)
    if not rows.size:
        return
    base = np.full(source.count, np.nan)
    base[rows] = density_at_base(rows)
    for state, gauging in gaugings.items():
        is_complete = np.isfinite(gauging.temperature_c) & np.isfinite(gauging.pressure_kpa)

        def factor(rows, gauging=gauging):
            readings = base[rows], gauging.temperature_c[rows], gauging.pressure_kpa[rows]
            return product.correction.factor(*readings)

        def name_of(error, state=state):
            owner = "product" if error.quantity in _PRODUCT_KEYS else state
            return f"{owner}.{error.quantity}"

        _rows_inside(source, product, rows[is_complete[rows]], factor, name_of)


def _rows_inside(source, product, rows, evaluate, name_of):
    """Tickets, by their indices, that a volume correction accepts; the others are reported.

    Parameters
    ----------
    rows : ndarray of int
        Tickets with complete values.
    evaluate : callable
        evaluate(rows) raises OutsideRangeError for values outside the range.
    name_of : callable
        name_of(error) returns the key of the value.
    """
    while rows.size:
        try:
            evaluate(rows)
        except OutsideRangeError as error:
            _tell_outside(source, name_of(error), error, product, rows)
            # A correction reports a single quantity: other tickets are tried again without these.
            rows = rows[~np.broadcast_to(error.is_outside, rows.shape)]
        else:
            break
    return rows


def _select_product(product, rows):
    """`Product` of some tickets, by their indices."""
    arrays = {name: getattr(product, name)[rows]
              for name in ("density", "glass", "water_share", "expansion_per_k")}  # fmt: skip
    sample = None if product.sample_c is None else product.sample_c[rows]
    return replace(product, sample_c=sample, **arrays)


def _tell_outside(source, key, error, product, rows):
    """Report each of the tickets `rows` with a value outside the range of the correction."""
    # The range of ethanol is checked at the temperature of the sample, others at the base.
    is_derived = (
        error.quantity == "density_kg_m3"
        and product.sample_c is not None
        and not isinstance(product.correction, Ethanol)
    )

    is_outside = np.zeros(source.count, dtype=bool)
    is_outside[rows] = error.is_outside

    def expected(ticket):
        place = () if np.ndim(error.is_outside) == 0 else (np.searchsorted(rows, ticket),)
        text = error.expected_at(place)
        if is_derived and text.code != "no_density_at_base":  # the user wrote another density
            text = message("ticket_at_base", "at the base temperature: {text}", text=text)
        return text

    source.tell_each(key, is_outside, expected)


def _refuse_negative(source, table, gaugings, product):
    """Refuse dips at which water and roof leave no volume of the product."""
    rows = np.flatnonzero(source.is_without_problem())
    if not rows.size:
        return
    text = message("ticket_negative", "the volume without water is not above 0; expected a dip "
                   "further above the water and the roof")  # fmt: skip
    for state, gauging in gaugings.items():
        some = {field.name: getattr(gauging, field.name)[rows] for field in _READINGS}
        gov = follow_chain(table, replace(gauging, **some), _select_product(product, rows)).gov_m3
        is_negative = np.zeros(source.count, dtype=bool)
        is_negative[rows] = ~(gov > 0)
        source.tell_each(f"{state}.dip_m", is_negative, lambda _: text)


def _other_quantity(source):
    """(quantity, values (n,), U or None, source) of the other party, or None."""
    given = source.sections["compared"]
    column = source.column("compared.value")
    if column is None and all(given[field.name] is None for field in COMPARISON):
        return None
    if given["quantity"] is None:
        source.tell("compared.quantity", missing_beside(column or "compared.value"))
    if given["value"] is None and column is None:
        source.tell("compared.value", missing_beside("compared.quantity"))
    values = source.numbers("compared.value")
    return given["quantity"], values, given["U"], given["source"] or ""
