"""Document of a commissioning: gauge.json, CSV files, workbook and certificate.

Sketch of the three zeros for the certificate: dip plate, table and gauge.

The sketch is not to scale: the zeros are drawn in their order, at equal distances. Lengths on the
page are inches.
"""

from functools import partial
from typing import ClassVar

from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from tankcal.products.gauge.saved import GAUGE
from tankcal.report import blocks
from tankcal.report.plain import words_with_part
from tankcal.report.plots.style import GREY, INK, PALE, RED, WIDTH, styled
from tankcal.report.saved_document import SavedDocument, SavedPaper, bearable
from tankcal.report.tables import Column, Table
from tankcal.text.digits import format_with_u, shortest
from tankcal.text.shipped import DEFAULT
from tankcal.text.words import load_words

_SHOWN = {"sheet": True, "width": 12}
FILE, WORKBOOK, RECORD = "gauge.json", "gauge.xlsx", "record.json"
DIGEST = 12  # printed digits of a SHA-256
LONGEST_NUMBER = 60  # letters of the number of a certificate that fit into a line
_SPACE = "\N{NO-BREAK SPACE}"
_HEIGHT, _TOP = 1.7, 1.25  # of the page, and of the drawn roof
_LEFT, _RIGHT, _PIPE = 0.5, 2.6, 1.7  # walls of the tank, middle of the still pipe
_STEP = 0.24  # between two drawn zeros
_TEXT = 3.05  # left edge of the labels
_SMALL = 8
_COLOURS = {"dip_plate": INK, "table": GREY, "gauge": RED}


# ---- tables of a commissioning, declared once for certificate, workbook and CSV


def _mm(key, u, **more):
    """Column of millimetres with the digits of its U."""
    return Column(key, "image mm", u=u, csv=key, least=1, **_SHOWN, **more)


def _m(key, decimals=3):
    return Column(key, "m", decimals=decimals, csv=key, **_SHOWN)


def _k(on=None):
    return Column("k", decimals=2, csv="k", on=on, **_SHOWN)


LEVELS = Table(
    "gauge_levels",
    (
        Column("name", text=lambda paper, row: row["name"], csv="name", sheet=True, width=14),
        Column("count", decimals=0, csv="count", **_SHOWN),
        _m("dip_m", 4),
        _m("gauge_m", 4),
        _mm("deviation_mm", "U_mm"),
        _mm("U_mm", "U_mm"),
        _k(),
        _mm("residual_mm", "U_mm", on=""),
        Column("w", decimals=1, csv="w", **_SHOWN),
        Column("limit_mm", "image mm", decimals=1, csv="limit_mm", **_SHOWN),
        Column("probability", "share", decimals=0, csv="probability", **_SHOWN),
        Column("verdict", words="verdicts", csv="verdict", sheet=True, width=22),
    ),
    rows=lambda gauge: gauge["levels"],
)
CORRECTIONS = Table(
    "gauge_corrections",
    (
        _m("gauge_m"),
        _mm("correction_mm", "U_mm"),
        _mm("U_mm", "U_mm"),
        _k(on=""),
        _mm("table_correction_mm", "U_table_mm"),
        _mm("U_table_mm", "U_table_mm"),
        Column("is_outside", words="outside", csv="is_outside", sheet=True, width=14),
    ),
    rows=lambda gauge: gauge["corrections"],
)
ZEROS = Table(
    "gauge_zeros",
    (
        Column("code", words="zeros", csv="code", sheet=True, width=30),
        _mm("z_mm", "U_mm"),
        _mm("U_mm", "U_mm"),
        Column("source", words="zero_sources", csv="source", sheet=True, width=34),
    ),
    rows=lambda gauge: gauge["zeros"],
)
BUDGET = Table(
    "gauge_budget",
    (
        Column("source", words="sources", csv="source", sheet=True, width=34),
        Column("low_mm", "image mm", decimals=2, csv="low_mm", **_SHOWN),
        Column("middle_mm", "image mm", decimals=2, csv="middle_mm", **_SHOWN),
        Column("high_mm", "image mm", decimals=2, csv="high_mm", **_SHOWN),
        Column("dof", decimals=0, csv="dof", nothing="∞", **_SHOWN),
    ),
    rows=lambda gauge: gauge["budget"],
)
FILES = {"levels.csv": LEVELS, "corrections.csv": CORRECTIONS}

