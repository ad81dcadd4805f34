"""What a plan becomes on paper: prediction, field sheets, an empty job, files for programs.

Nothing here computes a number.
"""

from pathlib import Path

from tankcal.messages import message
from tankcal.record import manifest
from tankcal.report import folders
from tankcal.report.planning.paper import PlanPaper

__all__ = ["DESIGN", "FILES", "JOB", "PlanPaper", "refuse_foreign", "write"]

JOB = "job"  # folder of the empty job
DESIGN = "design"  # folder of the plan that a search ends with
WRITING_JOB = message("plan_writing_job", "writing the empty job")
WRITING_TABLES = message("plan_writing_tables", "writing the tables")
FILES = (
    *("plan.json", "points.csv", "sections.csv", "capacity.csv", "changes.csv", "design.csv"),
    *("changes.png", "prediction.pdf", "field-sheets.pdf", "field-sheets.xlsx"),
    manifest.FILE,
)


def write(
    prediction,
    directory,
    progress=None,
    *,
    effects=(),
    design=None,
    simulated=None,
    language=None,
    workbook=False,
):
    """Write everything that a `planning.predicting.Prediction` gives, all or nothing; the paths.

    directory  made when missing; earlier results of a plan there are replaced
    progress   called with a line of text as each step begins
    effects    `planning.helping.Effect` of changes that were tried
    design     `planning.helping.Path`, whose last plan has the same papers in a folder of its own;
               None: none was looked for
    simulated  `planning.simulations.Simulated` of the prediction, or None
    language   of papers and workbook, one of languages.LANGUAGES; None: that of the plan
    workbook   write the empty job as job.xlsx in place of text files

    Raises InputError for a folder that holds other things, or an empty job that was filled in.
    """
    refuse_foreign(directory)
    progress = progress or (lambda text: None)
    with folders.replaced(directory, language) as temporary:
        kind = _paper_of(prediction)
        paper = kind(prediction, language, effects, design, simulated)
        _write(paper, temporary, progress, workbook)
        if design is not None and design.steps:
            (temporary / DESIGN).mkdir()
            designed = kind(design.prediction, language)
            _write(designed, temporary / DESIGN, progress, workbook)
        _refuse_filled(directory)  # meanwhile
    names = (*FILES, JOB, DESIGN)
    return [path for path in (Path(directory) / name for name in names) if path.exists()]


def _paper_of(prediction):
    from tankcal.planning.wall.prediction import WallPrediction
    from tankcal.report.planning.wall_paper import WallPaper

    return WallPaper if isinstance(prediction, WallPrediction) else PlanPaper


def _write(paper, folder, progress, as_workbook):
    """The files of a PlanPaper."""
    if paper.is_wall:
        _write_wall(paper, folder, progress, as_workbook)
        return
    from tankcal.report.planning import empty_job, files, workbook
    from tankcal.report.planning.field_sheets import sheets
    from tankcal.report.planning.outlook import outlook

    progress(WRITING_JOB)
    empty_job.write(paper.prediction, folder / JOB, as_workbook)
    progress(WRITING_TABLES)
    files.write(paper, folder, empty_job.fingerprints(folder / JOB))
    workbook.write(paper, folder / "field-sheets.xlsx")
    _set(paper, folder, progress, outlook(paper), sheets(paper))


def _write_wall(paper, folder, progress, as_workbook):
    """The files of a WallPaper."""
    from tankcal.report.planning import empty_job, wall_files, workbook
    from tankcal.report.planning.wall_paper import wall_outlook, wall_sheets

    progress(WRITING_JOB)
    wall_files.write_empty_job(paper.prediction, folder / JOB, as_workbook)
    progress(WRITING_TABLES)
    wall_files.write_wall(paper, folder, empty_job.fingerprints(folder / JOB))
    workbook.write_of_wall(paper, folder / "field-sheets.xlsx")
    _set(paper, folder, progress, wall_outlook(paper), wall_sheets(paper))


def _set(paper, folder, progress, prediction, sheets):
    """The PDFs of a paper, and the picture of the changes."""
    from tankcal.report.pdf import pdf
    from tankcal.report.planning import figures

    progress(message("plan_setting_papers", "setting prediction and field sheets"))
    for name, blocks in (("prediction.pdf", prediction), ("field-sheets.pdf", sheets)):
        (folder / name).write_bytes(pdf([block.data for block in blocks], folder))
    if any(not one.why for one in paper.effects):
        figures.changes(paper).savefig(folder / "changes.png", dpi=150)


def refuse_foreign(directory):
    """Raise InputError when `directory` holds anything but results of write(), as it left them."""
    directory = Path(directory)
    folders.refuse_foreign(directory, (*FILES, JOB, DESIGN))
    if (directory / DESIGN).exists():
        folders.refuse_foreign(directory / DESIGN, (*FILES, JOB))
    _refuse_filled(directory)


def _refuse_filled(directory):
    """Raise InputError when a crew filled in an empty job of a plan."""
    from tankcal.report.planning import empty_job

    for folder in (Path(directory), Path(directory) / DESIGN):
        empty_job.refuse_filled(folder / JOB, folder / "plan.json")
