"""What `tankcal intercomparison score` leaves behind: scores as data, as a page and as a workbook.

Nothing here computes a number: all of it is made from scores.json.
"""

from pathlib import Path

from tankcal.messages import message
from tankcal.record import save
from tankcal.record.schema import to_plain
from tankcal.report import folders
from tankcal.report.scores.paper import FILE, PAGE, WORKBOOK, ScoresPaper

__all__ = ["FILES", "ScoresPaper", "refuse_foreign", "write_scores"]

FILES = (FILE, WORKBOOK, PAGE)


def refuse_foreign(folder):
    """Raise InputError when a folder exists and holds anything but scores."""
    folders.refuse_foreign(folder, FILES)


def write_scores(found, out, language=None, progress=None):
    """Write scores.json, the workbook and the page, all or nothing.

    Parameters
    ----------
    found : record.intercomparison.ScoresFile or dict
        Scores, or the same as plain data.
    out : path
        Folder, made when missing; earlier scores there are replaced, and a folder that holds
        anything else is refused.
    language : str, optional
        Of the page and the workbook, one of languages.LANGUAGES; None: English.
    progress : callable, optional
        Called with a line of text as each step begins.

    Returns
    -------
    list of Path

    Raises
    ------
    InputError
        For a folder that is not tankcal's to replace, and what is no file of scores.
    """
    from tankcal.report.scores import workbook
    from tankcal.report.scores.pages import pages
    from tankcal.report.web import page

    refuse_foreign(out)
    progress = progress or (lambda text: None)
    plain = found if isinstance(found, dict) else to_plain(found)
    paper = ScoresPaper(plain, language)
    with folders.replaced(out) as temporary:
        progress(message("ic_papers", "writing scores, page and workbook"))
        save(paper.saved, temporary / FILE)
        workbook.write(paper, temporary / WORKBOOK)
        blocks = [block.data for block in pages(paper)]
        (temporary / PAGE).write_text(page(blocks), encoding="utf-8")
    return [Path(out) / name for name in FILES]
