"""Documents of a plan of targets: the prediction and the field sheets."""

from math import ceil

import numpy as np

import tankcal
from tankcal.messages import as_plain
from tankcal.planning.improvements import IMAGES, OF_COURSE, ROW, cost_of
from tankcal.planning.measurements import BLUNDER_SDS
from tankcal.planning.places import group_by_ends
from tankcal.record.schema import to_plain
from tankcal.report import blocks
from tankcal.report.numbers import unit
from tankcal.report.plain import Column, PlainPaper, words_with_part
from tankcal.report.planning import figures
from tankcal.report.planning.figures import stands
from tankcal.report.planning.rows import field_tables, find_by_name, lost_ties, place_of_change
from tankcal.text.digits import format_with_u
from tankcal.text.shipped import DEFAULT
from tankcal.text.words import group_name, load_words, message_sentence, name_of_input
from tankcal.uncertainty import combine

DESIGN = "design"  # folder of the documents of the smallest design


class PlanPaper(PlainPaper):
    """A Prediction with the words of a language.

    Words are looked up in the part of a group under `planning` first, then in the group itself.

    Parameters
    ----------
    prediction : Prediction
    language : str, optional
        One of languages.LANGUAGES; None: that of the plan.
    effects : sequence of Effect, optional
        Effects of all evaluated changes.
    design : Path, optional
        Search for the smallest design.
    simulated : Simulated, optional
        Simulated surveys.
    """

    is_wall = False

    def __init__(self, prediction, language=None, effects=(), design=None, simulated=None):
        self.prediction, self.plan = prediction, prediction.plan
        self.effects, self.design, self.simulated = effects, design, simulated
        words = load_words(language or self.plan.job.table.language or DEFAULT)
        super().__init__(words_with_part(words, "planning"))

    def subject(self):
        """Subject of the documents: the tank."""
        return f"{self.word('page.tank')} {self.plan.job.tank.id}"

    def day(self, iso=None):
        """Format a date in the language; None: the planned date of the survey."""
        return super().day(iso or self.plan.job.survey.date)

    def head(self, part):
        """Return the blocks at the start of the document `part`."""
        title = self.word(f"titles.{part}")
        return [
            blocks.document(
                title=f"{title}, {self.subject()}",
                date=str(self.plan.job.survey.date or ""),
                language=self.words["language"]["code"],
                running=[title, self.subject()],
                footer=f"{self.words['page']['footer']} · tankcal {tankcal.__version__}",
            ),
            blocks.masthead(title, self.subject()),
        ]

    @property
    def fewest_rays(self):
        """Fewest rays of a target that is not weak; 0 with set-ups, as one set-up is enough."""
        return 0 if self.plan.setups else self.plan.limits.rays

    def three_digits(self, share):
        """Format a share in percent with three digits."""
        return self.number(float(share), "share", digits=3)

    def count(self, number):
        """Format a number of items; 0 returns None."""
        return self.number(number, decimals=0) if number else None

    def translate(self, text):
        """Return a Message of the program in the language."""
        plain = to_plain(as_plain(text))
        return message_sentence(self.words, str(text), plain["code"], plain["values"])

    def describe_change(self, change):
        """Return a `planning.changes.Change` in words."""
        prefix = OF_COURSE if change.name.startswith(OF_COURSE) else ROW
        name = change.name.removeprefix(prefix)
        if change.item == "reading":
            return self.word("changes.repeat_images" if name == IMAGES else "changes.repeat_sets")
        if change.item != "tape":
            return self.word(f"changes.{change.action}_{change.item}", name=name)
        tie = find_by_name((*change.plan.ties, *self.plan.ties), name)
        if change.action != "add":
            # A tape that a search adds and later drops is in neither plan.
            table = "distances" if tie is None else tie.table
            return self.word(f"changes.{change.action}_{table}", name=name)
        rise = change.plan.points[tie.end] - change.plan.points[tie.start]
        length = self.number(float(np.linalg.norm(rise)), "m", decimals=1)
        kind = "upright" if abs(rise[2]) > np.hypot(rise[0], rise[1]) else "level"
        return self.word(f"changes.add_tape_{kind}", name=name, length=length)

    def warnings(self, problems):
        """Return the blocks of warnings (errors.Problem), each with its place in the plan."""
        if not problems:
            return []
        texts = [f"{_place(problem)}{self.translate(problem.expected)}" for problem in problems]
        return [self.heading("warnings"), blocks.listing(texts)]


