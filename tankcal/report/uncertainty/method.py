"""Method of the uncertainty evaluation and its inputs: sentences and lists."""

from math import inf

import numpy as np

from tankcal.record.covariance_factor import factor_of
from tankcal.report import blocks, numbers
from tankcal.report.tables import Column, Table
from tankcal.report.uncertainty.stated import (
    MARK,
    MONTE_CARLO,
    flag_simulated,
    k_of_rows,
    limit_rows,
    stated_rows,
)
from tankcal.text.digits import LITRE_DECIMALS, NOTHING

# Inputs that are estimated from the survey.
FROM_SURVEY = (
    "instrument_scale",
    "instrument_offset",
    "incidence",
    "registration",
    "tangent_excess",
    "points",
    "straps",
    "offsets",
    "collimation",
    "tape_comparison",
    "tape_temperature",
    "tape_tension",
    "tape_friction",
    "tape_weight",
    "tape_sag",
    "tape_level",
    "plate_readings",
    "area_term",
    "bulge",
    "ovality",
    "seams",
    "oblateness",
    "legs",
    "undecided",
    "form",
    "own_form",
    "bottom_points",
    "bottom_form",
    "bottom_liquid",
    "bottom_curve",
    "meter_repeatability",
    "dip_readings",
    "liquid_temperatures",
    "run_effect",
    "bottom_volume",
    "below_first_dip",
    "nominal_radius",
    "nominal_radius_of_all",
    "course_radii",
    "course_radii_common",
    "course_radii_shared",
    "radii_change",
    "radii_change_common",
    "measured_form",
)
# Inputs of the reading of a table.
OF_READING = ("interpolation", "rounding")
LARGER_PART = 0.5  # share of the variance above which an input determines a distribution


def sentences(paper, mark=MARK):
    """Return the sentences of the certificate on U and k (list of str).

    `mark` is the mark of rows with a Monte Carlo interval. `monte_carlo.sentence` describes the
    simulation.
    """
    record = paper.record
    simulated = {*flag_simulated(record["capacity"])}
    simulated |= {row["simulated"] for row in (*stated_rows(record), *limit_rows(record))}
    how = {(False,): "how_gum", (True,): "how_monte_carlo"}.get(tuple(simulated), "how_mixed")
    method = paper.word(f"texts.{how}", coverage=paper.coverage(), mark=mark)
    of_k = k_sentences(paper)
    if how == "how_mixed":
        of_k = [paper.word("texts.k_where", sentence=sentence) for sentence in of_k]
    is_off = record["job"]["table"].get("monte_carlo") is False
    off = [paper.word("texts.monte_carlo_off")] if is_off else []
    return [method, *of_k, *off, *default_effects(paper)]


def default_effects(paper):
    """Return a sentence for each default u that determines the distribution of results.

    A result counts if its interval is by Monte Carlo and the default has the larger part of its
    variance. The sentences name input, u, distribution, and the number of such results.
    """
    record = paper.record
    sentences = []
    defaults = [line for line in budget_lines(record) if line.get("is_default")]
    variances = variances_of_rows(record["capacity"]) if defaults else None
    for line in defaults:
        of_rows, of_budgets = simulated_shares(record, variances, line["input"])
        rows, stated = (int(np.sum(shares > LARGER_PART)) for shares in (of_rows, of_budgets))
        if rows + stated:
            sentences.append(
                paper.word(
                    "texts.default_effect",
                    input=paper.input_name(line | {"is_default": False}),
                    u=_format_u(paper, line["u"], line["unit"]),
                    distribution=_distribution(paper, line),
                    rows=rows,
                    all_rows=len(record["capacity"]["volume_m3"]),
                    stated=stated,
                    all_stated=len(record["budgets"]),
                    share=paper.number(max(*of_rows, *of_budgets), "share", digits=2),
                )
            )
    return sentences


def variances_of_rows(capacity):
    """Return the variances by each column of the factor, m6, shape (rows, inputs).

    The rows have an interval by Monte Carlo and u above 0. Rows of the table have no lines of a
    budget, so that their shares follow from the factor.
    """
    variances = factor_of(capacity)[flag_simulated(capacity)] ** 2
    return variances[variances.sum(axis=1) > 0]


