"""Document of an upkeep: upkeep.json, CSV files, workbook and report."""

from typing import ClassVar

from tankcal.products.upkeep.saved import UPKEEP
from tankcal.report import blocks
from tankcal.report.plain import words_with_part
from tankcal.report.saved_document import SavedDocument, SavedPaper, bearable
from tankcal.report.tables import Column, Table
from tankcal.text.digits import format_with_u, shortest
from tankcal.text.shipped import DEFAULT
from tankcal.text.words import load_words

_SHOWN = {"sheet": True, "width": 12}
_SPACE = "\N{NO-BREAK SPACE}"
FILE, WORKBOOK = "upkeep.json", "upkeep.xlsx"
DIGEST = 12  # printed digits of a SHA-256
ROWS_SHOWN = 24  # rows of the table in the report
LABELS_SHOWN = 7  # months named below the figure
SIZE_NAMES = ("diameter", "length", "end_depth", "tilt", "zero")  # of a tank without calibration
SMALLEST_W = 2.5  # |w| of a printed suspect, unless it is possible


def _number(name, u=None, unit="", **more):
    """Column of numbers with the digits of an uncertainty."""
    return Column(name, unit, u=u, csv=name, least=1, **_SHOWN, **more)


def _plain(name, decimals, unit="", **more):
    return Column(name, unit, decimals=decimals, csv=name, **_SHOWN, **more)


def _hour(name):
    """Column of times to the hour."""
    return Column(name, text=lambda paper, row: row[name] and f"{row[name].replace('T', ' ')} h",
                  csv=name, sheet=True, width=16)  # fmt: skip


def _digest(name):
    """Column of a SHA-256, of which reports print the first digits."""
    return Column(name, text=lambda paper, row: row[name][:DIGEST], csv=name, sheet=True,
                  width=66, in_sheet={"text": lambda paper, row: row[name]})  # fmt: skip


def _text(name, width=18, **more):
    return Column(name, text=lambda paper, row: bearable(str(row[name] or "")), csv=name,
                  sheet=True, width=width, **more)  # fmt: skip


def _name_cause(paper, row):
    """Name of a cause, such as "meter 1" or "gauge_bend_sin_2"."""
    names, name = paper.words["causes"], row["name"]
    if name in names:
        return names[name]
    kind, _, member = name.partition(" ") if " " in name else name.rpartition("_")
    return bearable(f"{names[kind]} {member}")


