"""Parameters of a camera: sentences, tables and rows for CSV files.

They show tests, correlations, principal components, the effect of dropping parameters, the rules of
two authors, and the recommendation.
"""

from itertools import combinations

from tankcal.report import blocks, numbers
from tankcal.report.plain import Column
from tankcal.text.digits import NOTHING, fixed
from tankcal.text.words import list_names

HIGH_CORRELATION = 0.9
HIGH_LOADING = 0.8  # loading that is called high if no rule states a limit
MOST_PREDICTED = 9  # sets of dropped parameters in the table of predictions


def summary(paper):
    """Blocks for the terminal."""
    parts = (
        ("components", components(paper)),
        ("dropping", dropping(paper)),
        ("rules", rules(paper)),
    )
    return [
        *facts(paper),
        paper.heading("tests"),
        *tests(paper),
        *high_correlations(paper),
        *(block for name, content in parts if content for block in (paper.heading(name), *content)),
        paper.heading("recommendation"),
        *recommendation(paper),
    ]


def facts(paper):
    """Source and model of the parameters, and settings of their tests."""
    result, words = paper.result, paper.words["labels_of_parameters"]
    sigma0 = paper.number(result["sigma0"], decimals=3) or NOTHING
    x, y = (paper.number(side, decimals=2) for side in result["half_frame_mm"])
    accuracy, reached = result["image_accuracy"], reach(paper)
    model = [
        paper.word(f"short_conventions.{result['convention']}"),
        paper.word(f"affinities.{result['affinity']}"),
    ]
    if accuracy:
        size = paper.in_image(accuracy["um"], accuracy["px"])
        accuracy = words[f"accuracy_{accuracy['from']}"].format(accuracy=size)
    frame = words["frame_known" if result["frame_known"] else "frame_seen"]
    return [
        paper.facts(
            [
                ("camera", result["camera"]),
                ("photos", list_names(paper.words, result["photos"]) if result["photos"] else None),
                ("from", words[result["from"]]),
                ("model", "; ".join(model)),
                ("dof", paper.number(result["dof"], decimals=0)),
                ("test", words[result["scale"]].format(sigma=sigma0)),
                ("level", paper.percent(result["alpha"])),
                ("frame", frame.format(x=x, y=y)),
                ("reach", reached and words["reach"].format(**reached)),
                ("accuracy", accuracy),
            ]
        )
    ]


def reach(paper):
    """Distances of the farthest image point and of the corners, as texts; None if not known."""
    sizes = {key: paper.result[f"{key}_mm"] for key in ("reach", "corner")}
    if sizes["reach"] is None:
        return None
    return {key: paper.number(value, decimals=1) for key, value in sizes.items()}


# ---- tests and effects


def is_in_pixels(result):
    """Whether effects are known in pixels. They are then shown in pixels."""
    return any(row["edge_px"] is not None for row in result["parameters"])


def tests(paper):
    """Tables of the parameters and of their groups, with tests and effects."""
    rows = [_parameter_cells(paper, row) for row in paper.result["parameters"]]
    unit, decimals = ("px", 2) if is_in_pixels(paper.result) else ("um", 1)
    effects = [
        Column(f"{what}_{unit}", unit, decimals=decimals)
        for what in ("edge", "seen", "left")
        if any(row[f"{what}_{unit}"] is not None for row in rows)
    ]
    columns = [
        Column("parameter"),
        Column("value", heading="estimated", align="right"),
        Column("unit", nothing=""),
        Column("F", digits=4, heading="f"),
        Column("critical", decimals=2),
        Column("significant", words="significant"),
        *effects,
        Column("state", words="states"),
    ]
    tables = [paper.table("parameters", rows, columns)]
    groups = [row | {"names": paper.parameters(row["names"])} for row in paper.result["groups"]]
    if groups:
        columns = [
            Column("names"),
            Column("F", digits=4, heading="f"),
            Column("critical", decimals=2),
            Column("significant", words="significant"),
        ]
        tables.append(paper.table("parameter_groups", groups, columns))
    return tables