# ---- document of a commissioning: gauge.json, CSV files, workbook and certificate


class GaugePaper(SavedPaper):
    """Formatter of a `saved.GaugeFile` in a language.

    Parameters
    ----------
    gauge : dict
        Plain data; checked against its schema.
    language : str, optional
        One of languages.LANGUAGES; None: English.
    letterhead : letterhead.Letterhead, optional
        Letterhead of the laboratory.
    """

    kind, file = "gauge", FILE
    attached: ClassVar[dict] = {
        FILE: "gauge",
        WORKBOOK: "gauge_workbook",
        "corrections.csv": "gauge_corrections",
    }

    def __init__(self, gauge, language=None, letterhead=None):
        super().__init__(words_with_part(load_words(language or DEFAULT), "gauge"))
        self.saved = self.record = GAUGE.migrated(gauge, GAUGE.file)
        self.letterhead = letterhead.data() if letterhead else None

    def subject(self):
        """Name of the tank."""
        return bearable(f"{self.word('page.tank')} {self.record['tank']}")

    def date(self):
        """Day of the comparison."""
        return self.record["certificate"]["date"]

    def head(self, folder=None):
        """Document block and head of the first page, with the number of the certificate."""
        document, _ = super().head(folder)
        masthead = blocks.masthead(
            self.word("titles.gauge"),
            self.subject(),
            number_label=self.word("page.number"),
            number=self.certificate_number() or "",
        )
        return [document, masthead]

    def certificate_number(self):
        """Number of the certificate; shortened only beyond a line of the page, None if blank."""
        number = self.record["certificate"]["number"]
        return number if number is None or len(number) <= LONGEST_NUMBER else bearable(number)

    def text_with_u(self, value, U, unit="mm"):
        """A value with its U, such as "2.2 mm ± 1.9 mm"; None without a value."""
        if value is None:
            return None
        written = format_with_u(value, U, self.marks)
        return f"{written.value}{_SPACE}{unit} ± {written.uncertainty}{_SPACE}{unit}"

    def reference_height(self):
        """Reference height of the day of the comparison, with its U; None if not measured."""
        height = self.number(self.record["reference_height_m"], "m", 4)
        if height is None:
            return None
        U = self.number(self.record["U_reference_mm"], "image mm", u=self.record["U_reference_mm"])
        return f"{height} ± {U}"

    def decision(self):
        """Sentence of the decision; None without a limit."""
        decision = self.record["decision"]
        if decision is None:
            return None
        limits = [
            f"{shortest(value, self.marks)}{_SPACE}{unit}"
            for value, unit in (
                (decision["absolute_mm"], "mm"),
                (decision["relative_percent"], "%"),
            )
            if value is not None
        ]
        name = "limit_both" if len(limits) == 2 else "limit_one"
        return self.word(
            "texts.decision",
            verdict=self.words["verdicts"][decision["verdict"]],
            limit=self.word(f"texts.{name}", first=limits[0], second=limits[-1]),
            source=bearable(decision["source"]),
            rule=self.word(f"rules.{decision['rule']}"),
        )


def pages(paper, folder=None, whole=False):
    """Blocks of the certificate of a `GaugePaper`."""
    gauge = paper.record
    return [
        *paper.head(folder),
        paper.facts(_facts(paper)),
        _result(paper),
        *([] if gauge["decision"] is None else [blocks.paragraph(paper.decision())]),
        paper.show(_drop_blanks(LEVELS, gauge["levels"])),
        paper.facts(_line(paper)),
        blocks.paragraph(_slope_text(paper)),
        blocks.whole(paper.show(BUDGET)),
        paper.show(_drop_blanks(CORRECTIONS, gauge["corrections"]), across=2),
        paper.paragraph("corrections"),
        blocks.with_next(paper.heading("zeros")),
        blocks.with_next(paper.figure(sketch(paper), "gauge_sketch")),
        blocks.whole(paper.show(ZEROS)),
        *_head_of_liquid(paper),
        paper.heading("remarks"),
        blocks.listing(_remarks(paper)),
        blocks.with_next(_signature(paper)),  # never the end mark alone on a page
        blocks.end_mark(paper.word("texts.end")),
    ]


