"""`tankcal intercomparison`: packages of simulated surveys, answers, scores."""

from pathlib import Path

from tankcal.messages import message
from tankcal.terminal import (
    Progress,
    add_json,
    add_language,
    language_of_run,
    marks,
    parse_count,
    print_paths,
    print_saved,
    refuse_argument,
    say,
    say_in_language,
    speak,
    warn,
)
from tankcal.text.digits import NOTHING, fixed

METHODS = (
    *("points", "photographs", "total-station", "tape", "reference-line", "cloud", "liquid"),
)
MOST_WARNINGS = 20  # that are shown
MOST_TANKS = 100


def add(commands):
    """Add the parsers of `tankcal intercomparison` and its commands."""
    parser = commands.add_parser(
        "intercomparison",
        help="compare software: simulated surveys with sealed true volumes, answers, scores",
        description="Run a proficiency test of software for tank calibration: create a package of "
        "simulated surveys with sealed true volumes, answer it, and score the answers of any "
        "software. docs/intercomparison.md describes the formats and the formulas.",
    )
    parser.set_defaults(shown=parser)
    inner = parser.add_subparsers(metavar="WHAT")
    _add_make(inner)
    _add_template(inner)
    _add_answer(inner)
    _add_score(inner)


def _add_make(commands):
    make = commands.add_parser(
        "make",
        help="simulate tanks and their surveys, and seal the true volumes",
        description="Write package (for publication), sealed/truth.json (secret until all answers "
        "are received) and practice (a package with its true volumes) to a new folder. The "
        "package contains the SHA-256 of the truth.",
    )
    make.add_argument("directory", metavar="DIR", help="the folder to create")
    make.add_argument(
        "--tanks", metavar="N", type=_tanks, default=6, help="number of tanks (default: 6)"
    )
    make.add_argument(
        "--practice", metavar="N", type=_tanks_or_none, default=1,
        help="number of practice tanks, with their true volumes (default: 1; 0: none)",
    )  # fmt: skip
    make.add_argument(
        "--seed",
        metavar="S",
        type=parse_count,
        default=1,
        help="seed of the simulation (default: 1)",
    )
    make.add_argument(
        "--secret", metavar="HEX", type=_secret,
        help="64 hexadecimal digits from a truth file, to create its package again (default: "
"random)",
    )  # fmt: skip
    make.add_argument(
        "--methods", metavar="METHOD", nargs="+", choices=METHODS, default=list(METHODS),
        help=f"survey methods: {', '.join(METHODS)} (default: all)",
    )  # fmt: skip
    _add_common(make)
    make.set_defaults(command=_make)


def _add_template(commands):
    template = commands.add_parser(
        "template",
        help="write empty forms for the answers to a package",
        description="Write participant.toml and a table for each survey with the required heights.",
    )
    _add_package_and_answers(template)
    template.set_defaults(command=_template)


def _add_answer(commands):
    answer = commands.add_parser(
        "answer",
        help="compute a package with tankcal and write the answers",
        description="Run tankcal on every survey of a package and write the answers in the form "
        "required of any participant.",
    )
    _add_package_and_answers(answer)
    answer.set_defaults(command=_answer)


def _add_score(commands):
    score = commands.add_parser(
        "score",
        help="score answers against the truth",
        description="Check that the truth is the sealed truth, and report error, E_n, coverage "
        "and form of every table of all participants.",
        epilog="exit status: 0 done, whatever the scores; 2 answers or truth must be corrected "
        "(one line per problem).",
    )
    score.add_argument("names", metavar="ANSWERS", nargs="+", help="folders of answers")
    score.add_argument("--truth", metavar="TRUTH", required=True, help="truth.json, or its folder")
    score.add_argument(
        "--package", metavar="PACKAGE", help="the package: its manifest must also name this truth"
    )
    score.add_argument(
        "--out",
        metavar="DIR",
        help="write scores.json, web page and workbook to this folder, all or nothing",
    )
    _add_common(score)
    add_json(score)
    score.set_defaults(command=_score)


def _add_package_and_answers(parser):
    parser.add_argument("package", metavar="PACKAGE", help="the folder of a package")
    parser.add_argument("--out", metavar="ANSWERS", required=True, help="the folder to create")
    _add_common(parser)


def _add_common(parser):
    add_language(parser)
    parser.add_argument("--quiet", action="store_true", help="no progress, only problems")


def _tanks(text):
    value = _tanks_or_none(text)
    if value == 0:
        raise refuse_argument(message("option_tanks", "found {text!r}; expected a whole number "
                                      "from 1 to {most}", text=text, most=MOST_TANKS))  # fmt: skip
    return value


def _tanks_or_none(text):
    value = parse_count(text)
    if not 0 <= value <= MOST_TANKS:
        raise refuse_argument(message("option_tanks_or_none", "found {text!r}; expected a whole "
                                      "number from 0 to {most}", text=text,
                                      most=MOST_TANKS))  # fmt: skip
    return value


