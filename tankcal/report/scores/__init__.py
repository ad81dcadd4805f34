"""Files of `tankcal intercomparison score`: scores as data, web page and workbook.

All files are written from scores.json; no number is computed here.
"""

from math import ceil
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from tankcal.messages import message
from tankcal.record import save
from tankcal.record.intercomparison import SCORES
from tankcal.record.schema import to_plain
from tankcal.report import blocks, folders
from tankcal.report.camera.figures import COLOURS, line_style, styled
from tankcal.report.plain import words_with_part
from tankcal.report.plots.style import FAINT, GREY, WIDTH, set_margins
from tankcal.report.saved_document import SavedPaper, bearable, iso_day
from tankcal.report.tables import Column, Table
from tankcal.report.workbook.book import workbook_head
from tankcal.report.workbook.sections import SheetContent, cell_table, write_workbook
from tankcal.text.digits import NOTHING, fixed
from tankcal.text.shipped import DEFAULT
from tankcal.text.words import load_words

__all__ = ["FILES", "ScoresPaper", "refuse_foreign", "write_scores"]


_SHEET = {"sheet": True, "width": 11}
MOST_PANELS, ACROSS, PANEL_IN = 9, 3, 1.75  # largest number of panels, columns, height
MARKS = "osD^v<>PX*"  # of the methods in Youden's plot
FORMULAS = ("E_n", "zeta", "share", "form", "deliveries", "ranking")
FILE, WORKBOOK, PAGE = SCORES.file, "scores.xlsx", "scores.html"
EVERY = "*"  # replaces the method in scores of all methods


# ---- tables


def _ppm(key, **more):
    """Column of relative values, ppm."""
    return Column(key, "ppm", decimals=0, **_SHEET, **more)


def _percent(key):
    """Column of relative values, percent."""
    return Column(key, "percent", decimals=3, **_SHEET)


def _participant(**more):
    """Column of the participant."""
    return Column("participant", text=lambda paper, row: paper.participant(row), sheet=True,
                  width=26, **more)  # fmt: skip


def _method():
    """Column of the method."""
    return Column("method", heading="method_scored", sheet=True, width=20,
                  text=lambda paper, row: paper.method(row["method"]))  # fmt: skip


def _text_column(key, text_of):
    """Column of texts, which only the page has."""
    return Column(key, text=lambda paper, row: text_of(paper, row) or NOTHING, align="right")


def _tops(paper, row):
    """Number of top rows with |E_n| <= 1, and the bounds of its share; None without an E_n."""
    if not row["tops_judged"]:
        return None
    low, high = (fixed(row[key], 2, paper.marks) for key in ("tops_low", "tops_high"))
    return paper.word("texts.tops", good=row["tops_within"], count=row["tops_judged"], low=low,
                      high=high)  # fmt: skip


PARTICIPANTS = Table(
    "scored_participants",
    tuple(
        Column(key, text=lambda paper, row, key=key: bearable(row[key] or NOTHING), sheet=True,
               width=20, heading=f"participant_{key}")
        for key in ("name", "software", "version", "date", "contact", "remarks")
    ),
    rows=lambda scores: scores["participants"],
)  # fmt: skip

ERRORS = Table(
    "scored_errors",
    (
        _participant(),
        _method(),
        _text_column("tables_of", lambda paper, row: f"{row['tables']}/{row['asked']}"),
        _text_column(
            "bias", lambda paper, row: paper.with_sd(row["bias_ppm"], row["u_bias_ppm"], 0)
        ),
        _ppm("rms_top_ppm"),
        _ppm("rms_ppm"),
        _ppm("mean_U_ppm"),
        _text_column(
            "share", lambda paper, row: paper.with_sd(row["share_within"], row["u_share"], 2)
        ),
        _text_column("tops", _tops),
        Column("rms_zeta", decimals=2, **_SHEET),
    ),
    rows=lambda scores: scores["methods"],
)

