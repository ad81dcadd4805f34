"""Which parameters belong in the model of a camera: what the terminal and the CSV files show."""

from tankcal.report.camera import parameter_advice as advice
from tankcal.report.camera import parameter_tests as tests


def summary(paper):
    """What the terminal shows: tests, groups, correlations, components, dropping, advice."""
    return [
        *tests.facts(paper),
        paper.heading("tests"),
        *tests.tests(paper),
        *tests.correlated(paper),
        *_under(paper, "components", tests.components(paper)),
        *_under(paper, "dropping", advice.dropping(paper)),
        *_under(paper, "rules", advice.rules(paper)),
        paper.heading("recommendation"),
        *advice.recommendation(paper),
    ]


def _under(paper, name, found):
    """The blocks with a heading, where there are any."""
    return [paper.heading(name), *found] if found else []


# ---- CSV files


def tables(result):
    """Rows of the CSV files."""
    names = result["names"]
    of_names = [
        {"parameter": name, **dict(zip(names, row, strict=True))}
        for name, row in zip(names, result["correlation"], strict=True)
    ]
    return {
        "parameters.csv": [_parameter_row(row) for row in result["parameters"]],
        "correlations.csv": of_names,
        "groups.csv": result["groups"],
        **_component_tables(result["components"]),
        "dropped.csv": [row for one in result["without"] for row in _dropped_rows(one)],
        "advice.csv": [
            {
                "parameter": one["name"],
                "keep": one["keep"],
                "reasons": [reason["code"] for reason in one["reasons"]],
            }
            for one in result["recommendation"]
        ],
    }


def _parameter_row(row):
    own, left = row["edge"]["own"] or {}, row["edge"]["left"] or {}
    sizes = {}
    for kind, shift in (("own", own), ("left", left)):
        for key in ("corner_um", "corner_px", "seen_um", "seen_px", "rms_um", "rms_px"):
            sizes[f"{kind}_{key}"] = shift.get(key)
    return {key: value for key, value in row.items() if key != "edge"} | sizes


def _component_tables(found):
    if not found:
        return {}
    keys = ("eigenvalues", "share_percent", "cumulative_percent", "values")
    shares = [
        {"component": number, **dict(zip(keys, values, strict=True))}
        for number, values in enumerate(zip(*(found[key] for key in keys), strict=True), 1)
    ]
    loadings = [
        {"parameter": name} | {f"Y{number}": value for number, value in enumerate(row, 1)}
        for name, row in zip(found["names"], found["loadings"], strict=True)
    ]
    return {"components.csv": shares, "loadings.csv": loadings}


def _dropped_rows(one):
    """One row for each parameter that is kept."""
    points = one["points"] or {}
    of_set = {
        "without": " ".join(one["names"]),
        "because": " ".join(one["because"]),
        "comparable": one["comparable"],
        "sigma0": one["sigma0"],
        "points_rms_mm": points.get("rms_mm"),
        "points_largest_mm": points.get("largest_mm"),
        "points_largest_sds": points.get("largest_sds"),
        "volume_change_m3": one["volume_change_m3"],
        "volume_u_m3": one["volume_u_m3"],
    }
    keys = ("sds_predicted", "values_predicted", "sds_adjusted", "values_adjusted")
    for i, name in enumerate(one["kept"]):
        values = {key: (one[key][i] if i < len(one[key] or ()) else None) for key in keys}
        yield of_set | {"parameter": name} | values