def _parameter_cells(paper, row):
    """Cells of a parameter for its test and effects."""
    left, own = row["edge"]["left"] or {}, row["edge"]["own"] or {}
    # The test of c against zero has no meaning, and is not shown.
    tested = row if row["decides"] else row | dict.fromkeys(("F", "critical", "significant"))
    return tested | {
        "parameter": paper.parameters([row["name"]]),
        "value": numbers.concise(row["value"], row["sd"], paper.marks),
        "unit": numbers.powers(row["unit"]) or None,
        "seen_um": own.get("seen_um"),
        "seen_px": own.get("seen_px"),
        "left_um": left.get("corner_um"),
        "left_px": left.get("corner_px"),
    }


# ---- correlations and principal components


def high_correlations(paper):
    """A sentence that lists the high correlations."""
    names, matrix = paper.result["names"], paper.result["correlation"]
    high = [
        (abs(matrix[i][k]), names[i], names[k], matrix[i][k])
        for i, k in combinations(range(len(names)), 2)
        if matrix[i][k] is not None and abs(matrix[i][k]) > HIGH_CORRELATION
    ]
    limit = paper.plain(HIGH_CORRELATION)
    if not high:
        return [paper.paragraph("correlations_low", limit=limit)]
    pairs = [
        paper.text(
            "correlation_pair",
            a=paper.parameters([a]),
            b=paper.parameters([b]),
            r=fixed(r, 3, paper.marks),
        )
        for _, a, b, r in sorted(high, key=lambda pair: -pair[0])
    ]
    return [paper.paragraph("correlations_high", limit=limit, pairs="; ".join(pairs))]


def components(paper):
    """Table of eigenvalues and high loadings, and whether the matrix is positive definite."""
    content = paper.result["components"]
    if not content:
        return []
    silva = (paper.result["rules"] or {}).get("silva")
    limit = silva["loading"] if silva else HIGH_LOADING
    rows = [
        {
            "component": number + 1,
            "eigenvalue": content["eigenvalues"][number],
            "share_percent": content["share_percent"][number],
            "cumulative_percent": content["cumulative_percent"][number],
            "high_loadings": _list_high_loadings(paper, number, limit),
        }
        for number in range(len(content["eigenvalues"]))
    ]
    columns = [
        Column("component", decimals=0),
        Column("eigenvalue", digits=4, align="right"),
        Column("share_percent", "percent", decimals=2),
        Column("cumulative_percent", "percent", decimals=2),
        Column("high_loadings"),
    ]
    code = "positive_definite" if content["positive_definite"] else "not_positive_definite"
    matrix = paper.text(f"{content['of']}_matrix")
    smallest = paper.number(content["smallest_eigenvalue"], digits=3)
    return [
        paper.table("components", rows, columns, matrix=matrix, limit=paper.plain(limit)),
        paper.paragraph(code, value=smallest),
    ]


def _list_high_loadings(paper, number, limit):
    content = paper.result["components"]
    column = [row[number] for row in content["loadings"]]
    return "; ".join(
        f"{paper.parameters([name])}\N{NO-BREAK SPACE}{fixed(loading, 2, paper.marks)}"
        for name, loading in zip(content["names"], column, strict=True)
        if loading is not None and abs(loading) > limit
    )


# ---- dropped parameters


def predictions(paper):
    """Table of standard deviations without some parameters, as a ratio to those with all."""
    sds = {row["name"]: row["sd"] for row in paper.result["parameters"]}
    trials = [trial for trial in paper.result["without"] if trial["sds_predicted"]]
    trials = trials[:MOST_PREDICTED]
    if not trials:
        return []
    rows = []
    for name in paper.result["names"]:
        cells = [paper.parameters([name])]
        for trial in trials:
            new = dict(zip(trial["kept"], trial["sds_predicted"], strict=True)).get(name)
            old = sds.get(name)
            cells.append(fixed(new / old, 3, paper.marks) if new and old else "")
        rows.append(cells)
    heads = ["", *(f"\N{MINUS SIGN}{paper.parameters(trial['names'])}" for trial in trials)]
    align = ["left", *["right"] * len(trials)]
    return [blocks.table(heads, rows, paper.word("captions.predicted"), align)]


