"""Quality of a product by its check points: sentences, tables and rows for CSV files."""

from tankcal.report import blocks, numbers
from tankcal.report.tables import Column, Table
from tankcal.text.digits import decimals_of

MOST_POINTS = 60  # rows of differences in the paper
LARGE_M = 1.0  # from here on differences are shown in metres


def summary(paper):
    """What the terminal shows: bias and precision of each axis, classes, remarks."""
    return [*facts(paper), *axes(paper, paper.result), *classes(paper), *notes(paper)]


def unit_of(found):
    """The unit that suits the differences: mm, or m where they are large."""
    largest = [row["largest_m"] for row in found["axes"] if row["largest_m"] is not None]
    return "m" if max(map(abs, largest), default=0.0) >= LARGE_M else "mm"


def decimals_of_axes(found, unit):
    """Decimals that show the smallest scatter of an axis with two digits."""
    sds = [row["sd_m"] or abs(row["mean_m"] or 0.0) for row in found["axes"]]
    return decimals_of(min((sd for sd in sds if sd), default=0.0) * numbers.unit(unit).factor)


def facts(paper):
    """Points, level of the tests, and the limits with their source."""
    found, table = paper.result, paper.result["table"]
    checked = {True: "verified", False: "not_verified", None: None}[table and table["verified"]]
    source = _of_limits(paper, "source")
    if checked:
        source = f"{source}; {paper.text(checked)}"
    return [
        paper.facts(
            [
                ("check_points", paper.number(found["n"], decimals=0)),
                ("level", paper.percent(found["alpha"])),
                ("limits", table["name"] if table else None),
                ("limits_source", source),
                ("limits_remark", _of_limits(paper, "remark")),
            ]
        )
    ]


def _of_limits(paper, what):
    """Source or remark of the limits: of a shipped table in words, else as its file has it."""
    table = paper.result["table"]
    return table and paper.words[f"limits_{what}s"].get(table.get("code"), table[what])


def axes_table(unit, decimals):
    """The Table of the axes of check points, of a product or of several runs."""
    sized = {"unit": unit, "decimals": decimals}
    return Table(
        "axes",
        (
            Column("run", on="checks_of_runs"),
            Column("axis", text=lambda paper, row: paper.word(f"axis_names.{row['axis']}")),
            Column("n", decimals=0),
            Column("mean_m", **sized),
            Column("sd_m", **sized, on="axes"),
            Column("t", decimals=2),
            Column("t_limit", decimals=2),
            Column("biased"),
            Column("rmse_m", **sized),
            Column("rmse_unbiased_m", **sized),
            Column("largest_m", **sized, on="axes"),
            Column("largest_point", on="axes"),
        ),
    )


def axes(paper, found):
    """One row an axis: mean, its test, scatter, RMSE before and after the bias."""
    unit = unit_of(found)
    tables = [paper.show(axes_table(unit, decimals_of_axes(found, unit)), found["axes"])]
    tested = [row["precision"] for row in found["axes"] if row["precision"]]
    if tested:
        tables.append(_precision(paper, tested, unit))
    return tables


def _precision(paper, tested, unit):
    columns = [
        Column("axis", text=lambda paper, row: paper.word(f"axis_names.{row['axis']}")),
        Column("sigma_m", unit, digits=3),
        Column("chi2", decimals=2),
        Column("limit", decimals=2),
        Column("passed", words="passed"),
    ]
    return paper.table("precision", tested, columns)


def classes(paper):
    """The class that each scale reaches, as it is and less the significant means."""
    found = paper.result
    if not found["table"]:
        return []
    if not found["best"]:
        return [paper.paragraph("no_classes")]
    rows = [_class_row(paper, one) for one in found["best"]]
    decimals = _decimals_of_limits(
        row[key] for row in rows for key in ("tolerance_m", "limit_sd_m")
    )
    columns = [
        Column("part", words="parts_of_product"),
        Column("scale"),
        Column("grade"),
        Column("grade_unbiased"),
        Column("of_grade"),
        Column("tolerance_m", "m", decimals=decimals),
        Column("share", "share", decimals=0),
        Column("limit_sd_m", "m", decimals=decimals),
        Column("rmse_m", "m", digits=3),
        *([Column("why")] if any(row["why"] for row in rows) else []),
        Column("precise", words="passed"),
    ]
    share = paper.percent(found["table"]["share"])
    return [paper.table("classes", rows, columns, table=found["table"]["name"], share=share)]