ROWS = Table(
    "upkeep_rows",
    (
        _plain("height_m", 3, "m"),
        _number("former_m3", "former_U_m3", "m3"),
        _number("former_U_m3", "former_U_m3", "m3"),
        _number("volume_m3", "U_m3", "m3"),
        _number("U_m3", "U_m3", "m3"),
        _plain("En", 2),
        Column("is_seen", words="seen", csv="is_seen", sheet=True, width=20),
    ),
    rows=lambda upkeep: upkeep["rows"],
)
DELIVERIES = Table(
    "upkeep_deliveries",
    (
        _plain("low_m", 3, "m"),
        _plain("high_m", 3, "m"),
        _number("former_m3", "former_U_m3", "m3"),
        _number("former_U_m3", "former_U_m3", "m3"),
        _number("volume_m3", "U_m3", "m3"),
        _number("U_m3", "U_m3", "m3"),
    ),
    rows=lambda upkeep: upkeep["deliveries"],
)
METERS = Table(
    "upkeep_meters",
    (
        _text("name", 12),
        _plain("volume_m3", 1, "m3"),
        Column("certificate", text=lambda paper, row: bearable(
            row["certificate"] or paper.word("texts.untraceable")),
            csv="certificate", sheet=True, width=16),
        _number("prior_percent", "prior_percent"),
        _number("deviation_percent", "U_percent"),
        _number("U_percent", "U_percent"),
        _plain("correlation", 2),
    ),
    rows=lambda upkeep: upkeep["meters"],
)  # fmt: skip
MONTHS = Table(
    "upkeep_months",
    (
        _text("month", 10),
        _plain("steps", 0),
        _number("leak_l_h", "U_l_h"),
        _number("U_l_h", "U_l_h"),
        _number("detectable_l_h", "U_l_h"),
        Column("verdict", words="verdicts", csv="verdict", sheet=True, width=14),
        _number("throughput_percent", "U_percent"),
        _number("U_percent", "U_percent"),
    ),
    rows=lambda upkeep: upkeep["months"],
)
SUSPECTS = Table(
    "upkeep_suspects",
    (
        Column("kind", words="kinds", csv="kind", sheet=True, width=36),
        _text("member", 10),
        _text("day", 12),
        _number("size", "sd"),
        _number("sd", "sd"),
        _text("unit", 8),
        _plain("w", 1),
        Column("is_possible", words="possible", csv="is_possible", sheet=True, width=12),
    ),
    rows=lambda upkeep: [
        row for row in upkeep["watch"]["suspects"]
        if row["is_possible"] or abs(row["w"]) > SMALLEST_W
    ],
)  # fmt: skip
CLEANING = Table(
    "upkeep_cleaning",
    (
        Column("log", words="logs", csv="log", sheet=True, width=14),
        Column("kind", words="findings", csv="kind", sheet=True, width=44),
        _plain("count", 0),
        _hour("first"),
        _hour("last"),
    ),
    rows=lambda upkeep: [row for row in (*upkeep["cleaning"], *upkeep["left_out"]) if row["count"]],
)
INPUTS = Table(
    "upkeep_inputs",
    (
        Column("kind", words="logs", heading="log", csv="kind", sheet=True, width=14),
        _text("file", 26),
        _plain("rows", 0),
        _hour("first"),
        _hour("last"),
        _digest("sha256"),
        _digest("chain"),
    ),
    rows=lambda upkeep: upkeep["files"],
)
SIZES = Table(
    "upkeep_sizes",
    (
        _plain("solution", 0),
        _plain("chi2", 1),
        Column("name", words="sizes", csv="name", sheet=True, width=22),
        _text("unit", 8),
        _plain("mean", 1),
        _plain("prior_u", 1),
        _number("estimate", "u"),
        _number("u", "u"),
        *(_plain(f"r_{name}", 2) for name in SIZE_NAMES),
    ),
    rows=lambda upkeep: [
        size | {"solution": number, "chi2": solution["chi2"]}
        | {f"r_{name}": None for name in SIZE_NAMES}
        | {f"r_{other['name']}": r for other, r in zip(solution["sizes"], values, strict=True)}
        for number, solution in enumerate(upkeep["start"]["solutions"], 1)
        for size, values in zip(solution["sizes"], solution["correlation"], strict=True)
    ],
)  # fmt: skip
CAUSES = Table(
    "upkeep_causes",
    (
        Column("name", text=_name_cause, csv="name", sheet=True, width=44),
        _text("unit", 8),
        _number("mean", "prior_u"),
        _number("prior_u", "prior_u"),
        _number("estimate", "u"),
        _number("u", "u"),
    ),
    rows=lambda upkeep: upkeep["causes"],
)
STEPS = Table(
    "upkeep_steps",
    (
        _text("first", 20),
        _text("last", 20),
        Column("kind", words="step_kinds", csv="kind", sheet=True, width=12),
        *(_number(name, "u_m3", "m3") for name in (
            "by_table_m3", "by_meters_m3", "by_tickets_m3", "losses_m3", "misclosure_m3", "u_m3")),
        _plain("w", 1),
        Column("left_out", words="findings", csv="left_out", sheet=True, width=34),
    ),
    rows=lambda upkeep: upkeep.get("steps") or [],
)  # fmt: skip
FILES = {
    "table.csv": ROWS, "deliveries.csv": DELIVERIES, "meters.csv": METERS, "months.csv": MONTHS,
    "alarms.csv": SUSPECTS, "cleaning.csv": CLEANING, "causes.csv": CAUSES,
    "sizes.csv": SIZES, "inputs.csv": INPUTS, "steps.csv": STEPS,
}  # fmt: skip


