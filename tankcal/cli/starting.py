"""`tankcal new`: creation of an empty job."""

import shlex
from pathlib import Path

from tankcal.messages import message, printable
from tankcal.terminal import language_of_run, say, speak
from tankcal.text.shipped import LANGUAGES

USUAL_KIND = "vertical"


def add(commands):
    """Add the parser of `tankcal new`."""
    new = commands.add_parser(
        "new",
        help="create an empty job",
        description="Create an empty job with explanatory comments for the kind of tank: job.toml "
        "and CSV files, or with --workbook one Excel workbook, job.xlsx.",
    )
    new.add_argument(
        "directory",
        metavar="DIR",
        help="the folder to create; with --workbook also a new .xlsx file",
    )
    new.add_argument(
        "--workbook", action="store_true", help="create an Excel workbook in place of text files"
    )
    new.add_argument(
        "--language",
        choices=LANGUAGES,
        help="language of comments and reports (default: language of the environment)",
    )
    new.add_argument(
        "--kind",
        choices=("vertical", "horizontal", "sphere", "mesh"),
        default=USUAL_KIND,
        help="kind of tank (default: vertical)",
    )
    new.add_argument(
        "--survey",
        choices=(
            *("photos", "total-station", "strapping", "reference-line", "wall-hits", "tangents"),
            *("triangulation", "cloud", "liquid", "radii"),
        ),
        help="survey method, with its input files: photographs, total-station readings, "
        "circumferences by tape, offsets from reference lines, reflectorless readings of the "
        "wall, tangents, triangulation with a stadia, point clouds, metered liquid (for any "
        "kind of tank), or the radii of a former table (default: surveyed points)",
    )
    new.set_defaults(command=_new)


def _new(options):
    from tankcal.job.starter import write_input_workbook, write_starter
    from tankcal.job.starter.writing import refuse_other_survey

    if options.language:
        speak(options.language)
    directory, language = Path(options.directory), options.language or language_of_run()
    form = (options.kind, options.survey, language)
    refuse_other_survey(*form)
    if not options.workbook:
        write_starter(directory, *form)
        _write_field_sheets(directory, *form)
        text = "wrote {file}: fill in job.toml and the CSV files, then"
        _say_then(message("wrote_folder", text, file=str(directory)), directory)
        say(message("workbook_instead", "to use an Excel workbook in place of these files:"))
        _print_command("new", directory, *_repeat_options(options), "--workbook")
        return
    path = write_input_workbook(directory, *form)
    if path != directory:
        _write_field_sheets(directory, *form)
    text = "wrote {file}: fill it in, save it, then"
    _say_then(message("wrote_workbook", text, file=str(path)), directory)


def _say_then(text, job):
    say(text)
    _print_command("run", job)


def _print_command(*words):
    print(f"  {printable(shlex.join(['tankcal', *map(str, words)]))}")


def _repeat_options(options):
    """Return the options of the same form as words of a command."""
    choices = {"--kind": options.kind, "--survey": options.survey, "--language": options.language}
    usual = {"--kind": USUAL_KIND, "--survey": None, "--language": None}
    return [
        word for name, value in choices.items() if value != usual[name] for word in (name, value)
    ]


def _write_field_sheets(directory, kind, survey, language):
    from tankcal.report.field_forms import FILE, is_filled_by_pen, write_field_sheets

    if is_filled_by_pen(survey):
        sheets = directory / FILE
        write_field_sheets(sheets, survey, language, kind)
        say(
            message(
                "wrote_field_sheets",
                "wrote {file}: print it for the survey party",
                file=str(sheets),
            )
        )