FORMS = Table(
    "scored_forms",
    (
        _participant(),
        _method(),
        _ppm("form_ppm"),
        _percent("delivery_1cm_percent"),
        _percent("delivery_10cm_percent"),
        _ppm("delivery_2m_ppm"),
        Column("falling_rows", decimals=0, **_SHEET),
    ),
    rows=lambda scores: scores["methods"],
)

TABLES = Table(
    "scored_tables",
    (
        _participant(),
        Column("tank", heading="tank_scored", sheet=True, width=8),
        _method(),
        Column("missing", decimals=0, **_SHEET),
        _ppm("top_error_ppm"),
        Column("top_E_n", decimals=2, **_SHEET),
        _ppm("rms_ppm"),
        _text_column("rows_within", lambda paper, row: f"{row['within']}/{row['judged']}"),
        _ppm("mean_U_ppm"),
        Column("rms_zeta", decimals=2, **_SHEET),
        Column("zero_m3", "m3", decimals=4, **_SHEET),
        _ppm("scale_ppm"),
        _ppm("form_ppm"),
        _ppm("worst_2m_ppm"),
    ),
    rows=lambda scores: [{**table, **table["form"]} for table in scores["tables"]],
)

METHODS_SHEET = Table(
    "scored_methods",
    (
        _participant(),
        _method(),
        *(Column(key, decimals=0, **_SHEET) for key in ("tables", "asked")),
        *(_ppm(key) for key in ("bias_ppm", "u_bias_ppm", "rms_top_ppm", "rms_ppm", "mean_U_ppm")),
        *(Column(key, decimals=3, **_SHEET) for key in ("share_within", "u_share")),
        *(Column(key, decimals=0, **_SHEET) for key in ("tops_within", "tops_judged")),
        *(Column(key, decimals=3, **_SHEET) for key in ("tops_low", "tops_high")),
        Column("rms_zeta", decimals=2, **_SHEET),
        *FORMS.columns[2:],
    ),
    rows=lambda scores: scores["methods"],
)

ROWS = Table(
    "scored_rows",
    (
        _participant(),
        Column("tank", heading="tank_scored", sheet=True, width=8),
        _method(),
        Column("height_m", "m", height=True, heading="height_scored", **_SHEET),
        *(Column(key, "m3", decimals=4, **_SHEET) for key in ("true_m3", "error_m3", "U_m3")),
        *(Column(key, decimals=3, **_SHEET) for key in ("E_n", "zeta")),
    ),
    rows=lambda scores: [
        {**{key: table[key] for key in ("participant", "tank", "method")},
         **{key: values[i] for key, values in table["rows"].items()}}
        for table in scores["tables"]
        for i in range(len(table["rows"]["height_m"]))
    ],
)  # fmt: skip


# ---- page


def pages(paper):
    """List the blocks of a ScoresPaper."""
    return [
        *paper.head(),
        *_subject(paper),
        *_scores(paper),
        *_reading(paper),
        *_figures(paper),
        *[paper.heading("tables"), paper.show(TABLES, TABLES.rows(paper.record))],
        *_warnings(paper),
    ]


def _subject(paper):
    """Blocks on the tanks, methods and participants."""
    scores = paper.record
    tanks = {table["tank"] for table in scores["tables"]}
    methods = list_methods(scores)
    return [
        paper.heading("subject"),
        paper.paragraph(
            "subject", tanks=len(tanks), methods=len(methods), tables=len(scores["tables"])
        ),
        paper.paragraph("commitment", digest=scores["truth_sha256"]),
        paper.show(PARTICIPANTS, PARTICIPANTS.rows(scores)),
    ]


def _scores(paper):
    """Blocks with the scores of participants and methods."""
    scores = paper.record
    coverage = paper.percent(scores["coverage_probability"])
    return [
        paper.heading("scores"),
        paper.show(ERRORS, ERRORS.rows(scores), coverage=coverage),
        paper.show(FORMS, FORMS.rows(scores)),
    ]


def _reading(paper):
    """Blocks with the definitions of the scores."""
    sentences = [paper.word(f"reading.{name}") for name in FORMULAS]
    return [paper.heading("reading"), blocks.listing(sentences)]