def dropping(paper):
    """Table of the changes of points and volume without parameters, with remarks."""
    trials, whole = paper.result["without"], paper.result["with_all"]
    adjusted = [trial for trial in trials if trial["points"]]
    content = []
    if adjusted:
        content.append(_dropping_table(paper, adjusted))
        if not all(trial["comparable"] for trial in adjusted):
            content.append(paper.paragraph("not_comparable"))
    elif trials:
        content.append(paper.paragraph("no_product"))
    for trial in trials:
        if trial["failed"]:
            code = "no_volume_without" if trial["points"] else "failed_without"
            names = paper.parameters(trial["names"])
            content.append(paper.paragraph(code, names=names, text=trial["failed"]))
    if whole and whole["no_volume"]:
        content.append(paper.paragraph("no_volume", text=whole["no_volume"]))
    return content


def _dropping_table(paper, trials):
    """Table of trials that were adjusted again."""
    rows = [
        {
            "without": paper.parameters(trial["names"]) + ("" if trial["comparable"] else " *"),
            "because": ", ".join(paper.words["whys"].get(why, why) for why in trial["because"]),
            "sigma0": trial["sigma0"],
            "rms_moved": trial["points"]["rms_mm"],
            "largest_moved": trial["points"]["largest_mm"],
            "largest_sds": trial["points"]["largest_sds"],
            "volume_change_m3": trial["volume_change_m3"],
            "volume_u_m3": trial["volume_u_m3"],
        }
        for trial in trials
    ]
    columns = [
        Column("without"),
        Column("because"),
        Column("sigma0", decimals=3),
        Column("rms_moved", "image mm", decimals=3),
        Column("largest_moved", "image mm", decimals=3),
        Column("largest_sds", decimals=2),
    ]
    if any(row["volume_change_m3"] is not None for row in rows):
        columns += [
            Column("volume_change_m3", "m3", decimals=4),
            Column("volume_u_m3", "m3", digits=2),
        ]
    return paper.table("without", rows, columns)


# ---- rules and recommendation


def rules(paper):
    """Results of the rules of Silva and of Pessoa, a sentence for each."""
    results, sentences = paper.result["rules"] or {}, []
    silva, pessoa = results.get("silva"), results.get("pessoa")
    nothing = paper.text("none")
    if silva:
        sentences.append(
            paper.text(
                "silva",
                may_go=silva["may_go"],
                negligible=paper.plain(silva["negligible_percent"]),
                loading=paper.plain(silva["loading"]),
                drop=paper.parameters(silva["drop"]) or nothing,
            )
        )
    if pessoa:
        kept = [
            paper.text(
                "pessoa_kept",
                name=paper.parameters([item["name"]]),
                because=paper.words["pessoa"].get(item["because"], item["because"]),
            )
            for item in pessoa["keep"]
        ]
        px, um = pessoa["limit_px"], pessoa["limit_um"]
        limit = paper.number(px, "px", digits=2) if px is not None else None
        sentences.append(
            paper.text(
                "pessoa",
                limit=limit or (paper.number(um, "um", digits=2) if um is not None else NOTHING),
                drop=paper.parameters(pessoa["drop"]) or nothing,
                keep=", ".join(kept) or nothing,
            )
        )
    return [blocks.listing(sentences)] if sentences else []


def recommendation(paper):
    """The recommendation, contradictions of test and effect, and the reasons."""
    advice = paper.result["recommendation"]
    may_go = [item["name"] for item in advice if not item["keep"]]
    code = "advice_some" if may_go else "advice_none"
    content = [paper.paragraph(code, names=paper.parameters(may_go))]
    if not paper.result["with_all"]:
        content.append(paper.paragraph("no_product"))
    contradictions = {"significant_but_tiny", "insignificant_but_large"}
    disagree = [
        item["name"]
        for item in advice
        if contradictions & {reason["code"] for reason in item["reasons"]}
    ]
    if disagree:
        content.append(paper.paragraph("disagree", names=paper.parameters(disagree)))
    reasons = [reason for item in advice for reason in item["reasons"]]
    if any(reason["code"] == "corner_not_seen" for reason in reasons):
        content.append(paper.paragraph("beyond_points", **reach(paper)))
    # Each parameter of a joint trial has the reason; it is stated once.
    joint = dict.fromkeys(_format_reason(paper, item) for item in reasons if _is_joint(item))
    content += [blocks.paragraph(sentence) for sentence in joint]
    return [*content, blocks.listing(_advice_sentence(paper, item) for item in advice)]