def _drop_blanks(table, rows):
    """Table without the columns that no row has."""
    known = {key for row in rows for key, value in row.items() if value not in (None, False)}
    return table.only(*known)


def _facts(paper):
    """Facts of the certificate, the gauge, the tape and the liquid."""
    gauge = paper.record
    certificate, instrument, tape = gauge["certificate"], gauge["gauge"], gauge["tape"]
    named = [instrument[key] for key in ("maker", "model") if instrument[key]]
    return [
        ("customer", certificate["customer"] and bearable(certificate["customer"])),
        ("place", certificate["place"] and bearable(certificate["place"])),
        ("date", paper.day(certificate["date"])),
        ("gauge", bearable(" ".join(named))),
        ("serial", instrument["serial"] and bearable(instrument["serial"])),
        ("principle", instrument["principle"] and bearable(instrument["principle"])),
        ("gauge_certificate", instrument["certificate"] and bearable(instrument["certificate"])),
        ("resolution", paper.plain(instrument["resolution_mm"], "mm")),
        ("supported_by", paper.word(f"supports.{instrument['supported_by']}")),
        ("range", paper.word("texts.range", low=paper.height(instrument["lowest_m"]),
                             high=paper.height(instrument["highest_m"]))),
        ("tape", bearable(", ".join(filter(None, (tape["serial"], tape["certificate"]))))),
        ("liquid", gauge["liquid"] and bearable(gauge["liquid"])),
        ("reference_height", paper.reference_height()),
        ("table_reference_height", paper.number(gauge["table_reference_height_m"], "m", 4)),
        ("note", certificate["note"] and bearable(certificate["note"])),
    ]  # fmt: skip


def _offset(paper):
    """(label, value) of the main result: the offset at the mean level."""
    line = paper.record["line"]
    return (
        paper.word("labels.offset_at", level=paper.height(round(line["mean_level_m"], 3))),
        paper.text_with_u(line["offset_mm"], line["U_offset_mm"]),
    )


def _result(paper):
    """Main result: the offset, with the slope below."""
    line = paper.record["line"]
    return blocks.result(
        *_offset(paper),
        paper.word(
            "texts.slope_note" if line["is_slope_estimated"] else "texts.slope_declared",
            slope=paper.text_with_u(line["slope_mm_per_m"], line["U_slope_mm_per_m"], "mm/m"),
            probability=paper.percent(paper.record["coverage_probability"]),
        ),
    )


def _line(paper):
    """Facts of the line: offset, slope, its parts, and the scatter."""
    line = paper.record["line"]
    zero = paper.record["zeros"][2]
    number = partial(paper.number, decimals=2)

    def with_u(key):
        return paper.text_with_u(line[key], line[f"U_{key}"], "mm/m")

    return [
        ("slope", with_u("slope_mm_per_m")),
        ("slope_of_pipe", with_u("pipe_mm_per_m")),
        ("slope_of_scale", with_u("scale_mm_per_m")),
        ("zero_of_gauge", paper.text_with_u(zero["z_mm"], zero["U_mm"])),
        ("k", paper.word("texts.k_of_line", offset=number(line["k_offset"]),
                         slope=number(line["k_slope"]))),
        ("sigma0", number(line["sigma0"])),
        ("dof", paper.number(line["dof"], decimals=0)),
    ]  # fmt: skip


def _slope_text(paper):
    """Sentence on scale and plumb, from the slope."""
    line = paper.record["line"]
    if not line["is_slope_estimated"]:
        return paper.word("texts.no_slope")
    angles = {
        name: paper.number(line[key], "deg", decimals=2)
        for name, key in (
            ("tilt", "tilt_deg"),
            ("low", "U_tilt_low_deg"),
            ("high", "U_tilt_high_deg"),
        )
    }
    return paper.word(f"texts.tilt_{line['tilt_is']}", **angles)