def _figures(paper):
    """Blocks with a figure of errors for each method, and Youden's plot."""
    scores = paper.record
    page_blocks = [paper.heading("figures")]
    for method in list_methods(scores):
        name = paper.method(method)
        page_blocks.append(paper.figure(draw_errors(paper, method), "scored_lines", method=name))
    pair = select_two_tanks(scores)
    if pair:
        first, second = pair
        page_blocks.append(
            paper.figure(draw_youden(paper, *pair), "youden", width=0.75, first=first,
                         second=second)
        )  # fmt: skip
    return page_blocks


def _warnings(paper):
    """Blocks with the warnings about answers."""
    sentences = [paper.warning(warning) for warning in paper.record["warnings"]]
    return [paper.heading("warnings"), blocks.listing(sentences)] if sentences else []


# ---- figures


def list_methods(scores):
    """Methods with answers, in the order of the scores."""
    return list(dict.fromkeys(row["method"] for row in scores["methods"] if row["method"] != EVERY))


@styled
def draw_errors(paper, method):
    """Draw errors, ppm of the capacity, along the height: a panel for each tank."""
    scores = paper.record
    tables = [table for table in scores["tables"] if table["method"] == method]
    tanks = list(dict.fromkeys(table["tank"] for table in tables))[:MOST_PANELS]
    down = ceil(len(tanks) / ACROSS)
    across = min(len(tanks), ACROSS)
    figure = Figure(figsize=(WIDTH, PANEL_IN * down + 0.75))
    grid = figure.subplots(down, across, squeeze=False)
    for place, ax in enumerate(grid.ravel()):
        if place >= len(tanks):
            ax.axis("off")
            continue
        for table in tables:
            if table["tank"] == tanks[place]:
                _draw_line(ax, paper, table)
        ax.axhline(0, color=GREY, linewidth=0.6)
        ax.set_title(tanks[place], loc="left")
        if place % across == 0:
            ax.set_ylabel(paper.word("axes.error_ppm"))
        if place >= len(tanks) - across:
            ax.set_xlabel(paper.word("axes.height_scored"))
    set_margins(figure, 0.65, 0.1, 0.75, 0.25, wspace=0.3, hspace=0.45)
    # Draw a legend below all panels if there are several lines.
    lines, labels = grid[0, 0].get_legend_handles_labels()
    if len(labels) > 1:
        figure.legend(lines, labels, loc="lower center", ncols=min(3, len(labels)), fontsize=7)
    return figure


def _draw_line(ax, paper, table):
    """Draw the errors of a participant, with U as a band."""
    rows, style = table["rows"], line_style(table["participant"])
    full = rows["true_m3"][-1] / 1e6
    height, error = np.array(rows["height_m"]), np.array(rows["error_m3"]) / full
    U = np.array([np.nan if x is None else x for x in rows["U_m3"]], float) / full
    ax.fill_between(height, error - U, error + U, color=style["color"], alpha=0.15, linewidth=0)
    ax.plot(height, error, linewidth=1.0, label=paper.participant(table), **style)


@styled
def draw_youden(paper, first, second):
    """Draw errors at the top of two tanks; common errors of both lie on the diagonal."""
    scores = paper.record
    tops = {
        (row["participant"], row["method"], row["tank"]): row["top_error_ppm"]
        for row in scores["tables"]
        if row["top_error_ppm"] is not None
    }
    figure = Figure(figsize=(4.6, 3.6))
    ax = figure.subplots()
    methods, sizes = list_methods(scores), [1.0]
    for who in range(len(scores["participants"])):
        for number, method in enumerate(methods):
            pair = [tops.get((who, method, tank)) for tank in (first, second)]
            if None in pair:
                continue
            sizes += map(abs, pair)
            label = paper.method(method)
            if len(scores["participants"]) > 1:
                label = f"{paper.participant({'participant': who})}, {label}"
            ax.plot(*pair, MARKS[number % len(MARKS)], color=COLOURS[who % len(COLOURS)],
                    markersize=5, label=label, linestyle="")  # fmt: skip
    reach = 1.15 * max(sizes)
    ax.plot([-reach, reach], [-reach, reach], color=FAINT, linewidth=0.6)
    ax.axhline(0, color=GREY, linewidth=0.6)
    ax.axvline(0, color=GREY, linewidth=0.6)
    ax.set(xlim=(-reach, reach), ylim=(-reach, reach), aspect="equal")
    ax.set_xlabel(paper.word("axes.error_of", tank=first))
    ax.set_ylabel(paper.word("axes.error_of", tank=second))
    set_margins(figure, 0.65, 1.7, 0.55, 0.1)
    ax.legend(loc="center left", bbox_to_anchor=(1.02, 0.5), fontsize=7)
    return figure


