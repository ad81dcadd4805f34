"""Quality of a product at check points: sentences, tables and rows for CSV files."""

from tankcal.report import blocks, numbers
from tankcal.report.tables import Column, Table
from tankcal.text.digits import decimals_of

MOST_POINTS = 60  # points in the table of differences
LARGE_M = 1.0  # largest difference from which differences are shown in metres


def summary(paper):
    """Blocks for the terminal: bias and precision of each axis, classes and remarks."""
    return [*facts(paper), *axes(paper, paper.result), *classes(paper), *notes(paper)]


def unit_of(result):
    """Unit of the differences: mm, or m if they are large."""
    largest = [row["largest_m"] for row in result["axes"] if row["largest_m"] is not None]
    return "m" if max(map(abs, largest), default=0.0) >= LARGE_M else "mm"


def decimals_of_axes(result, unit):
    """Number of decimals that shows the smallest scatter of an axis with two digits."""
    sds = [row["sd_m"] or abs(row["mean_m"] or 0.0) for row in result["axes"]]
    return decimals_of(min((sd for sd in sds if sd), default=0.0) * numbers.unit(unit).factor)


def facts(paper):
    """Number of points, level of the tests, and the limits with their source."""
    result, table = paper.result, paper.result["table"]
    verified = {True: "verified", False: "not_verified", None: None}[table and table["verified"]]
    source = _describe_limits(paper, "source")
    if verified:
        source = f"{source}; {paper.text(verified)}"
    return [
        paper.facts(
            [
                ("check_points", paper.number(result["n"], decimals=0)),
                ("level", paper.percent(result["alpha"])),
                ("limits", table["name"] if table else None),
                ("limits_source", source),
                ("limits_remark", _describe_limits(paper, "remark")),
            ]
        )
    ]


def _describe_limits(paper, what):
    """Source or remark of the limits, translated if the table is part of tankcal."""
    table = paper.result["table"]
    return table and paper.words[f"limits_{what}s"].get(table.get("code"), table[what])


def axes_table(unit, decimals):
    """Create the Table of the axes, for one product or for several runs."""
    sized = {"unit": unit, "decimals": decimals}
    return Table(
        "axes",
        (
            Column("run", on="checks_of_runs"),
            Column("axis", text=_axis_name),
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


def axes(paper, result):
    """Table of mean, its test, scatter and RMSE of each axis, and table of the precision."""
    unit = unit_of(result)
    tables = [paper.show(axes_table(unit, decimals_of_axes(result, unit)), result["axes"])]
    precisions = [row["precision"] for row in result["axes"] if row["precision"]]
    if precisions:
        columns = [
            Column("axis", text=_axis_name),
            Column("sigma_m", unit, digits=3),
            Column("chi2", decimals=2),
            Column("limit", decimals=2),
            Column("passed", words="passed"),
        ]
        tables.append(paper.table("precision", precisions, columns))
    return tables


def _axis_name(paper, row):
    return paper.word(f"axis_names.{row['axis']}")


def classes(paper):
    """Table of the class reached at each scale, with and without significant means."""
    result = paper.result
    if not result["table"]:
        return []
    if not result["best"]:
        return [paper.paragraph("no_classes")]
    rows = [_class_cells(paper, best) for best in result["best"]]
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
    share = paper.percent(result["table"]["share"])
    return [paper.table("classes", rows, columns, table=result["table"]["name"], share=share)]


def _decimals_of_limits(limits_m):
    """Number of decimals, two to six, that shows every limit exactly."""
    needed = (next((d for d in range(2, 6) if round(x, d) == x), 6) for x in limits_m)
    return max(needed, default=2)


def _class_cells(paper, best):
    """Cells of a scale, for the best class reached, or else for the last class."""
    verdicts = [
        verdict
        for verdict in paper.result["verdicts"]
        if (verdict["part"], verdict["scale"]) == (best["part"], best["scale"])
    ]
    verdict = next((item for item in verdicts if item["grade"] == best["grade"]), verdicts[-1])
    # The reasons explain why the next better class is not reached.
    better = verdicts[max(verdicts.index(verdict) - 1, 0)] if best["grade"] else verdict
    outcome, nothing, scale = verdict["as_is"], paper.text("no_class"), best["scale"]
    if scale.isascii() and scale.isdigit():  # "1000" is shown as 1:1000
        scale = paper.text("scale", number=int(scale))
    return {
        "part": best["part"],
        "scale": scale,
        "grade": best["grade"] or nothing,
        "grade_unbiased": best["grade_unbiased"] or nothing,
        "of_grade": verdict["grade"],
        "tolerance_m": verdict["tolerance_m"],
        "share": outcome["share"],
        "limit_sd_m": verdict["sd_m"],
        "rmse_m": outcome["rmse_m"],
        "why": ", ".join(
            paper.words["whys_of_class"].get(code, code) for code in better["as_is"]["why"]
        ),
        "precise": verdict["precise"],
    }


def notes(paper):
    """Limitations of the result."""
    result = paper.result
    words = paper.words["notes"]
    names = [_axis_name(paper, row) for row in result["axes"]]
    sentences = []
    for note in result["notes"]:
        axis = names[note["n"]] if note["code"] == "axis_without_points" else ""
        template = words.get(note["code"], note["code"])
        n, advised = (paper.number(count, decimals=0) for count in (note["n"], result["advised"]))
        sentences.append(template.format(n=n, advised=advised, axis=axis))
    return [blocks.listing(sentences)] if sentences else []


def differences(paper):
    """Table of the differences at the points, the largest first."""
    result = paper.result
    keys = [f"d{row['axis']}_m" for row in result["axes"]]
    rows = sorted(
        result["differences"], key=lambda row: -sum((row[key] or 0.0) ** 2 for key in keys)
    )
    shown, unit = rows[:MOST_POINTS], unit_of(result)
    decimals = decimals_of_axes(result, unit)
    columns = [Column("point"), *(Column(key, unit, decimals=decimals) for key in keys)]
    table = paper.table("differences", shown, columns)
    if len(rows) == len(shown):
        return [table]
    return [table, paper.paragraph("only_largest", shown=len(shown), all=len(rows))]


def tables(result):
    """Rows of the CSV files."""
    return {
        "axes.csv": [_axis_row(row) for row in result["axes"]],
        "classes.csv": [_verdict_row(row) for row in result["verdicts"]],
        "check_points.csv": result["differences"],
    }


def _axis_row(row):
    precision = row["precision"] or {}
    tested = {key: precision.get(key) for key in ("sigma_m", "chi2", "limit", "passed")}
    return {key: value for key, value in row.items() if key != "precision"} | tested


def _verdict_row(row):
    flat = {key: row[key] for key in ("part", "scale", "grade", "tolerance_m", "sd_m", "n")}
    for kind in ("as_is", "unbiased"):
        flat |= {f"{kind}_{key}": value for key, value in row[kind].items()}
    return flat | {"precise": row["precise"]}