def _place(problem):
    """Return file and column of a problem in a file, as a prefix of its text."""
    if "." not in problem.file:
        return ""
    return f"{problem.file}{f', {problem.column}' if problem.column else ''}: "


SHORT = 12  # rows; shorter tables are not set in groups side by side


def sheets(paper):
    """Return the blocks of the field sheets of a PlanPaper."""
    tables = field_tables(paper.prediction)
    return [
        *paper.head("field_sheets"),
        *_overview(paper, tables),
        *_marks(paper, tables),
        *_stands(paper, tables),
        *_readings(paper, tables),
        *_equipment(paper, tables),
        blocks.signature([paper.word(f"signatures.{name}") for name in ("marked", "surveyed")]),
    ]


def _overview(paper, tables):
    plan = paper.plan
    exposures = sum(photo.readings for photo in plan.photos)
    counts = {
        "targets": len(plan.targets.names),
        "unseen_targets": count_unseen_targets(paper.prediction),
        "rows_and_lines": f"{len(tables['levels'][0])} × {len(tables['lines'][0])}",
        "photo_stations": len(plan.stations),
        "photographs": len(plan.photos),
        "repeated_readings": exposures if exposures > len(plan.photos) else 0,
        "setups": len(plan.setups),
        "tapes": len(plan.ties),
        "lost_ties": len(lost_ties(paper.prediction)),
        "bases": len(group_by_ends(plan.bases)),
        "control_points": len(plan.known),
    }
    shown = [
        (key, value if isinstance(value, str) else paper.number(value, decimals=0))
        for key, value in counts.items()
        if value
    ]
    side = paper.words["sides"][plan.job.survey.side]
    items = [("planned_for", paper.day()), ("side", side), *shown]
    return [paper.facts(items), *paper.warnings(plan.warnings)]


def count_unseen_targets(prediction):
    """Number of targets that the planned survey does not determine."""
    targets = prediction.points[: len(prediction.plan.targets.names)]
    return sum(bool(target.undetermined) for target in targets)


def _marks(paper, tables):
    unseen = [paper.paragraph("unseen")] if paper.prediction.undetermined else []
    marks = [
        paper.heading("marks"),
        paper.paragraph("how_arcs_count"),
        paper.paragraph("marks"),
        *unseen,
        paper.figure(figures.wall(paper), "wall"),
        paper.table("levels", *tables["levels"]),
        _side_by_side(paper.table("lines", *tables["lines"]), 4),
        paper.table("targets", *tables["targets"], across=2),
    ]
    return marks + [_side_by_side(table, 2) for table in _optional(paper, tables, "others")]


def _side_by_side(table, across):
    """Return a table (Block), with its rows in `across` groups side by side if it is long."""
    data, high = table.data, ceil(len(table.data["rows"]) / across)
    if len(data["rows"]) < SHORT:
        return table
    # Fill the last group, so that all groups have the same number of rows.
    rows = data["rows"] + [[""] * len(data["columns"])] * (across * high - len(data["rows"]))
    wide = [[cell for row in rows[i::high] for cell in row] for i in range(high)]
    more = {key: data[key] * across for key in ("columns", "align")}
    return blocks.Block(data | more | {"rows": wide})


def _optional(paper, tables, *names):
    return [paper.table(name, *tables[name]) for name in names if name in tables]


def _stands(paper, tables):
    positions = [paper.heading("stands"), paper.figure(stands(paper), "stands")]
    if "stations" in tables:
        positions += [
            paper.paragraph("stations"),
            paper.table("stations", *tables["stations"]),
            paper.table("photographs", *tables["photographs"]),
        ]
    return positions + _optional(paper, tables, "setups")