def select_two_tanks(scores):
    """Select the two tanks with the most common answers; None without common answers.

    Of equal pairs, the first is selected.
    """
    answered = {}
    for row in scores["tables"]:
        if row["top_error_ppm"] is not None:
            answered.setdefault(row["tank"], set()).add((row["participant"], row["method"]))
    names = sorted(answered)
    pairs = [(len(answered[a] & answered[b]), -i, -j, a, b) for i, a in enumerate(names)
             for j, b in enumerate(names) if i < j]  # fmt: skip
    best = max(pairs, default=None)
    return best[3:] if best and best[0] > 0 else None


# ---- workbook


def write_sheets(paper, path):
    """Write the workbook of a ScoresPaper; equal scores give equal bytes."""
    scores = paper.record
    head = workbook_head(
        scores["tankcal"], source=paper.subject(), date=paper.date(), notice=scores["notice"]
    )
    write_workbook(paper, path, "scores", head, _sheets)


def _sheets(book):
    """Yield a sheet for each table, in order."""
    for code, table in (
        ("scored_methods", METHODS_SHEET),
        ("scored_tables", TABLES),
        ("scored_rows", ROWS),
        ("scored_participants", PARTICIPANTS),
    ):
        yield SheetContent(code, [cell_table(book, table)], tab="result", is_filtered=True)


# ---- texts of scores in a language


class ScoresPaper(SavedPaper):
    """A `record.intercomparison.ScoresFile` as plain data, with the words of a language.

    Parameters
    ----------
    scores : dict
        Plain data; checked against its schema.
    language : str, optional
        One of languages.LANGUAGES; None: English.
    """

    kind, file = "scores", FILE
    letterhead = None

    def __init__(self, scores, language=None):
        super().__init__(words_with_part(load_words(language or DEFAULT), "scores"))
        self.saved = SCORES.migrated(scores, SCORES.file)
        self.record = {**self.saved, "notice": ""}

    def subject(self):
        """Name of the package: the first digits of the SHA-256 of its truth."""
        return self.word("texts.package", digest=self.record["truth_sha256"][:12])

    def date(self):
        """Latest date of the answers, ISO; "" without a date."""
        return max(
            (iso_day(participant["date"]) for participant in self.record["participants"]),
            default="",
        )

    def participant(self, row):
        """Name of a participant with the version; its number is added to equal names."""
        names = [
            f"{entry['name']} {entry['version']}" if entry["name"] == entry["software"] else
            f"{entry['name']} ({entry['software']} {entry['version']})"
            for entry in self.record["participants"]
        ]  # fmt: skip
        name = names[row["participant"]]
        if names.count(name) > 1:
            name = f"{name} [{row['participant'] + 1}]"
        return bearable(name)

    def method(self, code):
        """Name of a method; a method of another package keeps its code."""
        return self.words["methods_scored"].get("all" if code == EVERY else code, code)

    def with_sd(self, value, sd, decimals):
        """Value with its standard deviation, "12 ± 3"; None for None."""
        if value is None:
            return None
        text = fixed(value, decimals, self.marks)
        return text if sd is None else f"{text} ± {fixed(sd, decimals, self.marks)}"


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
