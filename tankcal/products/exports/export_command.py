"""`tankcal export`: files for gauging and inventory systems, from a record."""

from pathlib import Path

from tankcal.errors import InputError, Problem
from tankcal.messages import message, printable
from tankcal.terminal import (
    add_json,
    add_language,
    language_of_run,
    parse_positive,
    parse_several,
    print_json,
    say,
    speak,
    speak_of_record,
)


def add(commands):
    """Add the parser of `tankcal export`."""
    parser = commands.add_parser(
        "export",
        help="write a table for a gauging or inventory system",
        description="Write the capacity table of a record in the form of a gauging or inventory "
        "system, defined by a profile. If the system limits the number of rows, the rows with the "
        "smallest error are selected. Each value is rounded once, and the linter checks the file. "
        "The report beside the file (NAME-report.txt) states the largest error of the volumes "
        "that the system computes. docs/exports.md lists the profiles.",
        epilog="exit status: 0 done; 2 the record, the profile or the options must be corrected "
        "(one line per problem; no file is written).",
    )
    parser.add_argument(
        "record", metavar="RECORD", nargs="?", help="a record.json, or a folder of results"
    )
    parser.add_argument(
        "--profile", metavar="NAME", help="a profile that --list shows, or your TOML file"
    )
    parser.add_argument("--list", action="store_true", help="list the shipped profiles")
    most = parser.add_mutually_exclusive_group()
    most.add_argument(
        "--points",
        metavar="K",
        type=parse_several,
        help="largest number of rows; the rows with the smallest error are selected",
    )
    most.add_argument(
        "--max-error-l",
        metavar="LITRES",
        type=parse_positive,
        help="write the fewest rows with at most this error, in litres",
    )
    parser.add_argument(
        "--gauge-on-shell",
        action="store_true",
        help="the gauge is mounted on the shell: compute HyTD, the movement of its reference",
    )
    parser.add_argument(
        "--high-legs",
        action="store_true",
        help="write the table for the floating roof on its legs in their high position",
    )
    parser.add_argument(
        "--out", metavar="FILE", help="output file (default: TANK-PROFILE.csv in this folder)"
    )
    add_language(parser)
    add_json(parser)
    parser.set_defaults(command=_export)


def _export(options):
    speak(options.language)
    if options.list:
        return _list(options)
    _refuse_missing(options)
    from tankcal.products.exports.exporting import export_record, write_export
    from tankcal.products.exports.profiles import find_profile
    from tankcal.report.outputs import record_file

    source, error = record_file(options.record), options.max_error_l
    speak_of_record(options.language, source)
    profile, language = find_profile(options.profile), language_of_run()
    export = export_record(
        source, profile, points=options.points,
        max_error_m3=None if error is None else error / 1000,
        hangs_on_shell=options.gauge_on_shell, on_high_legs=options.high_legs, language=language,
    )  # fmt: skip
    paths = write_export(export, _output_file(options, export, source), language)
    if options.machine:
        print_json(
            exit_status=0, points=len(export.dip_m), error_l=1000 * export.error_m3,
            at_m=export.at_m, report=list(map(str, export.lines)), files=list(map(str, paths)),
        )  # fmt: skip
        return 0
    for line in export.lines:
        say(line)
    for path in paths:
        print(f"  {printable(path)}")
    return 0


def _refuse_missing(options):
    record = message(
        "export_needs_record", "missing; expected a record.json or a folder of results"
    )
    profile = message(
        "export_needs_profile",
        "missing; expected a profile that tankcal export --list shows, or a .toml file",
    )
    needed = (("RECORD", options.record, record), ("--profile", options.profile, profile))
    missing = [Problem(name, text) for name, value, text in needed if value is None]
    if missing:
        raise InputError(missing)


def _output_file(options, export, source):
    """Return the output file: as requested, or named after tank and profile in this folder."""
    from tankcal.products.exports.exporting import default_name

    if options.out is not None:
        out = Path(options.out)
        if (
            out.is_dir()
            or out.suffix in ("", ".json", ".toml")
            or out.resolve() == source.resolve()
        ):
            text = message(
                "export_out",
                "expected a file name with an ending such as {ending}, not a folder, a record or a "
                "profile",
                ending=export.profile.ending,
            )
            raise InputError(Problem("--out", text))
        return out
    return Path(default_name(export))


def _list(options):
    """Print the shipped profiles: name, system, points, whether verified."""
    from tankcal.products.exports.profiles import shipped_profiles

    profiles = shipped_profiles()
    if options.machine:
        print_json(
            exit_status=0,
            profiles=[
                {
                    "profile": code,
                    "name": profile.name,
                    "max_points": profile.max_points,
                    "verified": profile.verified,
                    "source": profile.source,
                }
                for code, profile in profiles.items()
            ],
        )
        return 0
    for code, profile in profiles.items():
        points = message("export_any_points", "any number of rows")
        if profile.max_points:
            points = message("export_most_points", "at most {most} rows", most=profile.max_points)
        known = message("export_unverified", "not verified")
        if profile.verified:
            known = message("export_verified", "verified")
        say(
            message(
                "export_listed",
                "{profile} {name}: {points}; {known}",
                profile=code.ljust(26),
                name=profile.name,
                points=points,
                known=known,
            )
        )
    return 0