def _readings(paper, tables):
    """Return the blocks of ties, bases and control, each heading directly above its table.

    A page never ends between a heading and its table.
    """
    readings = []
    if "ties" in tables:
        readings += [paper.heading("ties"), paper.table("ties", *tables["ties"])]
        readings.append(paper.paragraph("ties"))
        if any(tie.table == "plumb_lines" for tie in paper.plan.ties):
            readings.append(paper.paragraph("plumb_lines"))
    if "bases" in tables:
        readings += [paper.heading("bases"), paper.table("bases", *tables["bases"])]
        readings.append(paper.paragraph("bases"))
    if "control" in tables:
        readings += [paper.heading("control"), paper.table("control", *tables["control"])]
    return readings


def _equipment(paper, tables):
    steps = ("job", "names", *(("images",) if paper.plan.photos else ()), "run")
    return [
        paper.heading("equipment"),
        *_optional(paper, tables, "cameras", "instruments"),
        paper.heading("afterwards"),
        blocks.listing([paper.word(f"texts.after_{step}") for step in steps]),
    ]


DIPS = 12  # rows of the capacity table in the paper
MOST_POINTS = 40  # weak points listed
MOST_CHANGES = 30  # changes in each table
NEGLIGIBLE = 1e-9  # of the largest u: smaller inputs are not listed
SHOWN_IN = {"m": "mm", "mm": "image um", "rad": "rad arcsec"}  # printed units of blunders
SHARE = Column("relative", "share", digits=3)
_EFFECT = (
    Column("relative", "share", digits=3, heading="u_over_v"), Column("U_m3", "m3", digits=3),
    Column("difference", "share ppm", decimals=1), Column("poor", decimals=0),
    Column("cost", digits=4),
)  # fmt: skip
EFFECTS = (Column("change"), *_EFFECT)
EFFECTS_ON_WALL = tuple(column for column in EFFECTS if column.key != "poor")
EFFECTS_WITH_PLACE = (
    Column("change"), *(Column(key, "m", decimals=1) for key in ("arc_m", "off_m", "height_m")),
    *_EFFECT,
)  # fmt: skip


def outlook(paper):
    """Return the blocks of the prediction of a PlanPaper."""
    return [
        *paper.head("prediction"),
        result(paper),
        _facts(paper),
        *paper.warnings(paper.prediction.warnings),
        *table(paper),
        *_weak(paper),
        *_reliability(paper),
        *_simulation_blocks(paper),
        *changes(paper),
        *design(paper),
    ]


def result(paper):
    """Return the block of the full tank with its U and the verdict on the limit."""
    prediction, table = paper.prediction, paper.prediction.table
    value = format_with_u(table.volume_m3[-1], table.U_m3[-1], paper.marks, least=0)
    text = paper.word(
        "texts.top",
        volume=value.value,
        U=value.uncertainty,
        share=paper.three_digits(table.U_m3[-1] / table.volume_m3[-1]),
        k=paper.number(float(table.k[-1]), decimals=2),
    )
    note = paper.word("texts.before_anything")
    limits = paper.plan.limits
    if limits.relative_u is not None:
        verdict = paper.word(
            f"texts.limit_{limits.quantity}_{'met' if prediction.meets else 'missed'}",
            limit=paper.three_digits(limits.relative_u),
            share=paper.three_digits(prediction.relative_u),
        )
        note = f"{verdict} {note}"
    return blocks.result(paper.word("texts.top_label"), text, note)


