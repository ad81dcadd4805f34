"""Tests, effects, correlations and components of the parameters of a camera."""

from itertools import combinations

from tankcal.report import blocks, numbers
from tankcal.report.plain import Column
from tankcal.text.digits import NOTHING, fixed
from tankcal.text.words import list_names

HIGH_CORRELATION = 0.9
MOST_PREDICTED = 9  # sets of dropped parameters in the table of predictions
DEFAULT_HIGH = 0.8


def facts(paper):
    """Where the parameters come from, and how they are tested."""
    found, words = paper.result, paper.words["labels_of_parameters"]
    sigma0 = paper.number(found["sigma0"], decimals=3) or NOTHING
    x, y = (paper.number(side, decimals=2) for side in found["half_frame_mm"])
    accuracy, reached = found["image_accuracy"], reach(paper)
    model = [
        paper.word(f"short_conventions.{found['convention']}"),
        paper.word(f"affinities.{found['affinity']}"),
    ]
    seen = "frame_known" if found["frame_known"] else "frame_seen"
    return [
        paper.facts(
            [
                ("camera", found["camera"]),
                ("photos", list_names(paper.words, found["photos"]) if found["photos"] else None),
                ("from", words[found["from"]]),
                ("model", "; ".join(model)),
                ("dof", paper.number(found["dof"], decimals=0)),
                ("test", words[found["scale"]].format(sigma=sigma0)),
                ("level", paper.percent(found["alpha"])),
                ("frame", words[seen].format(x=x, y=y)),
                ("reach", reached and words["reach"].format(**reached)),
                ("accuracy", accuracy and _accuracy(paper, accuracy)),
            ]
        )
    ]


def reach(paper):
    """How far the image points and the corners are from the middle; None: not known."""
    sizes = {key: paper.result[f"{key}_mm"] for key in ("reach", "corner")}
    if sizes["reach"] is None:
        return None
    return {key: paper.number(value, decimals=1) for key, value in sizes.items()}


def _accuracy(paper, accuracy):
    text = paper.in_image(accuracy["um"], accuracy["px"])
    return paper.words["labels_of_parameters"][f"accuracy_{accuracy['from']}"].format(accuracy=text)


def in_pixels(found):
    """Whether effects are known in pixels, and so shown in them."""
    return any(row["edge_px"] is not None for row in found["parameters"])


def tests(paper):
    """The parameters with their tests and effects; the groups."""
    shown = [_row(paper, row) for row in paper.result["parameters"]]
    unit, decimals = ("px", 2) if in_pixels(paper.result) else ("um", 1)
    edge = [
        Column(f"{what}_{unit}", unit, decimals=decimals)
        for what in ("edge", "seen", "left")
        if any(row[f"{what}_{unit}"] is not None for row in shown)
    ]
    columns = [
        Column("parameter"),
        Column("value", heading="estimated", align="right"),
        Column("unit", nothing=""),
        Column("F", digits=4, heading="f"),
        Column("critical", decimals=2),
        Column("significant", words="significant"),
        *edge,
        Column("state", words="states"),
    ]
    return [paper.table("parameters", shown, columns), *_groups(paper)]


def _row(paper, row):
    left, own = row["edge"]["left"] or {}, row["edge"]["own"] or {}
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


def _groups(paper):
    rows = [row | {"names": paper.parameters(row["names"])} for row in paper.result["groups"]]
    if not rows:
        return []
    columns = [
        Column("names"),
        Column("F", digits=4, heading="f"),
        Column("critical", decimals=2),
        Column("significant", words="significant"),
    ]
    return [paper.table("parameter_groups", rows, columns)]


def correlated(paper):
    """A sentence on the high correlations."""
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
        for _, a, b, r in sorted(high, key=lambda one: -one[0])
    ]
    return [paper.paragraph("correlations_high", limit=limit, pairs="; ".join(pairs))]


def components(paper):
    """Eigenvalues with shares and what loads high; whether the matrix is positive definite."""
    found = paper.result["components"]
    if not found:
        return []
    limit = high_limit(paper)
    rows = [
        {
            "component": number + 1,
            "eigenvalue": found["eigenvalues"][number],
            "share_percent": found["share_percent"][number],
            "cumulative_percent": found["cumulative_percent"][number],
            "high_loadings": _high(paper, found, number, limit),
        }
        for number in range(len(found["eigenvalues"]))
    ]
    columns = [
        Column("component", decimals=0),
        Column("eigenvalue", digits=4, align="right"),
        Column("share_percent", "percent", decimals=2),
        Column("cumulative_percent", "percent", decimals=2),
        Column("high_loadings"),
    ]
    code = "positive_definite" if found["positive_definite"] else "not_positive_definite"
    matrix = paper.text(f"{found['of']}_matrix")
    smallest = paper.number(found["smallest_eigenvalue"], digits=3)
    values = {"matrix": matrix, "limit": paper.plain(limit)}
    return [
        paper.table("components", rows, columns, **values),
        paper.paragraph(code, value=smallest),
    ]


def high_limit(paper):
    """The loading above which one is called high: that of the rule, where it was used."""
    silva = (paper.result["rules"] or {}).get("silva")
    return silva["loading"] if silva else DEFAULT_HIGH


def _high(paper, found, number, limit):
    column = [row[number] for row in found["loadings"]]
    return "; ".join(
        f"{paper.parameters([name])}\N{NO-BREAK SPACE}{fixed(loading, 2, paper.marks)}"
        for name, loading in zip(found["names"], column, strict=True)
        if loading is not None and abs(loading) > limit
    )


def predicted(paper):
    """Standard deviations without a parameter over those with all, for the first few sets."""
    sds = {row["name"]: row["sd"] for row in paper.result["parameters"]}
    sets = [one for one in paper.result["without"] if one["sds_predicted"]][:MOST_PREDICTED]
    if not sets:
        return []
    rows = []
    for name in paper.result["names"]:
        cells = [paper.parameters([name])]
        for one in sets:
            new = dict(zip(one["kept"], one["sds_predicted"], strict=True)).get(name)
            old = sds.get(name)
            cells.append(fixed(new / old, 3, paper.marks) if new and old else "")
        rows.append(cells)
    heads = ["", *(f"\N{MINUS SIGN}{paper.parameters(one['names'])}" for one in sets)]
    align = ["left", *["right"] * len(sets)]
    return [blocks.table(heads, rows, paper.word("captions.predicted"), align)]
