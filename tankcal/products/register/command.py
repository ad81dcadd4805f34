"""`tankcal register`: certificates issued, replaced and withdrawn."""

from datetime import date

from tankcal.errors import InputError, Problem
from tankcal.messages import message
from tankcal.terminal import add_json, add_language, print_json, say, speak, speak_of_record


def add(commands):
    """Add the parser of `tankcal register`."""
    parser = commands.add_parser(
        "register",
        help="keep the register of certificates: issued, replaced, withdrawn",
        description="Append certificates to the register of the laboratory, a CSV file, or list "
        "their states. A number is given once; drafts are refused. A certificate whose job has "
        "`replaces` marks the earlier certificate as replaced. See docs/history.md.",
        epilog="exit status: 0 done; 2 the register, the results or the options must be corrected "
        "(no row is written).",
    )
    parser.add_argument("register", metavar="REGISTER.csv", help="register; created with --issue")
    parser.add_argument(
        "--issue", metavar="RESULTS", nargs="+", help="folders of results to register as issued"
    )
    parser.add_argument("--withdraw", metavar="NUMBER", help="number of a certificate to withdraw")
    parser.add_argument("--reason", metavar="TEXT", help="with --withdraw, the reason")
    parser.add_argument("--date", metavar="DATE", help="with --withdraw, its date (default: today)")
    add_language(parser)
    add_json(parser)
    parser.set_defaults(command=_register)


def _register(options):
    if options.issue:
        speak_of_record(options.language, *options.issue)
    else:
        speak(options.language)
    from tankcal.products.register.certificates import issue, read_certificates, withdraw

    _check_options(options)
    if options.issue:
        certificates = issue(options.register, options.issue)
    elif options.withdraw:
        day = options.date or str(date.today())
        certificates = [withdraw(options.register, options.withdraw, options.reason, day)]
    else:
        certificates = [*read_certificates(options.register).values()]
    if options.machine:
        print_json(exit_status=0, certificates=[vars(entry) for entry in certificates])
        return 0
    for entry in certificates:
        say(_line(entry))
    return 0


def _check_options(options):
    """Refuse options that contradict each other, a missing reason, and a bad date."""
    problems = []
    if options.withdraw and options.issue:
        text = message(
            "register_two_actions", "given together with --issue; expected a single action"
        )
        problems.append(Problem("--withdraw", text))
    if options.withdraw and not (options.reason or "").strip():
        text = message("register_no_reason", "missing; expected the reason of the withdrawal")
        problems.append(Problem("--reason", text))
    for name in ("reason", "date"):
        if getattr(options, name) and not options.withdraw:
            text = message("register_only_withdraw", "only used with --withdraw")
            problems.append(Problem(f"--{name}", text))
    if options.date:
        try:
            date.fromisoformat(options.date)
        except ValueError:
            text = message(
                "register_bad_date",
                "found {text!r}; expected a date, year-month-day",
                text=options.date,
            )
            problems.append(Problem("--date", text))
    if problems:
        raise InputError(problems)


def _line(entry):
    """Line of a certificate with its state."""
    values = {"number": entry.number, "tank": entry.tank, "day": entry.since}
    if entry.state == "issued":
        return message("register_issued", "{number}  {tank}  issued {day}", **values)
    if entry.state == "replaced":
        return message(
            "register_replaced",
            "{number}  {tank}  replaced {day} by {other}: {reason}",
            other=entry.replaced_by,
            reason=entry.reason,
            **values,
        )
    return message(
        "register_withdrawn",
        "{number}  {tank}  withdrawn {day}: {reason}",
        reason=entry.reason,
        **values,
    )