def simulated_shares(record, variances, name):
    """Return the shares of an input in the variances of results whose interval is by Monte Carlo.

    Parameters
    ----------
    record : dict
        Record with a capacity table.
    variances : ndarray
        Variances of `variances_of_rows`.
    name : str
        Name of the input.

    Returns
    -------
    of_rows, of_budgets : ndarray
        Shares in rows of the table with u above 0, and in stated volumes and deliveries.
    """
    capacity = record["capacity"]
    is_input = [kind == name for kind in capacity.get("input_kind") or capacity["inputs"]]
    of_rows = variances[:, is_input].sum(axis=1) / variances.sum(axis=1)
    of_budgets = [
        line["share"] or 0.0
        for budget in record.get("budgets", [])
        if budget.get("interval") == MONTE_CARLO
        for line in budget["lines"]
        if line["input"] == name
    ]
    return of_rows, np.array(of_budgets)


def k_sentences(paper):
    """Return the sentence on k in the wording of EA-4/02, in a list; [] without any k."""
    capacity = paper.record["capacity"]
    rows = zip(k_of_rows(capacity), capacity["dof"], capacity["U_m3"], strict=True)
    known = [(k, inf if dof is None else dof) for k, dof, U in rows if k is not None and U]
    if not known:
        return []
    ks, dofs = zip(*known, strict=True)
    k = _between_text(paper, [paper.number(end(ks), decimals=2) for end in (min, max)])
    ends = [numbers.degrees_of_freedom(end(dofs), paper.marks) for end in (min, max)]
    if ends[0] == numbers.degrees_of_freedom(inf):
        return [paper.word("texts.k_normal", k=k, coverage=paper.coverage())]
    dof = _between_text(paper, ends)
    return [paper.word("texts.k_t", k=k, dof=dof, coverage=paper.coverage())]


def _between_text(paper, ends):
    low, high = ends
    return low if low == high else paper.word("texts.between_values", low=low, high=high)


def inputs(paper):
    """Return labels and texts of the inputs: estimated, declared, default, reading, missing."""
    lines = budget_lines(paper.record)
    groups = {"survey": [], "declared": [], "default": [], "reading": []}
    for line in lines:
        group = _group(line)
        shown_line = line | {"is_default": False} if group == "default" else line
        groups[group].append(_format_input(paper, shown_line))
    facts = [(f"inputs_{name}", "; ".join(texts)) for name, texts in groups.items()]
    missing = "; ".join(missing_inputs(paper)) or paper.word("texts.nothing_missing")
    return [*facts, ("inputs_missing", missing)]


def missing_inputs(paper):
    """Return the names of the inputs that affect the table and were not declared (list of str)."""
    choices = [choice for choice in paper.record["choices"] if choice["code"] == "not_in_budget"]
    return [paper.words["inputs"].get(name, name) for choice in choices for name in choice["value"]]


def budget_lines(record):
    """Return the lines of the first stated budget, or of the table if there is none."""
    return next((budget["lines"] for budget in record.get("budgets", [])), record["budget"])


def _group(line):
    if line["input"] in OF_READING:
        return "reading"
    if line.get("is_default"):
        return "default"
    return "survey" if line["input"] in FROM_SURVEY else "declared"


def _format_input(paper, line):
    name = paper.input_name(line)
    if line["u"] is None or line["input"] in FROM_SURVEY:
        return name
    return paper.word(
        "texts.input_u",
        input=name,
        u=_format_u(paper, line["u"], line["unit"]),
        distribution=_distribution(paper, line),
    )


def _distribution(paper, line):
    return paper.words["distributions"].get(line["distribution"], line["distribution"])


def _format_u(paper, u, unit):
    """Format an uncertainty with two digits and its unit; volumes have the unit of the paper."""
    if unit == "m3":
        return paper.number(u, unit, digits=2)
    return numbers.join_unit(paper.number(u, digits=2), numbers.symbol(unit))


