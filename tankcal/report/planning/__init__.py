"""Documents of a plan: prediction, field sheets, an empty job, files for programs.

This package computes no results.
"""

from pathlib import Path

from tankcal.messages import message
from tankcal.record import manifest
from tankcal.report import folders
from tankcal.report.planning.pages import DESIGN, PlanPaper

__all__ = ["DESIGN", "FILES", "JOB", "PlanPaper", "refuse_foreign", "write"]

JOB = "job"  # folder of the empty job
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
    """Write all files and documents of a prediction to a folder, all or nothing.

    Parameters
    ----------
    prediction : Prediction or WallPrediction
    directory : path
        Created if missing; earlier results of a plan in it are replaced.
    progress : callable, optional
        Called with a line of text at the start of each step.
    effects : sequence of Effect, optional
        Effects of the evaluated changes.
    design : Path, optional
        Search for a design; the documents of its last plan are in a folder of their own.
    simulated : Simulated or SimulatedWall, optional
        Simulated surveys of the prediction.
    language : str, optional
        Language of documents and workbook, one of languages.LANGUAGES; None: that of the plan.
    workbook : bool, optional
        Write the empty job as job.xlsx instead of text files.

    Returns
    -------
    list of Path
        The written files and folders.

    Raises
    ------
    InputError
        For a folder with other content, or an empty job that was completed.
    """
    refuse_foreign(directory)
    progress = progress or (lambda text: None)
    with folders.replace_folder(directory, language) as temporary:
        from tankcal.planning.wall.prediction import WallPrediction
        from tankcal.report.planning.wall_paper import WallPaper

        paper_class = WallPaper if isinstance(prediction, WallPrediction) else PlanPaper
        paper = paper_class(prediction, language, effects, design, simulated)
        _write(paper, temporary, progress, workbook)
        if design is not None and design.steps:
            (temporary / DESIGN).mkdir()
            designed = paper_class(design.prediction, language)
            _write(designed, temporary / DESIGN, progress, workbook)
        _refuse_filled(directory)  # completed while the files were written
    names = (*FILES, JOB, DESIGN)
    return [path for path in (Path(directory) / name for name in names) if path.exists()]


def _write(paper, folder, progress, as_workbook):
    """Write the files of a PlanPaper or WallPaper."""
    from tankcal.report.planning import empty_job, files
    from tankcal.report.planning.pages import outlook, sheets
    from tankcal.report.planning.wall_paper import wall_outlook, wall_sheets

    write_job, write_tables, write_book = empty_job.write, files.write_files, files.write_sheets
    if paper.is_wall:
        write_job = empty_job.write_wall
        write_tables, write_book = files.write_wall_files, files.write_wall_sheets
        outlook, sheets = wall_outlook, wall_sheets
    progress(WRITING_JOB)
    write_job(paper.prediction, folder / JOB, as_workbook)
    progress(WRITING_TABLES)
    write_tables(paper, folder, empty_job.fingerprints(folder / JOB))
    write_book(paper, folder / "field-sheets.xlsx")
    _typeset(paper, folder, progress, outlook(paper), sheets(paper))


def _typeset(paper, folder, progress, prediction, sheets):
    """Write the PDFs of a paper, and the figure of the changes."""
    from tankcal.report.pdf import pdf
    from tankcal.report.planning import figures

    progress(message("plan_setting_papers", "setting prediction and field sheets"))
    for name, blocks in (("prediction.pdf", prediction), ("field-sheets.pdf", sheets)):
        (folder / name).write_bytes(pdf([block.data for block in blocks], folder))
    if any(not effect.why for effect in paper.effects):
        figures.changes(paper).savefig(folder / "changes.png", dpi=150)


def refuse_foreign(directory):
    """Raise InputError if a folder contains anything but unchanged results of `write`."""
    directory = Path(directory)
    folders.refuse_foreign(directory, (*FILES, JOB, DESIGN))
    if (directory / DESIGN).exists():
        folders.refuse_foreign(directory / DESIGN, (*FILES, JOB))
    _refuse_filled(directory)


def _refuse_filled(directory):
    """Raise InputError if an empty job of a plan was completed."""
    from tankcal.report.planning import empty_job

    for folder in (Path(directory), Path(directory) / DESIGN):
        empty_job.refuse_filled(folder / JOB, folder / "plan.json")