def _secret(text):
    if len(text) != 64 or set(text.lower()) - set("0123456789abcdef"):
        raise refuse_argument(message("option_secret", "found {text!r}; expected 64 hexadecimal "
                                      "digits", text=text[:70]))  # fmt: skip
    return text.lower()


# ---- the commands


def _make(options):
    import secrets

    from tankcal.products.intercomparison.package import make_package, write_files
    from tankcal.record.intercomparison import TRUTH
    from tankcal.report.folders import replace_folder

    speak(options.language)
    out = Path(options.directory)
    _refuse_existing(out)
    show = Progress(options.quiet)
    methods = [method for method in METHODS if method in options.methods]
    secret = options.secret or secrets.token_hex(32)
    package = make_package(options.tanks, options.seed, methods, secret=secret, progress=show.part)
    with replace_folder(out) as folder:
        write_files(folder / "package", package.files)
        write_files(folder / "sealed", {TRUTH.file: package.truth})
        if options.practice:
            practice = make_package(
                options.practice, options.seed, methods, is_open=True, progress=show.part
            )
            write_files(folder / "practice", {**practice.files, TRUTH.file: practice.truth})
    show.end()
    say(
        message(
            "ic_keep_sealed",
            "keep {file} secret until all answers are received; {manifest} contains its SHA-256",
            file=str(out / "sealed" / TRUTH.file),
            manifest=str(out / "package" / "manifest.json"),
        )
    )
    print_paths(out, ["package", "sealed", *(["practice"] if options.practice else [])])


def _template(options):
    from tankcal.products.intercomparison.answers import make_forms
    from tankcal.products.intercomparison.package import write_files
    from tankcal.report.folders import replace_folder

    speak(options.language)
    _refuse_existing(options.out)
    manifest = _package(options.package)
    files = make_forms(manifest, say_in_language)
    with replace_folder(options.out) as folder:
        write_files(folder, files)
    print_paths(options.out, sorted(files))


def _answer(options):
    from tankcal.products.intercomparison.answers import answer_files, answer_package
    from tankcal.products.intercomparison.package import write_files
    from tankcal.report.folders import replace_folder

    speak(options.language)
    _refuse_existing(options.out)
    manifest = _package(options.package)
    show = Progress(options.quiet)
    saved, warnings = answer_package(options.package, manifest, show.part)
    show.end()
    warn(warnings)
    files = answer_files(saved)
    with replace_folder(options.out) as folder:
        write_files(folder, files)
    print_paths(options.out, sorted(files))


def _score(options):
    speak(options.language)
    from tankcal.products.intercomparison.answers import score_folders
    from tankcal.record.schema import to_plain

    if options.out is not None:
        from tankcal.report.scores import refuse_foreign, write_scores

        refuse_foreign(options.out)
    show = Progress(options.quiet or options.machine)
    show.step(message("ic_scoring", "scoring answers (folders: {count})",
                      count=len(options.names)))  # fmt: skip
    scores = to_plain(score_folders(options.names, options.truth, options.package))
    written = ()
    if options.out is not None:
        written = write_scores(scores, options.out, language_of_run(), show.step)
    show.end()
    print_saved(options, scores, _tell, written)


def _refuse_existing(out):
    """Raise InputError if the folder to create exists and is not empty."""
    from tankcal.report.folders import refuse_foreign

    refuse_foreign(out, ())


def _package(folder):
    """Return the manifest of a package; raise InputError with all its problems."""
    from tankcal.job.tables import Log
    from tankcal.products.intercomparison.package import load_package

    log = Log()
    manifest = load_package(folder, log)
    log.stop_if_problems()
    return manifest


def _tell(scores):
    """Print warnings and a line for each participant and method."""
    from tankcal.report.scores import ScoresPaper

    paper = ScoresPaper(scores, language_of_run())
    warn(paper.warning(warning) for warning in scores["warnings"][:MOST_WARNINGS])
    for score in scores["methods"]:
        values = {
            "who": paper.participant(score),
            "method": paper.method(score["method"]),
            "tables": score["tables"],
            "asked": score["asked"],
            "rms": _ppm(score["rms_top_ppm"]),
            "U": _ppm(score["mean_U_ppm"]),
            "within": score["tops_within"],
            "judged": score["tops_judged"],
            "zeta": NOTHING if score["rms_zeta"] is None else fixed(score["rms_zeta"], 2, marks()),
        }
        say(
            message(
                "ic_score",
                "{who}, {method}: {tables} of {asked} tables, rms {rms} ppm, U {U} ppm, |E_n| <= 1 "
                "at {within} of {judged} tops, zeta {zeta} rms",
                **values,
            )
        )


def _ppm(value):
    return NOTHING if value is None else fixed(value, 0, marks())