def _decimals_of_limits(limits_m):
    """Decimals, two to six, that show every limit as it was written."""
    needed = (next((d for d in range(2, 6) if round(x, d) == x), 6) for x in limits_m)
    return max(needed, default=2)


def _class_row(paper, best):
    """A scale with the figures of the class that it reaches, else of the last class."""
    same = [
        one
        for one in paper.result["verdicts"]
        if (one["part"], one["scale"]) == (best["part"], best["scale"])
    ]
    verdict = next((one for one in same if one["grade"] == best["grade"]), same[-1])
    better = same[max(same.index(verdict) - 1, 0)] if best["grade"] else verdict
    reached, nothing = verdict["as_is"], paper.text("no_class")
    return {
        "part": best["part"],
        "scale": _scale(paper, best["scale"]),
        "grade": best["grade"] or nothing,
        "grade_unbiased": best["grade_unbiased"] or nothing,
        "of_grade": verdict["grade"],
        "tolerance_m": verdict["tolerance_m"],
        "share": reached["share"],
        "limit_sd_m": verdict["sd_m"],
        "rmse_m": reached["rmse_m"],
        "why": ", ".join(
            paper.words["whys_of_class"].get(code, code) for code in better["as_is"]["why"]
        ),
        "precise": verdict["precise"],
    }


def _scale(paper, scale):
    """ "1000" as 1:1000; any other name as it is."""
    return paper.text("scale", number=int(scale)) if scale.isascii() and scale.isdigit() else scale


def notes(paper):
    """What limits what can be said."""
    found = paper.result
    words = paper.words["notes"]
    names = [paper.word(f"axis_names.{row['axis']}") for row in found["axes"]]
    sentences = []
    for note in found["notes"]:
        axis = names[note["n"]] if note["code"] == "axis_without_points" else ""
        template = words.get(note["code"], note["code"])
        n, advised = (paper.number(one, decimals=0) for one in (note["n"], found["advised"]))
        sentences.append(template.format(n=n, advised=advised, axis=axis))
    return [blocks.listing(sentences)] if sentences else []


def differences(paper):
    """The differences of the points, the largest first."""
    found = paper.result
    keys = [f"d{row['axis']}_m" for row in found["axes"]]
    rows = sorted(
        found["differences"], key=lambda row: -sum((row[key] or 0.0) ** 2 for key in keys)
    )
    shown, unit = rows[:MOST_POINTS], unit_of(found)
    decimals = decimals_of_axes(found, unit)
    columns = [Column("point"), *(Column(key, unit, decimals=decimals) for key in keys)]
    table = paper.table("differences", shown, columns)
    if len(rows) == len(shown):
        return [table]
    return [table, paper.paragraph("only_largest", shown=len(shown), all=len(rows))]


def tables(result):
    """Rows of the CSV files."""
    return {
        "axes.csv": [_flat_axis(row) for row in result["axes"]],
        "classes.csv": [_flat_verdict(row) for row in result["verdicts"]],
        "check_points.csv": result["differences"],
    }


def _flat_axis(row):
    precision = row["precision"] or {}
    tested = {key: precision.get(key) for key in ("sigma_m", "chi2", "limit", "passed")}
    return {key: value for key, value in row.items() if key != "precision"} | tested


def _flat_verdict(row):
    flat = {key: row[key] for key in ("part", "scale", "grade", "tolerance_m", "sd_m", "n")}
    for kind in ("as_is", "unbiased"):
        flat |= {f"{kind}_{key}": value for key, value in row[kind].items()}
    return flat | {"precise": row["precise"]}
