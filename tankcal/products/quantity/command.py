"""`tankcal ticket`: quantities of a transfer or of a stock, with their uncertainty."""

from pathlib import Path

from tankcal.errors import InputError, Problem, problem_of
from tankcal.messages import message, printable
from tankcal.terminal import (
    Progress,
    add_json,
    add_language,
    language_of_run,
    marks,
    print_json,
    print_paths,
    say,
    speak_of_record,
    warn,
)
from tankcal.text.digits import format_with_u

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
        "--new",
        action="store_true",
        help="write an empty TICKET.toml with explanatory comments, and stop",
    )
    ticket.add_argument(
        "--tickets",
        metavar="FILE.csv",
        help="many tickets, one in each row; its columns replace keys of TICKET.toml",
    )
    ticket.add_argument(
        "--out",
        metavar="DIR|FILE.csv",
        help="folder for the document of a ticket (ticket.json, PDF to sign, XML, workbook, web "
        "page), all files or none; with --tickets a folder in it for each ticket, and all pages in "
        "tickets.pdf; or a .csv file for every step of the tickets",
    )
    add_language(ticket)
    ticket.add_argument("--quiet", action="store_true", help="no progress, only problems")
    add_json(ticket)
    ticket.set_defaults(command=_ticket)


def _ticket(options):
    speak_of_record(options.language, options.record)
    from tankcal.products.quantity.reading import read_tickets
    from tankcal.products.quantity.results import rows_of, write_rows
    from tankcal.products.quantity.table import read_table
    from tankcal.report.outputs import record_file

    if options.new:
        return _write_new(options, read_table(record_file(options.record)))
    is_folder = options.out is not None and Path(options.out).suffix.lower() != ".csv"
    if options.out is not None:  # before the calculation, which may take a while
        _check_output(Path(options.out), is_folder, options.tickets is None)
    table = read_table(record_file(options.record))
    tickets = read_tickets(table, options.ticket, options.tickets)
    show, written = Progress(options.quiet or options.machine), ()
    if is_folder and options.tickets is not None:
        written = _write_documents(tickets, Path(options.out), show)
    elif is_folder:
        written = _write_document(tickets, options.out, show)
    rows = rows_of(tickets)
    if options.out is not None and not is_folder:
        write_rows(Path(options.out), rows)
    if options.machine:
        print_json(exit_status=0, tank=table.tank, record=table.digest,
                   correction=tickets.transfer.product.correction.name, tickets=rows,
                   warnings=[problem_of(warning) for warning in tickets.warnings])  # fmt: skip
        return 0
    warn(tickets.warnings)
    if options.tickets is None:
        _tell(tickets)
    else:
        say(message("ticket_count", "{count} tickets computed", count=len(rows)))
        for line in _ticket_lines(tickets):
            say(line)
    if written:
        print_paths(Path(options.out), written)
    elif options.out is not None:
        print(f"  {printable(options.out)}")
    return 0


def _check_output(path, is_folder, is_single):
    """Refuse an output that must not be replaced."""
    from tankcal.products.quantity.results import check_output
    from tankcal.report.ticket import refuse_foreign

    if not is_folder:
        check_output(path)
    elif is_single:
        refuse_foreign(path)


def _write_document(tickets, folder, show):
    """Write the document of a single ticket and return the names of its files."""
    from tankcal.products.quantity.results import document_file
    from tankcal.report.ticket import write_ticket

    written = write_ticket(document_file(tickets), folder, language_of_run(), show.step)
    show.end()
    return [path.name for path in written]


def _write_documents(tickets, folder, show):
    """Write the document of each ticket of a CSV file, and a PDF of all pages.

    Returns the names of the folders and of the PDF.
    """
    from tankcal.products.quantity.results import document_file
    from tankcal.report.ticket import refuse_foreign, write_ticket
    from tankcal.report.ticket.pages import BOOKLET, refuse_foreign_booklet, write_booklet
    from tankcal.text.naming import file_name
    from tankcal.text.words import load_words

    names = [file_name(name, f"ticket_{row + 1}") for row, name in enumerate(tickets.names)]
    names = [f"{name}_" if name.casefold() == BOOKLET else name for name in names]
    _refuse_equal_folders(tickets, names)
    for name in names:
        refuse_foreign(folder / name)
    refuse_foreign_booklet(folder / BOOKLET)
    # An error in any ticket is reported before the first document.
    contents = [document_file(tickets.single(row)) for row in range(len(names))]
    writing = message("ticket_documents", "writing the documents of the tickets")
    for row, (name, content) in enumerate(zip(names, contents, strict=True)):
        show.part(writing, row, len(names))
        write_ticket(content, folder / name, language_of_run())
    folders = [folder / name for name in names]
    title = load_words(language_of_run())["ticket"]["titles"]["tickets"]
    write_booklet(list(zip(tickets.names, folders, strict=True)), folder / BOOKLET, title)
    show.end()
    return [*names, BOOKLET]