def _is_joint(reason):
    """Whether a reason applies to all parameters that may be dropped together."""
    code = reason["code"]
    return code.startswith("together_") or (code == "not_determined_without" and "names" in reason)


def _advice_sentence(paper, item):
    reasons = [reason for reason in item["reasons"] if not _is_joint(reason)]
    return paper.text(
        "reasons_of",
        name=paper.parameters([item["name"]]),
        advice=paper.words["advice"][str(item["keep"])],
        reasons=" ".join(_format_reason(paper, reason) for reason in reasons),
    )


def _format_reason(paper, reason):
    """Sentence of a reason, with a capital letter and a full stop."""
    text = paper.reason(reason)
    return text[:1].upper() + text[1:] + ("" if text.endswith((".", "!", "?")) else ".")


# ---- CSV files


def tables(result):
    """Rows of the CSV files."""
    names = result["names"]
    correlations = [
        {"parameter": name, **dict(zip(names, row, strict=True))}
        for name, row in zip(names, result["correlation"], strict=True)
    ]
    return {
        "parameters.csv": [_parameter_row(row) for row in result["parameters"]],
        "correlations.csv": correlations,
        "groups.csv": result["groups"],
        **_component_tables(result["components"]),
        "dropped.csv": [row for trial in result["without"] for row in _trial_rows(trial)],
        "advice.csv": [
            {
                "parameter": item["name"],
                "keep": item["keep"],
                "reasons": [reason["code"] for reason in item["reasons"]],
            }
            for item in result["recommendation"]
        ],
    }


def _parameter_row(row):
    own, left = row["edge"]["own"] or {}, row["edge"]["left"] or {}
    sizes = {}
    for kind, shift in (("own", own), ("left", left)):
        for key in ("corner_um", "corner_px", "seen_um", "seen_px", "rms_um", "rms_px"):
            sizes[f"{kind}_{key}"] = shift.get(key)
    return {key: value for key, value in row.items() if key != "edge"} | sizes


def _component_tables(components):
    """CSV rows of shares and loadings of the components."""
    if not components:
        return {}
    keys = ("eigenvalues", "share_percent", "cumulative_percent", "values")
    shares = [
        {"component": number, **dict(zip(keys, values, strict=True))}
        for number, values in enumerate(zip(*(components[key] for key in keys), strict=True), 1)
    ]
    loadings = [
        {"parameter": name} | {f"Y{number}": value for number, value in enumerate(row, 1)}
        for name, row in zip(components["names"], components["loadings"], strict=True)
    ]
    return {"components.csv": shares, "loadings.csv": loadings}


def _trial_rows(trial):
    """Yield a row for each parameter that a trial keeps."""
    points = trial["points"] or {}
    common = {
        "without": " ".join(trial["names"]),
        "because": " ".join(trial["because"]),
        "comparable": trial["comparable"],
        "sigma0": trial["sigma0"],
        "points_rms_mm": points.get("rms_mm"),
        "points_largest_mm": points.get("largest_mm"),
        "points_largest_sds": points.get("largest_sds"),
        "volume_change_m3": trial["volume_change_m3"],
        "volume_u_m3": trial["volume_u_m3"],
    }
    keys = ("sds_predicted", "values_predicted", "sds_adjusted", "values_adjusted")
    for i, name in enumerate(trial["kept"]):
        values = {key: (trial[key][i] if i < len(trial[key] or ()) else None) for key in keys}
        yield common | {"parameter": name} | values