def _facts(paper):
    prediction, plan = paper.prediction, paper.plan
    solution, datum = prediction.network.adjusted.solution, prediction.datum
    cost = cost_of(plan)
    ranges = [paper.number(float(sd), "mm", digits=2) for sd in prediction.precision.range_m]
    homogeneity = ", ".join(f"{axis} {text}" for axis, text in zip("xyz", ranges, strict=True))
    return paper.facts(
        [
            ("planned_for", paper.day()),
            ("photo_stations", paper.count(len(plan.stations))),
            ("photographs", paper.count(len(plan.photos))),
            ("setups", paper.count(len(plan.setups))),
            ("tapes", paper.count(len(plan.ties))),
            ("lost_ties", paper.count(len(lost_ties(prediction)))),
            ("bases", paper.count(len(group_by_ends(plan.bases)))),
            ("control_points", paper.count(len(plan.known))),
            ("targets", paper.count(len(plan.targets.names))),
            ("unseen_targets", paper.count(count_unseen_targets(prediction))),
            ("observations", paper.count(solution.rows)),
            ("unknowns", paper.count(solution.estimated)),
            ("redundancy", paper.count(solution.dof)),
            ("mean_sd", paper.number(prediction.precision.mean_sd_m, "mm", digits=2)),
            ("homogeneity", homogeneity),
            ("datum", paper.translate(datum.words) if datum.words else None),
            ("cost", paper.plain(cost) if cost else None),
        ]
    )


# ---- uncertainty of the table


def table(paper):
    """Return the blocks of U against the dip, some rows, the worst deliveries and the budget."""
    table, stated = paper.prediction.table, paper.prediction.result.stated
    last = len(table.height_m) - 1
    places = dict.fromkeys(np.linspace(0, last, DIPS + 1).round().astype(int)[1:].tolist())
    rows = [
        {
            "height_m": float(table.height_m[i]),
            "volume_m3": float(table.volume_m3[i]),
            "U_m3": float(table.U_m3[i]),
            "relative": float(table.U_m3[i] / table.volume_m3[i]),
        }
        for i in places
    ]
    dip = Column("height_m", "m", height=True, heading="dip")
    columns = [dip, Column("volume_m3", "m3", u="U_m3"), Column("U_m3", "m3", digits=2), SHARE]
    sources = sorted(_sources(paper).items(), key=lambda source: -source[1])
    return [
        paper.heading("uncertainty"),
        paper.figure(figures.uncertainty(paper), "uncertainty"),
        paper.table("dips", rows, columns),
        *_worst(paper, stated.worst),
        paper.table(
            "sources",
            [{"source": name, "U_m3": float(u)} for name, u in sources],
            [Column("source"), Column("U_m3", "m3", digits=2, heading="u_top")],
        ),
    ]


def _sources(paper):
    """Return {input: standard uncertainty of the full tank, m3}, without negligible inputs."""
    table, variances = paper.prediction.table, {}
    of_top = combine(table.sources, len(table.height_m)).variances[-1]
    for source, variance in zip(table.sources, of_top, strict=True):
        name = name_of_input(paper.words, source.kind)
        variances[name] = variances.get(name, 0.0) + variance
    u_of = {name: np.sqrt(variance) for name, variance in variances.items()}
    least = NEGLIGIBLE * max(u_of.values(), default=0.0)
    return {name: u for name, u in u_of.items() if u > least}


def _worst(paper, worst):
    rows = [
        {
            "minimum_m": delivery.minimum_m,
            "low_m": delivery.relative.low_m,
            "high_m": delivery.relative.high_m,
            "U_m3": delivery.relative.U_m3,
            "relative": delivery.relative.relative,
        }
        for delivery in worst
    ]
    heights = [Column(key, "m", height=True) for key in ("minimum_m", "low_m", "high_m")]
    columns = [*heights, Column("U_m3", "m3", digits=2), SHARE]
    return [paper.table("worst", rows, columns)] if rows else []


# ---- weak areas and reliability


def _weak(paper):
    prediction = paper.prediction
    rows = [
        {
            "point": point.name,
            "rays": point.rays,
            "sd_m": None if point.undetermined else float(point.sd_m.max()),
            "why": paper.word(f"texts.{_weakness(paper, point)}", rays=point.rays),
        }
        for point in (*prediction.undetermined, *prediction.weak)
    ]
    columns = [
        Column("point"), Column("rays", decimals=0), Column("sd_m", "mm", digits=2), Column("why"),
    ]  # fmt: skip
    across = 2 if len(rows) > SHORT else None
    listed = [paper.table("weak", rows[:MOST_POINTS], columns, across=across)] if rows else []
    if len(rows) > MOST_POINTS:
        listed.append(paper.paragraph("more_weak", count=len(rows) - MOST_POINTS))
    return [
        paper.heading("weak"),
        paper.figure(figures.weak_areas(paper), "weak_areas"),
        paper.figure(figures.rays(paper), "rays"),
        *(listed or [paper.paragraph("none_weak")]),
        _sections(paper),
    ]


