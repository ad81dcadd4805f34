"""`tankcal history`: tables of one tank over the years."""

from tankcal.messages import message
from tankcal.terminal import (
    Progress,
    add_json,
    add_language,
    language_of_run,
    marks,
    parse_dips,
    print_saved,
    say,
    speak_of_record,
    warn,
)
from tankcal.text.digits import NOTHING, decimals_of_height, fixed, format_with_u

MOST_SHOWN = 20  # warnings, and files that are left out


def add(commands):
    """Add the parser of `tankcal history`."""
    history = commands.add_parser(
        "history",
        help="show the tables of one tank over the years",
        description="Search folders for the results of a tank (record.json, inspection.json) and "
        "reduce its tables to one basis. Show certificates, volumes, radii and verdicts over the "
        "years, each with U, and the changes between successive tables by the method of tankcal "
        "compare. See docs/history.md.",
        epilog="exit status: 0 done; 2 the input must be corrected (one line for each unreadable "
        "file).",
    )
    history.add_argument(
        "sources",
        metavar="TANK",
        nargs="+",
        help="folders to search for results, with their subfolders; files record.json or "
        "inspection.json; former tables, given by a former.toml with their date",
    )
    history.add_argument(
        "--tank",
        metavar="ID",
        action="append",
        default=[],
        help="id of the tank, if the folders contain several tanks; repeat the option for a tank "
        "with several ids",
    )
    history.add_argument(
        "--at",
        metavar="DIPS",
        type=parse_dips,
        help="dips of the volumes shown, m, separated by commas (default: fifths of the range "
        "common to all tables)",
    )
    history.add_argument(
        "--courses",
        metavar="FILE",
        help="courses.csv of a vertical tank, if no record contains its courses",
    )
    history.add_argument(
        "--register",
        metavar="FILE",
        help="register of certificates (tankcal register): states issued, replaced, withdrawn",
    )
    history.add_argument(
        "--out", metavar="DIR", help="write history.json and reports to this folder, all or nothing"
    )
    add_language(history)
    history.add_argument("--quiet", action="store_true", help="no progress, only problems")
    add_json(history)
    history.set_defaults(command=_history)


def _history(options):
    speak_of_record(options.language, *options.sources)
    from tankcal.products.recalibration.history import history_of_files
    from tankcal.record.schema import to_plain

    if options.out is not None:
        from tankcal.report.history import refuse_foreign, write_history

        refuse_foreign(options.out)
    show = Progress(options.quiet or options.machine)
    history = to_plain(
        history_of_files(
            options.sources,
            tanks=options.tank,
            dips_m=options.at,
            courses=options.courses,
            register=options.register,
            progress=show.part,
        )
    )
    written = ()
    if options.out is not None:
        written = write_history(history, options.out, language_of_run(), show.step)
    show.end()
    print_saved(options, history, _tell, written)


def _tell(history):
    """Print warnings and a line for each certificate, change and inspection."""
    from tankcal.report.history import HistoryPaper
    from tankcal.report.history.tables import state_text

    paper = HistoryPaper(history, language_of_run())
    warn(paper.warning(warning) for warning in history["warnings"][:MOST_SHOWN])
    for omission in history["left_out"][:MOST_SHOWN]:
        say(message("history_left_out", "not in the history: {text}", text=paper.warning(omission)))
    say(_span(history))
    for certificate in history["certificates"]:
        state = state_text(paper, certificate)
        say(_certificate(certificate, state))
    for change in history["changes"]:
        say(_change(change, paper))
    for inspection in history["inspections"]:
        say(_inspection(inspection))
    for month in history.get("months") or ():
        say(_month(month, paper))


def _span(history):
    certificates = history["certificates"]
    tank = history["tank"] or certificates[-1]["file"]
    if len(certificates) == 1:
        return message(
            "history_one", "{tank}: 1 certificate, {date}", tank=tank, date=certificates[0]["date"]
        )
    return message(
        "history_span",
        "{tank}: {count} certificates, {first} to {last}",
        tank=tank,
        count=len(certificates),
        first=certificates[0]["date"],
        last=certificates[-1]["date"],
    )


def _certificate(certificate, state):
    U = ""
    if certificate["U_top_m3"] is not None:
        U = message(
            "history_U", ", U = {uncertainty} m3", uncertainty=_volume(certificate["U_top_m3"])
        )
    return message(
        "history_row",
        "  {number}  {date}  {volume} m3 at {dip} m{uncertainty}  {name}{state}",
        state=f", {state}" if state else "",
        number=certificate["certificate"],
        date=certificate["date"],
        volume=_volume(certificate["top_volume_m3"]),
        dip=_dip(certificate["top_dip_m"]),
        uncertainty=U,
        name=certificate["number"] or certificate["file"],
    )


def _month(month, paper):
    leak = format_with_u(month["leak_l_h"], month["leak_U_l_h"], marks())
    change = format_with_u(month["throughput_percent"], month["throughput_U_percent"], marks())
    return message(
        "history_month", "  {month}: loss {leak} L/h, U = {U} L/h; throughput {change} %, "
        "U = {of_change} %; {verdict}", month=month["month"], leak=leak.value,
        U=leak.uncertainty,
        change=change.value, of_change=change.uncertainty,
        verdict=paper.words["month_verdicts"][month["verdict"]],
    )  # fmt: skip


def _change(change, paper):
    E_n, d = change["worst_E_n"], change["top_d_m3"]
    return message(
        "history_change",
        "  {former} to {new}: {d} m3 at {dip} m, worst E_n {E_n}, {verdict}",
        former=change["former"],
        new=change["new"],
        d=("+" if d > 0 else "") + _volume(d),
        dip=_dip(change["high_m"]),
        E_n=NOTHING if E_n is None else fixed(E_n, 2, marks()),
        verdict=paper.words["verdicts"].get(change["verdict"] or "", NOTHING),
    )


def _inspection(inspection):
    passed = sum(check["verdict"] == "passed" for check in inspection["checks"])
    return message(
        "history_inspected",
        "  inspection of {date}: {passed} of {count} checks passed  {name}",
        date=inspection["date"] or NOTHING,
        passed=passed,
        count=len(inspection["checks"]),
        name=inspection["file"],
    )


def _volume(value):
    return fixed(value, 3, marks())


def _dip(value):
    return fixed(value, decimals_of_height(value), marks())
