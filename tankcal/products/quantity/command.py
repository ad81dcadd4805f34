"""`tankcal ticket`: quantities of a transfer or of a stock, with their uncertainty."""

from math import isfinite
from pathlib import Path

from tankcal.errors import problem_of
from tankcal.messages import message, printable
from tankcal.terminal.arguments import add_language
from tankcal.terminal.showing import (
    add_json,
    marks,
    prepare_for_small_work,
    print_json,
    say,
    speak_of_record,
    warn,
)
from tankcal.text.digits import fixed, format_with_u

SHOWN = 8  # inputs of the budget in the terminal
SHOWN_TICKETS = 20  # of a CSV file


def add(commands):
    """Add the parser of `tankcal ticket`."""
    ticket = commands.add_parser(
        "ticket",
        help="compute the quantity of a transfer or of a stock, with its uncertainty",
        description="From the dips, temperatures and density of a ticket and the table of a record "
        "to gross and net standard volume, mass and weight in air, each with U. Opening and "
        "closing share the table, the density and the volume correction. See docs/ticket.md.",
        epilog="exit status: 0 done; 2 the record or the ticket must be corrected (one line per "
        "problem: file, row, column, expected value).",
    )
    ticket.add_argument("record", metavar="RECORD", help="a record.json, or a folder of results")
    ticket.add_argument("ticket", metavar="TICKET.toml", help="product, gaugings and uncertainties")
    ticket.add_argument(
        "--tickets",
        metavar="FILE.csv",
        help="many tickets, one in each row; its columns replace keys of TICKET.toml",
    )
    ticket.add_argument(
        "--out", metavar="FILE.csv", help="write all steps and quantities to this file"
    )
    add_language(ticket)
    add_json(ticket)
    ticket.set_defaults(command=_ticket)


def _ticket(options):
    prepare_for_small_work()
    speak_of_record(options.language, options.record)
    from tankcal.products.quantity.reading import read_tickets
    from tankcal.products.quantity.results import check_output, rows_of, write_rows
    from tankcal.products.quantity.table import read_table
    from tankcal.report.outputs import record_file

    if options.out is not None:  # before the calculation, which may take a while
        check_output(Path(options.out))
    table = read_table(record_file(options.record))
    tickets = read_tickets(table, options.ticket, options.tickets)
    quantities, steps = tickets.transfer.quantities(), tickets.transfer.steps
    rows = rows_of(tickets, quantities, steps)
    if options.out is not None:
        write_rows(Path(options.out), rows)
    if options.machine:
        print_json(exit_status=0, tank=table.tank, record=table.digest,
                   correction=tickets.transfer.product.correction.name, tickets=rows,
                   warnings=[problem_of(warning) for warning in tickets.warnings])  # fmt: skip
        return 0
    warn(tickets.warnings)
    if len(rows) == 1:
        for line in _lines(tickets, quantities, steps):
            say(line)
    else:
        say(message("ticket_count", "{count} tickets computed", count=len(rows)))
        for line in _ticket_lines(tickets, quantities):
            say(line)
    if options.out is not None:
        print(f"  {printable(options.out)}")
    return 0


def _lines(tickets, quantities, steps):
    """Yield the lines of a single ticket: steps, quantities, budget, comparison."""
    transfer = tickets.transfer
    product = tickets.sections["product"]["name"]
    yield message(
        "ticket_head",
        "ticket {number}, tank {tank}{product}, volume correction {correction}",
        number=tickets.names[0],
        tank=transfer.table.tank,
        product="" if product is None else f", {product}",
        correction=transfer.product.correction.name,
    )
    for state, result in steps.items():
        yield _step_line(state, result)
    for state, result in quantities.items():
        yield from _quantity_lines(state, result)
    yield from _budget_lines(quantities)
    yield from _comparison_lines(tickets, quantities)


_STATES = {
    "opening": message("ticket_opening", "opening"),
    "closing": message("ticket_closing", "closing"),
    "moved": message("ticket_moved", "closing less opening"),
}
_QUANTITIES = {
    "tov_m3": (message("ticket_tov", "total observed volume"), "m3"),
    "gov_m3": (message("ticket_gov", "gross observed volume"), "m3"),
    "gsv_m3": (message("ticket_gsv", "gross standard volume"), "m3"),
    "nsv_m3": (message("ticket_nsv", "net standard volume"), "m3"),
    "mass_kg": (message("ticket_mass", "mass"), "kg"),
    "weight_kg": (message("ticket_weight", "weight in air"), "kg"),
}


def _step_line(state, steps):
    return message(
        "ticket_steps",
        "{state}: free water {water} m3, shell at {shell} degC, CTSh {ctsh}, density {base} kg/m3 "
        "at the base and {observed} in the tank, VCF {vcf}, roof {roof} m3, CSW {csw}",
        state=_STATES[state],
        water=fixed(steps.fw_m3[0], 3, marks()),
        shell=fixed(steps.shell_c[0], 2, marks()),
        ctsh=fixed(steps.ctsh[0], 6, marks()),
        base=fixed(steps.base_density[0], 2, marks()),
        observed=fixed(steps.observed_density[0], 2, marks()),
        vcf=fixed(steps.vcf[0], 6, marks()),
        roof=fixed(steps.fra_m3[0], 3, marks()),
        csw=fixed(steps.csw[0], 5, marks()),
    )