def _head_of_liquid(paper):
    """Movement of a gauge that the shell carries."""
    head = paper.record["head"]
    if head is None:
        return []
    return [
        paper.paragraph(
            "head_modelled" if head["is_modelled"] else "head_of_gauge",
            density=paper.number(head["density_kg_m3"], "kg/m3", decimals=1),
            top=paper.text_with_u(head["top_mm"], head["U_top_mm"]),
            start=paper.number(head["start_m"], "m", decimals=2),
            factor=paper.number(head["factor_mm_per_m"], decimals=4) + f"{_SPACE}mm/m",
            off=paper.number(head["off_mm"], "image mm", decimals=3),
        )
    ]


def _remarks(paper):
    """Texts of warnings, assumed uncertainties, standing statements and input files."""
    gauge = paper.record
    assumed = [
        paper.word("texts.u_of_input", name=paper.words["u_inputs"][item["name"]],
                   value=shortest(item["value"], paper.marks))
        for item in gauge["uncertainties"]
        if item["is_assumed"] and item["name"] in _inputs_in_results(gauge)
    ]  # fmt: skip
    texts = [paper.warning(warning) for warning in gauge["warnings"]]
    if assumed:
        texts.append(paper.word("texts.assumed", inputs="; ".join(assumed)))
    texts += paper.words["standing"].values()
    sources = [*gauge["files"]]
    if gauge["record"] is not None:
        sources.append({"file": RECORD, "sha256": gauge["record"]["sha256"]})
    files = ", ".join(f"{item['file']} {item['sha256'][:DIGEST]}" for item in sources)
    texts.append(paper.word("texts.inputs", files=bearable(files)))
    return texts


def _inputs_in_results(gauge):
    """Names of the standard uncertainties that entered a result."""
    used = {"u_dip_mm", "u_gauge_mm", "u_tape_zero_mm", "u_tape_ppm", "u_tape_temperature_k"}
    if gauge["reference_height_m"] is not None:
        used.add("u_reference_mm")
    if gauge["zeros"][1]["source"] == "reference_heights":
        used.add("u_table_reference_mm")
    if gauge["zeros"][1]["source"] == "levelled":
        used |= {"u_dip_plate_mm", "u_table_zero_mm"}
    if gauge["head"] is not None:
        used.add("u_movement_percent")
    return used


def _signature(paper):
    by = paper.record["certificate"]["by"]
    measured = paper.word("signatures.measured")
    labels = [f"{measured}: {bearable(by)}" if by else measured, paper.word("signatures.approved")]
    return blocks.signature(labels, paper.word("dcc.sign_here"))


def write_workbook(paper, path):
    """Write the workbook of a `GaugePaper`; equal data give equal bytes."""
    from tankcal.report.workbook.book import workbook_head
    from tankcal.report.workbook.sections import write_workbook as write

    gauge = paper.record
    head = workbook_head(
        gauge["tankcal"], tank=gauge["tank"], date=gauge["certificate"]["date"],
        notice=gauge["notice"],
        laboratory=paper.letterhead["name"] if paper.letterhead else "",
    )  # fmt: skip
    write(paper, path, "gauge", head, _sheets)


def _sheets(book):
    """Yield the content of each sheet, in order."""
    from tankcal.report.workbook.sections import Facts, Sentences, SheetContent, cell_table

    paper = book.paper
    number = [(paper.word("page.number"), paper.certificate_number())]
    facts, line = (
        [(paper.label(key), value) for key, value in pairs]
        for pairs in (_facts(paper), _line(paper))
    )
    lines = [(*pair, None) for pair in (*number, *facts, _offset(paper), *line) if pair[1]]
    decision = paper.decision()
    texts = [*([decision] if decision else []), _slope_text(paper)]
    parts = [
        Facts(lines),
        Sentences(texts),
        Sentences(_remarks(paper), title=paper.words["headings"]["remarks"]),
    ]
    yield SheetContent("gauge_result", parts, landscape=False, widths=(42, 58))
    for code, table in (
        ("gauge_corrections", CORRECTIONS),
        ("gauge_levels", LEVELS),
        ("gauge_zeros", ZEROS),
        ("gauge_budget", BUDGET),
    ):
        yield SheetContent(code, [cell_table(book, table)], tab="result")


