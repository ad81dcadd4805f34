"""The interior orientation after each adjustment of the influence of calibrations."""

from tankcal.report import blocks, numbers
from tankcal.report.camera.influence import adjusted, label
from tankcal.report.camera.stability import DISTORTION, INTERIOR
from tankcal.report.plain import Column
from tankcal.text.digits import NOTHING


def interiors(paper):
    """The interior parameters after each adjustment."""
    done = [run for run in adjusted(paper) if run["interior"]]
    units = {one["parameter"]: one["unit"] for run in done for one in run["interior"]}
    parts = [[name for name in part if name in units] for part in (INTERIOR, *DISTORTION)]
    forms = {(run["convention"], run["affinity"]) for run in done}
    found = [_interior(paper, done, part, units) for part in parts if part]
    return found if len(forms) < 2 else [*found, _models(paper, done)]


def _models(paper, runs):
    """What the parameters of each run mean: calibrations of different forms stand side by side."""
    rows = [{**run, "run": label(paper, run)} for run in runs]
    columns = [
        Column("run"),
        Column("convention", words="short_conventions"),
        Column("affinity", words="affinities"),
    ]
    return paper.table("models_of_runs", rows, columns)


def _interior(paper, done, names, units):
    rows = []
    for run in done:
        own = {one["parameter"]: one for one in run["interior"]}
        rows.append([label(paper, run), *(_value(paper, own.get(name)) for name in names)])
    heads = [[paper.word("table_headings.run"), ""]]
    heads += [[paper.parameters([name]), numbers.powers(units[name] or "")] for name in names]
    align = ["left", *["right"] * len(names)]
    return blocks.table(heads, rows, paper.word("captions.interiors"), align)


def _value(paper, one):
    if one is None:
        return NOTHING
    if not one["sd"]:
        return paper.plain(one["value"])
    return numbers.concise(one["value"], one["sd"], paper.marks)