def _weakness(paper, point):
    """Key of the text that states why a point is undetermined or weak."""
    if point.undetermined:
        return {0: "why_unseen", 1: "why_one_ray"}.get(point.rays, "why_undetermined")
    if point.rays >= paper.fewest_rays:
        return "why_large_sd"
    return "why_one_ray" if point.rays == 1 else "why_few_rays"


def _sections(paper):
    rows = [
        {
            "section": section.name,
            "height_m": section.height_m,
            "targets": section.targets,
            "centre_x_m": float(section.centre_sd_m[0]),
            "centre_y_m": float(section.centre_sd_m[1]),
            "radius_m": float(section.radius_sd_m),
        }
        for section in paper.prediction.sections
    ]
    sds = [Column(key, "mm", digits=2) for key in ("centre_x_m", "centre_y_m", "radius_m")]
    height = Column("height_m", "m", decimals=3)
    columns = [Column("section"), height, Column("targets", decimals=0), *sds]
    return paper.table("sections", rows, columns)


def _reliability(paper):
    rows = [
        {
            "readings": _name_of_group(paper, group),
            "count": group.count,
            "uncontrolled": group.uncontrolled,
            "redundancy": group.redundancy,
            "blunder": None
            if np.isnan(group.blunder)
            else paper.number(group.blunder, SHOWN_IN[group.unit], digits=3),
            "of": " – ".join(group.of),
            "volume_m3": None if np.isnan(group.volume_m3) else group.volume_m3,
            "volume_of": " – ".join(group.volume_of),
        }
        for group in paper.prediction.reliability
    ]
    columns = [
        Column("readings"), Column("count", decimals=0), Column("uncontrolled", decimals=0),
        Column("redundancy", decimals=2), Column("blunder", align="right"), Column("of"),
        Column("volume_m3", "m3", digits=2, heading="volume_of_blunder"), Column("volume_of"),
    ]  # fmt: skip
    return [
        paper.heading("reliability"),
        paper.paragraph("reliability"),
        paper.table("reliability", rows, columns),
        *_uncontrolled_blocks(paper),
    ]


def _name_of_group(paper, group):
    return group_name(paper.words, {"name": group.name, "kind": group.kind})


def _uncontrolled_blocks(paper):
    """Return the blocks of the effect of errors in uncontrolled readings on the volume."""
    rows = []
    for group in paper.prediction.reliability:
        if group.uncontrolled:
            shown = unit(SHOWN_IN[group.unit])
            rows.append(
                {
                    "readings": _name_of_group(paper, group),
                    "uncontrolled": group.uncontrolled,
                    "per_unit_m3": group.per_unit_m3 / shown.factor,
                    "per": shown.symbol,
                    "volume_of": " – ".join(group.per_unit_of),
                }
            )
    columns = [
        Column("readings"), Column("uncontrolled", decimals=0),
        Column("per_unit_m3", "m3", digits=2, heading="volume_of_blunder"), Column("per"),
        Column("volume_of"),
    ]  # fmt: skip
    if not rows:
        return []
    return [paper.paragraph("uncontrolled"), paper.table("uncontrolled", rows, columns)]


# ---- simulated surveys


def _simulation_blocks(paper):
    simulated = paper.simulated
    if simulated is None:
        return []
    values = {
        "simulated_coordinates": paper.number(simulated.ratio, decimals=3),
        "simulated_volume": paper.number(simulated.volume_ratio, decimals=3),
    }
    return simulated_surveys(paper, "simulated", values)


