"""Files of `tankcal intercomparison score`: scores as data, web page and workbook.

All files are written from scores.json; no number is computed here.
"""

from pathlib import Path

from tankcal.messages import message
from tankcal.record import save
from tankcal.record.schema import to_plain
from tankcal.report import folders
from tankcal.report.scores.pages import FILE, PAGE, WORKBOOK, ScoresPaper

__all__ = ["FILES", "ScoresPaper", "refuse_foreign", "write_scores"]

FILES = (FILE, WORKBOOK, PAGE)


def refuse_foreign(folder):
    """Raise InputError if a folder exists and has other files than scores."""
    folders.refuse_foreign(folder, FILES)


def write_scores(scores, out, language=None, progress=None):
    """Write scores.json, the workbook and the page, all or none of them.

    Parameters
    ----------
    scores : record.intercomparison.ScoresFile or dict
        Scores, or their plain data.
    out : path
        Folder of the files. Earlier scores are replaced; a folder with other files is refused.
    language : str, optional
        Language of page and workbook, one of languages.LANGUAGES; None: English.
    progress : callable, optional
        Function that receives a line of text at the start of each step.

    Returns
    -------
    list of Path

    Raises
    ------
    InputError
        If the folder has other files, or if the data are no scores.
    """
    from tankcal.report.scores.pages import pages, write_sheets
    from tankcal.report.web import page

    refuse_foreign(out)
    progress = progress or (lambda text: None)
    plain = scores if isinstance(scores, dict) else to_plain(scores)
    paper = ScoresPaper(plain, language)
    with folders.replace_folder(out) as temporary:
        progress(message("ic_papers", "writing scores, page and workbook"))
        save(paper.saved, temporary / FILE)
        write_sheets(paper, temporary / WORKBOOK)
        blocks = [block.data for block in pages(paper)]
        (temporary / PAGE).write_text(page(blocks), encoding="utf-8")
    return [Path(out) / name for name in FILES]
