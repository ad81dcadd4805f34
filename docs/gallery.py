"""The gallery of the site: each example, computed when the site is built, with picture and result.

    python docs/gallery.py build/site-source

`docs/stage.py` calls `write`; no figure of the gallery is typed, so none can become stale.
"""

import sys
import warnings
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
EXAMPLES = (  # folder, title, measurement, page of the method, notebook
    ("silva-1995", "Points of the wall", "points on sections of the wall", "start", "01_main_job"),
    ("total-station", "Total station", "set-ups round the tank", "adjustment", "02_adjustment"),
    ("silva-1995-photos", "Photographs", "photographs of targets, tapes", "camera", "04_camera"),
    ("strapping", "Straps", "circumferences by tape", "strapping", "08_strapping"),
    (
        "reference-line",
        "Reference lines",
        "a strapped course, offsets from lines of an optical plummet",
        "reference-lines",
        "09_reference_lines",
    ),
    ("wall-hits", "Bare wall", "hits of the wall without targets", "wall-hits", "10_wall_hits"),
    ("tangents", "Tangents", "both limbs from a traverse", "tangents", "11_tangents"),
    ("cloud", "Point clouds", "scans from inside, with targets", "clouds-job", "12_clouds"),
    ("liquid", "Straps and liquid", "straps, runs through a meter", "liquid-job", "13_liquid"),
    ("liquid-lying", "Liquid alone", "a buried tank, metered batches", "liquid-job", "13_liquid"),
    (
        "partial",
        "Former radii",
        "a former table, a course strapped again",
        "partial",
        "16_partial_survey",
    ),
    ("rings", "Horizontal tank", "circumferences of each ring", "rings", None),
    ("sphere-straps", "Sphere", "equator and meridians by tape", "spheres", None),
    ("ship", "Ship tank", "a closed mesh, trim and list", "ships", None),
)
WALLS = ("silva-1995", "total-station", "silva-1995-photos", "wall-hits", "tangents", "cloud")
OTHERS = {  # folders without a capacity table of their own, and their pages
    "compare": "compare",
    "former-table": "read-table",
    "gauge": "gauge",
    "inspection": "inspection",
    "pessoa-2017": "camera",
    "plan-silva": "planning",
    "plan-liquid": "planning",
    "plan-reference-line": "planning",
    "plan-tangents": "planning",
    "plan-triangulation": "planning",
    "plan-wall-hits": "planning",
    "upkeep": "upkeep",
}
HEAD = """# Gallery

Each example was computed when this site was built; the results are of that run. To compute an
example, use `tankcal run examples/NAME`.
"""
DOMINANT = 3  # inputs that are named


def write(target, examples=EXAMPLES):
    """Write gallery.md and its pictures into the source of the site; the texts of its examples."""
    target = Path(target)
    (target / "gallery").mkdir(parents=True, exist_ok=True)
    texts = [text_of(*example, target / "gallery") for example in examples]
    others = "\n".join(
        f"- [{title_of(folder)}](examples/{folder}/README.md): [method](docs/{page}.md)"
        for folder, page in OTHERS.items()
    )
    page = "\n".join([HEAD, *texts, f"## More examples\n\n{others}\n"])
    (target / "gallery.md").write_text(page, encoding="utf-8")
    return texts


def text_of(folder, title, measured, page, notebook, pictures):
    """A picture and ten lines of an example; computes it and draws the picture."""
    import tankcal

    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        job = tankcal.load(ROOT / "examples" / folder)
        result = tankcal.run(job)
        figure = result.plot("field" if folder in WALLS else "capacity")
    figure.savefig(pictures / f"{folder}.svg", bbox_inches="tight", metadata={"Date": None})
    budget = result.budget()
    lines = sorted(budget.lines, key=lambda line: -line.share)
    dominant = ", ".join(f"`{line.name}` {100 * line.share:.0f} %" for line in lines[:DOMINANT])
    full, half = result.at(budget.high_m), result.at(budget.high_m / 2)
    links = [
        f"[files](examples/{folder}/README.md)",
        f"[method](docs/{page}.md)",
        *([f"[notebook](notebooks/{notebook}.md)"] if notebook else []),
    ]
    rows = [
        f"**Measured:** {measured}",
        f"**Result at {budget.high_m:g} m:** {full}",
        f"**U of this volume:** {100 * full.U_m3 / full.value_m3:.3f} %",
        f"**At half the height:** {half}",
        f"**Dominant inputs:** {dominant}",
        f"**If `{lines[0].name}` were halved:** U falls to {100 * lines[0].halved:.0f} %",
        f"**Command:** `tankcal run examples/{folder}`",
        f"**More:** {' · '.join(links)}",
    ]
    listed = "\n".join(f"- {row}" for row in rows)
    return f"## {title}\n\n![{title}](gallery/{folder}.svg)\n\n{listed}\n"


def title_of(folder):
    """First heading of the page of an example."""
    text = (ROOT / "examples" / folder / "README.md").read_text(encoding="utf-8")
    return text.partition("\n")[0].removeprefix("# ")


if __name__ == "__main__":
    write(sys.argv[1])