def simulated_surveys(paper, name, values):
    """Return the blocks of simulated surveys of any plan.

    Parameters
    ----------
    paper : PlanPaper
    name : str
        Key of the text that describes the simulation.
    values : dict
        {label: text} of the results.

    Returns
    -------
    list of blocks.Block
    """
    simulated = paper.simulated
    sd = paper.number(simulated.volume_ratio_sd, digits=2)
    texts = [paper.paragraph(name, seed=str(simulated.seed), sd=sd)]
    if simulated.blunders:
        share, times = paper.three_digits(simulated.blunders), paper.plain(BLUNDER_SDS)
        texts.append(paper.paragraph("simulated_blunders", share=share, times=times))
    rejected = paper.number(float(simulated.set_aside.mean()), decimals=1)
    return [
        paper.heading("simulated"),
        *texts,
        paper.facts(
            [
                ("simulated_surveys", paper.count(simulated.runs)),
                *values.items(),
                ("simulated_aside", rejected),
                ("simulated_failed", paper.count(len(simulated.failed))),
            ]
        ),
    ]


# ---- changes and the smallest design


def changes(paper):
    """Return the blocks of the evaluated changes."""
    possible = [effect for effect in paper.effects if not effect.why]
    if not possible:
        return []
    drops = [effect for effect in possible if effect.change.action == "drop"]
    gains = [effect for effect in possible if effect.change.action != "drop"]
    return [
        paper.heading("changes"),
        paper.paragraph("wall_changes" if paper.is_wall else "changes"),
        *_best(paper, "gains", gains, EFFECTS_ON_WALL if paper.is_wall else EFFECTS_WITH_PLACE),
        *_best(paper, "drops", drops, EFFECTS_ON_WALL if paper.is_wall else EFFECTS),
        *_indispensable(paper),
        paper.figure(figures.changes(paper), "changes"),
    ]


def _best(paper, name, effects, columns):
    """Return the blocks of the first effects, and of the number of further effects."""
    if not effects:
        return []
    best = [paper.table(name, _rows_of_effects(paper, effects[:MOST_CHANGES]), columns)]
    if len(effects) > MOST_CHANGES:
        best.append(paper.paragraph("more_changes", count=len(effects) - MOST_CHANGES))
    return best


def _indispensable(paper):
    """Return the blocks of items without which the survey has no solution, with the reasons."""
    lost = []
    for effect in paper.effects:
        if effect.why and effect.change.action == "drop":
            defects = [
                code for code in ("datum", "rank") if effect.why.startswith(f"{code} defect")
            ]
            change = paper.describe_change(effect.change)
            lost.append(paper.word(f"texts.needed_{[*defects, 'other'][0]}", change=change))
    return [paper.paragraph("needed"), blocks.listing(lost)] if lost else []


def _rows_of_effects(paper, effects):
    return [
        {
            "change": paper.describe_change(effect.change),
            "relative": effect.relative_u,
            "U_m3": effect.U_m3,
            "difference": effect.difference,
            "poor": effect.poor,
            "cost": effect.change.cost or None,
        }
        | place_of_change(effect.change)
        for effect in effects
    ]


def design(paper):
    """Return the blocks of the smallest design, if it was searched for."""
    path = paper.design
    if path is None:
        return []
    text = paper.paragraph(
        "design" if path.start_cost or path.cost else "design_without_cost",
        before=paper.three_digits(path.start_u),
        after=paper.three_digits(path.relative_u),
        cost_before=paper.plain(path.start_cost),
        cost=paper.plain(path.cost),
        tried=path.evaluations,
    )
    missed = []
    if path.prediction.meets is False:
        limit = paper.three_digits(paper.plan.limits.relative_u)
        missed = [paper.paragraph("design_missed", limit=limit)]
    if not path.steps:
        return [paper.heading("design"), paper.paragraph("no_step"), text, *missed]
    columns = EFFECTS_ON_WALL if paper.is_wall else EFFECTS_WITH_PLACE
    steps = paper.table("design", _rows_of_effects(paper, path.steps), columns)
    folder = paper.paragraph("design_has_papers", folder=DESIGN)
    return [paper.heading("design"), text, *missed, folder, steps]