DOCUMENT = SavedDocument(
    GAUGE,
    GaugePaper,
    lambda: (pages, write_workbook),
    tables=FILES,
    has_page=False,
    recomputed_by="tankcal.products.gauge.commissioning:compute_again",
)

# ---- sketch of the three zeros for the certificate: dip plate, table and gauge


@styled
def sketch(paper):
    """Draw tank, gauge, zeros and reference height (matplotlib Figure)."""
    gauge = paper.record
    figure = Figure(figsize=(WIDTH, _HEIGHT))
    ax = figure.add_axes((0, 0, 1, 1))
    ax.set(xlim=(0, WIDTH), ylim=(0, _HEIGHT), aspect="equal")
    ax.axis("off")
    ax.plot([_LEFT, _LEFT, _RIGHT, _RIGHT], [_TOP, 0.2, 0.2, _TOP], color=INK, linewidth=1.4)
    ax.plot([_LEFT, _RIGHT], [_TOP, _TOP], color=INK, linewidth=0.8)
    ax.add_patch(Rectangle((_LEFT, 0.2), _RIGHT - _LEFT, 0.75, color=PALE, alpha=0.35, linewidth=0))
    # Gauge on the roof; a still pipe down to the bottom, or ends above it.
    foot = 0.2 if gauge["gauge"]["supported_by"] == "bottom" else 0.9
    for side in (-0.06, 0.06):
        ax.plot([_PIPE + side] * 2, [foot, _TOP + 0.12], color=GREY, linewidth=0.8)
    ax.add_patch(Rectangle((_PIPE - 0.13, _TOP + 0.12), 0.26, 0.18, facecolor="white",
                           edgecolor=INK, linewidth=0.9))  # fmt: skip
    known = [zero for zero in gauge["zeros"][:3] if zero["z_mm"] is not None]
    # Height of each zero on the page, by its order; equal zeros are drawn apart.
    order = sorted(range(len(known)), key=lambda place: (known[place]["z_mm"], place))
    heights = [0.34 + _STEP * order.index(place) for place in range(len(known))]
    for zero, y in zip(known, heights, strict=True):
        colour = _COLOURS[zero["code"]]
        ax.plot([_LEFT + 0.1, _TEXT - 0.08], [y, y], color=colour, linewidth=1.0,
                linestyle="-" if zero["code"] == "dip_plate" else (0, (5, 2)))  # fmt: skip
        ax.text(_TEXT, y, _label(paper, zero), va="center", fontsize=_SMALL, color=colour)
    _draw_reference(ax, paper, heights[known.index(gauge["zeros"][0])])
    return figure


def _label(paper, zero):
    """Name of a zero with its z and U."""
    name = paper.words["zeros"][zero["code"]]
    if zero["code"] == "dip_plate":
        return f"{name}: z = 0"
    height = paper.text_with_u(zero["z_mm"], zero["U_mm"])
    return f"{name}: z = {height}"


def _draw_reference(ax, paper, y_plate):
    """Reference point on the roof, and the reference height above the dip plate."""
    zero = next((z for z in paper.record["zeros"] if z["code"] == "reference"), None)
    x = 0.85
    ax.add_patch(Rectangle((x - 0.07, _TOP), 0.14, 0.1, facecolor="white", edgecolor=INK,
                           linewidth=0.9))  # fmt: skip
    ax.plot([x - 0.16, x + 0.16], [y_plate, y_plate], color=INK, linewidth=2.2)
    if zero is None:
        return
    top = _TOP + 0.1
    ax.annotate("", (x, y_plate), (x, top), arrowprops={"arrowstyle": "<->", "color": GREY,
                "linewidth": 0.7, "shrinkA": 0, "shrinkB": 0})  # fmt: skip
    ax.plot([x + 0.07, _TEXT - 0.08], [top, top], color=GREY, linewidth=0.5)
    name, height = paper.words["zeros"]["reference"], paper.reference_height()
    text = f"{name}: H = {height}"
    ax.text(_TEXT, top, text, va="center", fontsize=_SMALL, color=GREY)