def _quantity_lines(state, result):
    from tankcal.products.quantity.chain import QUANTITIES

    for place, name in enumerate(QUANTITIES):
        text, unit = _QUANTITIES[name]
        written = format_with_u(result.value[0, place], result.U[0, place], marks())
        yield message(
            "ticket_quantity",
            "{state}, {quantity}: {value} {unit}, U = {U} {unit} (k = {k})",
            state=_STATES[state],
            quantity=text,
            value=written.value,
            unit=unit,
            U=written.uncertainty,
            k=fixed(result.k[0, place], 2, marks()),
        )


def _net_volume(quantities):
    """(state, its `Quantities`, column of the net standard volume) of the transfer or the stock."""
    from tankcal.products.quantity.chain import QUANTITIES

    state = "moved" if "moved" in quantities else "closing"
    return state, quantities[state], QUANTITIES.index("nsv_m3")


def _ticket_lines(tickets, quantities):
    """Yield the net standard volume of each of the first tickets."""
    state, result, place = _net_volume(quantities)
    for row, name in enumerate(tickets.names[:SHOWN_TICKETS]):
        written = format_with_u(result.value[row, place], result.U[row, place], marks())
        yield message(
            "ticket_line",
            "  {name}: {state}, {quantity} {value} m3, U = {U} m3",
            name=name,
            state=_STATES[state],
            quantity=_QUANTITIES["nsv_m3"][0],
            value=written.value,
            U=written.uncertainty,
        )
    if len(tickets.names) > SHOWN_TICKETS:
        yield message("ticket_more", "  ... and {count} more; --out FILE.csv writes all of them",
                      count=len(tickets.names) - SHOWN_TICKETS)  # fmt: skip


def _budget_lines(quantities):
    """Yield the largest contributions to u of the net standard volume."""
    _, result, place = _net_volume(quantities)
    if not result.u[0, place] > 0:
        return
    parts = sorted(
        ((abs(part[0, place]), name) for name, part in result.contributions.items()), reverse=True
    )
    yield message("ticket_budget", "largest contributions to u of the net standard volume:")
    for contribution, name in parts[:SHOWN]:
        yield message(
            "ticket_contribution",
            "  {name}: {value} m3, {share} % of the variance",
            name=_INPUTS[name],
            value=fixed(contribution, 3, marks()),
            share=fixed(100 * contribution**2 / result.u[0, place] ** 2, 1, marks()),
        )


_INPUTS = {
    "table": message("ticket_input_table", "capacity table"),
    "tape": message("ticket_input_tape", "tape"),
    "thermometer": message("ticket_input_thermometer", "thermometer"),
    "ambient": message("ticket_input_ambient", "temperature of the air"),
    "density": message("ticket_input_density", "density"),
    "sw": message("ticket_input_sw", "sediment and water"),
    "expansion": message("ticket_input_expansion", "expansion of the shell"),
    "vcf": message("ticket_input_vcf", "volume correction"),
    "dip opening": message("ticket_input_dip_opening", "opening dip"),
    "dip closing": message("ticket_input_dip_closing", "closing dip"),
    "water dip opening": message("ticket_input_water_opening", "opening water dip"),
    "water dip closing": message("ticket_input_water_closing", "closing water dip"),
    "temperature opening": message("ticket_input_temperature_opening", "opening temperature"),
    "temperature closing": message("ticket_input_temperature_closing", "closing temperature"),
    "interpolation opening": message("ticket_input_rows_opening", "opening dip between two rows"),
    "interpolation closing": message("ticket_input_rows_closing", "closing dip between two rows"),
}


def _comparison_lines(tickets, quantities):
    """Yield the difference from the quantity of the other party, and E_n."""
    from tankcal.products.quantity.results import compare

    comparison = compare(tickets, quantities)
    if comparison is None or not isfinite(comparison.difference[0]):
        return
    name, unit = _QUANTITIES[comparison.quantity]
    difference = fixed(comparison.difference[0], 2, marks())
    source = comparison.source or message("ticket_other_party", "the other party")
    if comparison.e_n is None or not isfinite(comparison.e_n[0]):
        yield message("ticket_difference", "{quantity} less that of {source}: {difference} {unit}",
                      quantity=name, source=source, difference=difference,
                      unit=unit)  # fmt: skip
        return
    yield message(
        "ticket_e_n",
        "{quantity} less that of {source}: {difference} {unit}, E_n = {e_n} (agreement: at most 1)",
        quantity=name, source=source, difference=difference, unit=unit,
        e_n=fixed(comparison.e_n[0], 2, marks()),
    )  # fmt: skip
