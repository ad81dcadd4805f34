"""Files of a prediction for programs: plan.json, and CSV files with units in their headings."""

from tankcal.record import save
from tankcal.record.plan import plain_of, plain_of_wall
from tankcal.report.planning.rows import place_of_change
from tankcal.text.delimited import write_guarded

PLACE = ("arc_m", "off_m", "height_m")  # position of an added item


def write(paper, folder, fingerprints):
    """Write plan.json and the CSV files of a plan of targets.

    Parameters
    ----------
    paper : PlanPaper
    folder : Path
    fingerprints : list of dict
        {file, sha256} of the files of the empty job, which distinguish it from a completed job.
    """
    plan = plain_of(paper.prediction, paper.simulated, fingerprints)
    save(plan, folder / "plan.json")
    points = [
        [
            point["name"], point["rays"], *map(_mm, point["sd_m"]),
            point["undetermined"], point["weak"],
        ]
        for point in plan["points"]
    ]  # fmt: skip
    sections = [
        [
            section["name"], section["height_m"], section["targets"],
            *map(_mm, section["centre_sd_m"]), _mm(section["radius_sd_m"]),
        ]
        for section in plan["sections"]
    ]  # fmt: skip
    _write_table(folder / "points.csv", "point rays sx_mm sy_mm sz_mm undetermined weak", points)
    headings = "section height_m targets centre_sx_mm centre_sy_mm radius_s_mm"
    _write_table(folder / "sections.csv", headings, sections)
    _write_capacity(plan, folder)
    _write_effects(paper, folder)


def write_wall(paper, folder, fingerprints):
    """Write plan.json and the CSV files of a plan of the bare wall.

    Parameters are those of `write`, with a WallPaper.
    """
    plan = plain_of_wall(paper.prediction, paper.simulated, fingerprints)
    save(plan, folder / "plan.json")
    _write_capacity(plan, folder)
    _write_effects(paper, folder)


def _write_capacity(plan, folder):
    """Write capacity.csv of the plain data of a plan."""
    table = plan["table"]
    _write_table(folder / "capacity.csv", " ".join(table), zip(*table.values(), strict=True))


def _write_effects(paper, folder):
    """Write changes.csv and design.csv, if there are effects or steps."""
    steps = () if paper.design is None else paper.design.steps
    headings = f"action item name {' '.join(PLACE)} cost relative_u difference U_m3 why"
    for name, effects in (("changes.csv", paper.effects), ("design.csv", steps)):
        rows = [
            [
                effect.change.action, effect.change.item, effect.change.name,
                *_place(effect.change), effect.change.cost,
                effect.relative_u, effect.difference, effect.U_m3, effect.why,
            ]
            for effect in effects
        ]  # fmt: skip
        if rows:
            _write_table(folder / name, headings, rows)


def _place(change):
    """Return the position of an added item as texts; "" if it has none."""
    place = place_of_change(change)
    return [f"{place[key]:.3f}" if key in place else "" for key in PLACE]


def _mm(metres):
    return "" if metres is None else f"{1000 * metres:.4f}"


def _write_table(path, headings, rows):
    with open(path, "w", newline="", encoding="utf-8") as file:
        write_guarded(file, [headings.split(), *rows])