def _refuse_equal_folders(tickets, names):
    """Refuse numbers of tickets whose folders would have the same name."""
    first_rows, problems = {}, []
    for row, name in enumerate(names):
        earlier = first_rows.setdefault(name.casefold(), row)
        if earlier != row:
            expected = message(
                "ticket_equal_folders",
                "the folder {name} is also that of ticket {ticket}; expected numbers that differ "
                "in letters or digits",
                name=name, ticket=tickets.names[earlier],
            )  # fmt: skip
            columns = tickets.columns
            problems.append(Problem(columns.file, expected, columns.rows[row], "ticket"))
    if problems:
        raise InputError(problems)


def _write_new(options, table):
    """Write an empty ticket.toml for the tank of a record."""
    from tankcal.products.quantity.starter import write_starter

    path = Path(options.ticket)
    write_starter(path, table, language_of_run())
    text = message("ticket_new", "wrote {file}: fill it in, then", file=str(path))
    say(text)
    print(f"  {printable(f'tankcal ticket {options.record} {options.ticket}')}")
    return 0


def _tell(tickets):
    """Print the steps, quantities, budget and comparison of a single ticket."""
    from tankcal.products.quantity.results import ticket_file
    from tankcal.record.schema import to_plain
    from tankcal.report.ticket import TicketPaper
    from tankcal.report.ticket.pages import comparison_text, room_texts, step_text

    paper = TicketPaper(to_plain(ticket_file(tickets)), language_of_run())
    saved = paper.record
    head = paper.word("titles.ticket"), paper.subject(), paper.correction()
    print(printable(" · ".join(head)))
    states = [row["state"] for row in saved["gaugings"]]
    print("; ".join(paper.words["states"][state] for state in states))
    for row in saved["steps"]:
        print(" ", step_text(paper, row, states))
    for row in saved["quantities"]:
        say(_quantity_line(paper, row))
    for key, text in room_texts(paper):
        print(printable(f"{paper.label(key)}: {text}"))
    for line in _budget_lines(paper):
        say(line)
    if saved["comparison"] is not None:
        print(printable(comparison_text(paper)))


def _quantity_line(paper, row):
    from tankcal.report.ticket.pages import QUANTITY_UNITS, dof_text, unit_symbol

    written = format_with_u(row["value"], row["U"], marks())
    return message(
        "ticket_quantity",
        "{state}, {quantity}: {value} {unit}, U = {U} {unit} (k = {k}, dof {dof})",
        state=paper.words["states"][row["state"]],
        quantity=paper.words["quantities"][row["quantity"]],
        value=written.value,
        unit=unit_symbol(QUANTITY_UNITS[row["quantity"]]),
        U=written.uncertainty,
        k=paper.number(row["k"], decimals=2),
        dof=dof_text(paper, row["dof"]),
    )


def _budget_lines(paper):
    """Yield the largest contributions to u of the net standard volume."""
    from tankcal.report.ticket.pages import budget_rows, origin_text

    rows = budget_rows(paper)
    if rows:
        yield message("ticket_budget", "largest contributions to u of the net standard volume:")
    for row in rows[:SHOWN]:
        yield message(
            "ticket_contribution",
            "  {name}: {value} m³, {share} % of the variance ({origin})",
            name=paper.input_name(row),
            value=paper.number(abs(row["contribution"]), decimals=3),
            share=paper.number(100 * row["share"], decimals=1),
            origin=origin_text(paper, row),
        )


def _ticket_lines(tickets):
    """Yield the net standard volume of the first tickets, and the tickets that do not agree."""
    from tankcal.products.quantity.chain import QUANTITIES
    from tankcal.products.quantity.results import compare
    from tankcal.report.plain import words_with_part
    from tankcal.text.words import load_words

    words = words_with_part(load_words(language_of_run()), "ticket")
    state = tickets.result_state
    result, place = tickets.quantities[state], QUANTITIES.index("nsv_m3")
    for row, name in enumerate(tickets.names[:SHOWN_TICKETS]):
        written = format_with_u(result.value[row, place], result.U[row, place], marks())
        yield message(
            "ticket_line",
            "  {name}: {state}, {quantity} {value} m³, U = {U} m³",
            name=name,
            state=words["states"][state],
            quantity=words["quantities"]["nsv_m3"],
            value=written.value,
            U=written.uncertainty,
        )
    if len(tickets.names) > SHOWN_TICKETS:
        yield message("ticket_more", "  ... and {count} more; --out FILE.csv writes all of them",
                      count=len(tickets.names) - SHOWN_TICKETS)  # fmt: skip
    comparison = compare(tickets)
    if comparison is None or comparison.e_n is None:
        return
    rows = (abs(comparison.e_n) > 1).nonzero()[0]
    if len(rows):
        more = ", ..." if len(rows) > SHOWN else ""
        yield message(
            "ticket_disagree",
            "{count} of {total} tickets do not agree with the other party (|E_n| > 1): {names}",
            count=len(rows),
            total=len(tickets.names),
            names=", ".join(tickets.names[row] for row in rows[:SHOWN]) + more,
        )