def stated_blocks(paper):
    """Table of the stated volumes and deliveries; [] if there are none."""
    rows = stated_rows(paper.record)
    if not rows:
        return []
    name = "stated_marked" if any(row["simulated"] for row in rows) else "stated"
    return [paper.show(stated_table(paper.record), rows, on=name)]


def _dof(paper, row):
    # As k, the degrees of freedom belong to an interval of the law of propagation.
    return None if row["simulated"] else numbers.degrees_of_freedom(row["dof"], paper.marks)


def _interval(paper, row):
    return paper.words["intervals"]["monte_carlo" if row["simulated"] else "gum"]


def stated_table(record):
    """Return the Table of stated volumes and deliveries, in the unit of the capacity table."""
    unit = record["job"]["table"]["volume_unit"]
    litres = {"u": "U_m3", "least": LITRE_DECIMALS}
    return Table(
        "stated",
        (
            Column("high_m", "m", height=True, heading="height_m", sheet="from_dip_m"),
            Column("low_m", "m", height=True, heading="down_to", sheet="down_to_m"),
            Column("volume_m3", unit, u="U_m3", least=numbers.unit(unit).least, sheet="volume_m3",
                   width=14, in_sheet=litres | {"unit": "m3"}),
            Column("U_m3", unit, u="U_m3", sheet="U_m3", in_sheet={"unit": "m3"}),
            Column("by_monte_carlo", text=lambda paper, row: MARK if row["simulated"] else None,
                   nothing="", on="stated_marked"),
            Column("k", decimals=2, nothing="", sheet="k", width=10, in_sheet={"nothing": NOTHING}),
            Column("dof", text=_dof, align="right"),
            Column("relative", "share", digits=2, align="right", sheet="relative"),
            Column("interval", text=_interval, on="", sheet="interval", width=14),
            *(Column(f"{end}_m3", "m3", **litres, on="", sheet=code, width=14)
              for end, code in (("low", "uneven_from_m3"), ("high", "uneven_to_m3"))),
            Column("remark", text=lambda paper, row: "; ".join(remarks(paper, row)) or None,
                   nothing="", sheet="remark", width=44,
                   in_sheet={"text": lambda paper, row: "; ".join(remarks(paper, row))}),
        ),
        rows=stated_rows,
    )  # fmt: skip


def limits_table(record):
    """Return the Table of the operating levels: the columns of `stated_table` after the level."""
    keys = ("high_m", "low_m", "volume_m3", "U_m3", "k", "relative", "interval", "remark")
    level = Column("tank_limit", words="tank_limits", sheet="tank_limit", width=44)
    columns = stated_table(record).only(*keys).columns
    return Table("limits_of_tank", (level, *columns), rows=limit_rows)


def remarks(paper, row):
    """Return the remarks on a stated volume (list of str).

    The remarks concern the worst delivery, an asymmetric interval, a formerly stated volume, and
    rows that must not be used.
    """
    texts = []
    if row["minimum_m"] is not None:
        height = paper.plain(row["minimum_m"], "m")
        texts.append(paper.word("texts.worst_of", height=height))
    if row["low_m3"] is not None:
        unit = paper.record["job"]["table"]["volume_unit"]
        low, high = (paper.number(row[key], unit, u=row["U_m3"]) for key in ("low_m3", "high_m3"))
        texts.append(paper.word("texts.interval_of", low=low, high=high))
    if row["stated_m3"] is not None:
        unit = paper.record["job"]["table"]["volume_unit"]
        difference = row["volume_m3"] - row["stated_m3"]
        stated, difference_text = (
            paper.number(volume_m3, unit, u=row["U_m3"])
            for volume_m3 in (row["stated_m3"], difference)
        )
        texts.append(paper.word("texts.beside_stated", stated=stated, more=difference_text))
    if not row["for_use"]:
        texts.append(paper.word("texts.not_for_use"))
    return [*texts, row["note"]] if row["note"] else texts


def blocks_of_method(paper):
    """Blocks of the chapter on uncertainty in the certificate."""
    return [
        *(blocks.paragraph(text) for text in sentences(paper)),
        paper.facts(inputs(paper)),
        *stated_blocks(paper),
    ]