class UpkeepPaper(SavedPaper):
    """Formatter of a `saved.UpkeepFile` in a language.

    Parameters
    ----------
    upkeep : dict
        Plain data; checked against its schema.
    language : str, optional
        A value of languages.LANGUAGES; None: English.
    letterhead : letterhead.Letterhead, optional
        Letterhead of the laboratory.
    """

    kind, file = "upkeep", FILE
    attached: ClassVar[dict] = {FILE: "upkeep", WORKBOOK: "upkeep_workbook"}

    def __init__(self, upkeep, language=None, letterhead=None):
        super().__init__(words_with_part(load_words(language or DEFAULT), "upkeep"))
        self.saved = self.record = UPKEEP.migrated(upkeep, UPKEEP.file)
        self.letterhead = letterhead.data() if letterhead else None

    def subject(self):
        """Name of the tank."""
        return bearable(f"{self.word('page.tank')} {self.record['tank']}")

    def date(self):
        """Last day of the logs."""
        return self.record["period"]["last"]

    def with_u(self, value, U, unit):
        """A value with its U and unit."""
        written = format_with_u(value, U, self.marks)
        return f"{written.value}{_SPACE}{unit} ± {written.uncertainty}{_SPACE}{unit}"

    def result(self):
        """Sentence of the main result: the delivery over the levels of the steps."""
        last, code = self.record["deliveries"][-1], self.record["mode"]
        if self.record["start"]["kind"] == "sales":
            code = {"deliveries": "sales", "watched": "drawing"}[code]
        return self.word(
            f"texts.result_{code}",
            low=self.height(round(last["low_m"], 3)), high=self.height(round(last["high_m"], 3)),
            volume=self.with_u(last["volume_m3"], last["U_m3"], "m³"),
            former=self.with_u(last["former_m3"], last["former_U_m3"], "m³"),
            steps=self.record["period"]["used"],
        )  # fmt: skip

    def reasons(self):
        """Sentences on undetermined or unstated results, and on the number of solutions."""
        solutions = self.record["start"]["solutions"]
        count, r = len(solutions), ""
        if count:  # of tilt and zero, the last two sizes
            r = self.number(solutions[0]["correlation"][-1][-2], decimals=2)
        texts = [self.word(f"reasons.{reason}", r=r) for reason in self.record["reasons"]]
        return texts + ([self.word("texts.solutions", count=count)] if count > 1 else [])

    def alarm(self):
        """Sentence of the watching."""
        watch = self.record["watch"]
        numbers = {
            "largest": self.number(watch["largest"], decimals=1),
            "limit": self.number(watch["limit"], decimals=1),
            "rate": shortest(watch["rate_per_year"], self.marks),
        }
        if watch["alarm"] is None:
            text = self.word("texts.no_alarm", **numbers)
        else:
            possible = [row for row in watch["suspects"] if row["is_possible"]]
            names = ", ".join(dict.fromkeys(
                self.words["kinds"][row["kind"]]
                + (f" {bearable(row['member'])}" if row["member"] else "")
                for row in possible))  # fmt: skip
            code = "alarm_named" if watch["is_named"] else "alarm_open"
            text = self.word(f"texts.{code}", day=self.day(watch["alarm"]), names=names, **numbers)
            declared = {"meter": "declare_meter", "zero": "declare_zero"}
            hints = [self.word(f"texts.{hint}") for kind, hint in declared.items()
                     if any(row["kind"] == kind for row in possible)]  # fmt: skip
            text = " ".join([text, *hints])
        if watch["is_provisional"]:
            text = f"{text} {self.word('texts.provisional')}"
        return text


def pages(paper, folder=None, whole=False):
    """Blocks of the report of an `UpkeepPaper`."""
    upkeep = paper.record
    return [
        *paper.head(folder),
        paper.facts(_facts(paper)),
        blocks.paragraph(paper.result()),
        *([blocks.listing(paper.reasons())] if paper.reasons() else []),
        blocks.paragraph(paper.alarm()),
        paper.show(DELIVERIES),
        blocks.whole(paper.show(METERS)),
        paper.paragraph("throughput"),
        paper.figure(plot_months(paper), "upkeep_leak"),
        paper.show(MONTHS),
        *([paper.show(SUSPECTS)] if SUSPECTS.rows(upkeep) else []),
        *([paper.show(SIZES)] if SIZES.rows(upkeep) else []),
        *([_table(paper)] if upkeep["rows"] else []),
        paper.show(CLEANING),
        paper.heading("remarks"),
        blocks.listing(_remarks(paper)),
        paper.show(INPUTS),
    ]


def summary_blocks(paper):
    """Blocks of the main results: estimate, alarm, months, meters, rows read and left out."""
    upkeep = paper.record
    return [
        blocks.paragraph(paper.result()),
        *([blocks.listing(paper.reasons())] if paper.reasons() else []),
        blocks.paragraph(paper.alarm()),
        *[paper.show(table) for table in (SUSPECTS, MONTHS, DELIVERIES, METERS, CLEANING)
          if table.rows(upkeep)],
        blocks.listing(_remarks(paper)),
        paper.show(INPUTS),
    ]  # fmt: skip


