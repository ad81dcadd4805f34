"""`tankcal new`: an empty job to fill in."""

from pathlib import Path

from tankcal.cli.showing import say, speak
from tankcal.errors import InputError, Problem
from tankcal.messages import message, printable
from tankcal.text.languages import DEFAULT, LANGUAGES


def add(commands):
    """The parser of `tankcal new`."""
    new = commands.add_parser(
        "new",
        help="write an empty job to fill in",
        description="Write a starter job: job.toml and the CSV files of that kind of tank, with "
        "comments, and the same as one workbook, job.xlsx. Fill in one of the two.",
    )
    new.add_argument(
        "directory", metavar="DIR", help="a folder to make; with --workbook also a new .xlsx file"
    )
    new.add_argument("--workbook", action="store_true", help="write the workbook alone")
    new.add_argument(
        "--language",
        choices=LANGUAGES,
        default=DEFAULT,
        help="of the workbook's explanations and of the papers (default: en)",
    )
    new.add_argument(
        "--kind",
        choices=("vertical", "horizontal", "sphere", "mesh"),
        default="vertical",
        help="kind of tank (default: vertical)",
    )
    new.add_argument(
        "--survey",
        choices=(
            *("photos", "total-station", "strapping", "reference-line", "wall-hits", "tangents"),
            *("triangulation", "cloud", "liquid", "radii"),
        ),
        help="with files for photographs, total-station readings, circumferences by tape, "
        "offsets from reference lines, bare hits of the wall, tangents, triangulation with a "
        "stadia, point clouds, (of any kind of tank) metered liquid, or the radii of a former "
        "table, in place of surveyed points",
    )
    new.set_defaults(command=_new)


def _refuse_other_survey(kind, survey, language):
    from tankcal.job.starter.form import Form

    try:
        Form(kind, survey, language)
    except ValueError as error:
        expected = message(
            "survey_of_other_kind",
            "found {survey}; expected another one: a tank of kind {of_kind} has no such survey",
            survey=survey,
            of_kind=kind,
        )
        raise InputError(Problem("--survey", expected)) from error


def _new(options):
    from tankcal.job.starter import write_input_workbook, write_starter
    from tankcal.report.field_forms import FILE, is_filled_by_pen, write_field_sheets

    if options.language != DEFAULT:
        speak(options.language)
    directory = Path(options.directory)
    form = (options.kind, options.survey, options.language)
    _refuse_other_survey(*form)
    if options.workbook:
        path = write_input_workbook(directory, *form)
        say(message("wrote_workbook", "wrote {file}: fill it in, save it, then", file=str(path)))
        print(f"  tankcal run {printable(path)}")
        return
    write_starter(directory, *form)
    if is_filled_by_pen(options.survey):
        sheets = directory / FILE
        write_field_sheets(sheets, options.survey, options.language, options.kind)
        say(message("wrote_field_sheets", "wrote {file}: print it for the crew", file=str(sheets)))
    say(
        message(
            "wrote_folder",
            "wrote {file}: fill in job.toml and the CSV files, or job.xlsx instead, then",
            file=str(directory),
        )
    )
    book = directory / "job.xlsx"
    say(
        message(
            "run_either",
            "  tankcal run {folder}     or     tankcal run {file}",
            folder=str(directory),
            file=str(book),
        )
    )