def _table(paper):
    """Table of the report: every n-th row."""
    rows = paper.record["rows"]
    return paper.show(ROWS, rows[:: max(len(rows) // ROWS_SHOWN, 1)])


def _facts(paper):
    """Facts of the upkeep."""
    upkeep = paper.record
    period = upkeep["period"]
    return [
        ("site", upkeep["site"] and bearable(upkeep["site"])),
        ("by", upkeep["by"] and bearable(upkeep["by"])),
        ("period", paper.word("texts.span", first=paper.day(period["first"]),
                              last=paper.day(period["last"]))),
        ("liquid", upkeep["liquid"] and bearable(upkeep["liquid"])),
        ("steps", paper.word("texts.steps", used=period["used"], steps=period["steps"],
                             rejected=period["rejected"])),
        ("range", paper.word("texts.range", low=paper.height(round(period["lowest_m"], 3)),
                             high=paper.height(round(period["highest_m"], 3)))),
        ("sold", paper.number(period["sold_m3"], "m3", decimals=1)),
        ("delivered", paper.number(period["delivered_m3"], "m3", decimals=1)),
        ("chi2", paper.word("texts.chi2", dof=upkeep["fit"]["dof"],
                            chi_square=paper.number(upkeep["fit"]["chi2"], decimals=0))),
        ("coverage", paper.word("texts.coverage", k=paper.number(upkeep["k"], decimals=2),
                                probability=paper.percent(upkeep["coverage_probability"]))),
        ("note", upkeep["note"] and bearable(upkeep["note"])),
    ]  # fmt: skip


def _remarks(paper):
    """Warnings and standing statements."""
    upkeep = paper.record
    texts = [paper.warning(warning) for warning in upkeep["warnings"]]
    texts += paper.words["standing"].values()
    texts.append(paper.word("texts.single_steps", count=len(upkeep["steps"]))
                 if upkeep.get("steps") else paper.word("texts.privacy"))  # fmt: skip
    return texts


def plot_months(paper):
    """Draw the leak rate of each month with U (matplotlib Figure)."""
    # A month without papers loads no plots.
    from matplotlib.figure import Figure

    from tankcal.report.plots.style import GREY, INK, RED, WIDTH, styled

    @styled
    def draw():
        figure = Figure(figsize=(WIDTH, 1.9))
        ax, months = figure.add_subplot(), paper.record["months"]
        for place, month in enumerate(months):
            colour = RED if month["verdict"] == "fail" else INK
            ax.errorbar(place, month["leak_l_h"], yerr=month["U_l_h"], color=colour, marker="o",
                        markersize=3, capsize=2, linewidth=0.9)  # fmt: skip
        ax.axhline(0, color=GREY, linewidth=0.7)
        step = -(-len(months) // LABELS_SHOWN)
        places = range(0, len(months), step)
        ax.set_xticks(list(places), [months[place]["month"] for place in places])
        ax.set_ylabel(paper.word("texts.leak_axis"))
        return figure

    return draw()


def write_workbook(paper, path):
    """Write the workbook of an `UpkeepPaper`; equal data give equal bytes."""
    from tankcal.report.workbook.book import workbook_head
    from tankcal.report.workbook.sections import write_workbook as write

    upkeep = paper.record
    head = workbook_head(
        upkeep["tankcal"], tank=upkeep["tank"], date=paper.date(), notice=upkeep["notice"],
        laboratory=paper.letterhead["name"] if paper.letterhead else "",
    )  # fmt: skip
    write(paper, path, "upkeep", head, _sheets)


def _sheets(book):
    """Yield the content of each sheet, in order."""
    from tankcal.report.workbook.sections import Facts, Sentences, SheetContent, cell_table

    paper = book.paper
    facts = [(paper.label(key), value, None) for key, value in _facts(paper) if value]
    parts = [
        Facts(facts),
        Sentences(
            [paper.result(), *paper.reasons(), paper.alarm(), paper.word("texts.throughput")]
        ),
        Sentences(_remarks(paper), title=paper.words["headings"]["remarks"]),
    ]
    yield SheetContent("upkeep_result", parts, landscape=False, widths=(42, 58))
    for table in (ROWS, DELIVERIES, METERS, MONTHS, SUSPECTS, CLEANING, CAUSES, SIZES, INPUTS,
                  STEPS):  # fmt: skip
        if table.rows(paper.record):
            yield SheetContent(table.name, [cell_table(book, table)], tab="result")


DOCUMENT = SavedDocument(
    UPKEEP,
    UpkeepPaper,
    lambda: (pages, write_workbook),
    tables=FILES,
    has_page=False,
    recomputed_by="tankcal.products.upkeep.upkeep:compute_again",
)
