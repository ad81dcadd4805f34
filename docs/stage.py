"""Stages the pages of the site: those of docs/, the executed notebooks, the API (`make site`).

    python docs/stage.py build/site-source build/notebooks

Markdown pages are copied as they are, so that links between them hold on a plain git host and on
the site; a link to a file that has no page becomes plain text. A notebook becomes a page of its
texts, code and results; one that was not executed is shown without results, and that is told. The
page of the benchmarks shows the last `make bench` here, or else the run that it was kept with.
"""

import base64
import json
import re
import shutil
import sys
from importlib import import_module
from pathlib import Path

from tankcal.report.markdown import formula

ROOT = Path(__file__).resolve().parent.parent
LINK = re.compile(r"(!?)\[((?:[^\[\]]|\[[^\]]*\])*)\]\(([^()\s]+)\)")
MATH = re.compile(r"(?<![\\$])\$([^$\n]+)\$(?!\$)")
RESULTS = ROOT / "build/benchmarks.json"
PAGES = (
    "docs/*.md",
    "docs/studies/*.md",
    "docs/journal/*.md",
    "CHANGELOG.md",
    "CONTRIBUTING.md",
    "examples/*/README.md",
)
REFERENCE = {  # {title: modules of a page of the reference}, in the order of the calculation
    "tankcal": ("tankcal", "tankcal.errors"),
    "The core": ("tankcal.adjust", "tankcal.sections", "tankcal.quadrature", "tankcal.uncertainty"),
    "Solver": ("tankcal.solver",),
    "Geometry": tuple(
        f"tankcal.geometry.{name}"
        for name in (
            "circles",
            "primitives",
            "outlines",
            "field.components",
            "field.amplitudes",
            "field.estimate",
            "rotations",
        )
    ),
    "Distributions and Monte Carlo": ("tankcal.gum.distributions", "tankcal.gum.monte_carlo"),
    "Camera": ("tankcal.camera.model", "tankcal.camera.imaging", "tankcal.camera.comparator"),
    "Survey": ("tankcal.survey", "tankcal.survey.observations"),
    "Tank": tuple(
        f"tankcal.tank.{name}"
        for name in (
            "body",
            "capacity",
            "volumes",
            "solids",
            "heads",
            "bottoms",
            "rules",
        )
    ),
    "Record and papers": ("tankcal.record", "tankcal.report", "tankcal.report.tables"),
    "Calibrations of cameras": ("tankcal.calibration",),
    "Planning": ("tankcal.planning",),
    "Field books": ("tankcal.products.fieldbooks.importing",),
    "Clouds": ("tankcal.clouds", "tankcal.clouds.wall", "tankcal.clouds.inside"),
    "Linter": ("tankcal.products.linter.linting", "tankcal.products.linter.volumes"),
}
# Documented with `tankcal`.
TWICE = {"tankcal.survey": "Adjustment", "tankcal.products.linter.linting": "lint"}


def main(target, executed):
    """Write the source of the site into `target`, anew; executed notebooks stand in `executed`."""
    target, executed = Path(target), Path(executed)
    shutil.rmtree(target, ignore_errors=True)
    notebooks = sorted(ROOT.glob("notebooks/*.ipynb")) + sorted(
        ROOT.glob("notebooks/studies/*.ipynb")
    )
    pages = sorted(path for pattern in PAGES for path in ROOT.glob(pattern))
    staged = {path.resolve() for path in (*pages, *notebooks)}
    for path in pages:
        text = path.read_text(encoding="utf-8")
        if path == ROOT / "docs/index.md":
            text = from_root(with_contents(text, notebooks))
            put(target / "index.md", with_links(text, ROOT, staged))
            continue
        if path == ROOT / "docs/studies/index.md":
            text += "\n" + contents("Studies", [goal for _, _, goal in LINK.findall(text)])
        if path == ROOT / "docs/studies/benchmarks.md" and RESULTS.exists():
            text = with_results(text)
        put(target / path.relative_to(ROOT), with_links(text, path.parent, staged))
    shutil.copytree(ROOT / "docs/images", target / "docs/images")
    for path in notebooks:
        inside = path.relative_to(ROOT / "notebooks")
        done = executed / inside
        if not done.exists():
            print(f"docs/stage.py: {inside} was not executed: its page has no results")
        page = page_of(done if done.exists() else path, target / "notebooks" / inside)
        put(
            (target / "notebooks" / inside).with_suffix(".md"),
            with_links(page, path.parent, staged),
        )
    put(target / "notebooks.md", list_notebooks(notebooks))
    sys.path.insert(0, str(ROOT / "docs"))
    import gallery  # computes the examples

    gallery.write(target)
    for title, modules in REFERENCE.items():
        put(target / f"api/{slug(title)}.rst", api_page(title, modules))


def put(path, text):
    """Write a page and the folder that it stands in."""
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text, encoding="utf-8")


def with_results(text):
    """The page of the benchmarks with the tables of the last `make bench` here."""
    sys.path.insert(0, str(ROOT / "benchmarks"))
    from guard import RELEASED
    from page import filled

    results, released = (json.loads(one.read_text(encoding="utf-8")) for one in (RESULTS, RELEASED))
    return filled(text, results, released)


def slug(title):
    """The name of the file of a page with this title."""
    return title.lower().replace(" ", "-")


def with_links(text, folder, staged):
    """The text with its links to notebooks led to their pages, and those to bare files left out."""

    def led(match):
        picture, words, goal = match.groups()
        if picture or re.match(r"[a-z]+:|#", goal):
            return match[0]
        file, _, anchor = goal.partition("#")
        path = (folder / file).resolve()
        if path not in staged:
            return words
        file = re.sub(r"\.ipynb$", ".md", file)
        return f"[{words}]({file}{'#' + anchor if anchor else ''})"

    return LINK.sub(led, text)


def with_contents(text, notebooks):
    """The first page with the contents of the site: pages by kind, gallery, API, examples."""
    parts = []
    for heading, body in re.findall(r"^## (.+)\n((?:(?!^## ).*\n?)*)", text, flags=re.M):
        names = [goal for _, _, goal in LINK.findall(body) if goal.endswith(".md")]
        parts.append(contents(heading, names))
    parts.append(contents("Gallery", ["../gallery.md", "../notebooks.md"]))
    parts.append(contents("API reference", [f"../api/{slug(title)}.rst" for title in REFERENCE]))
    examples = [f"../{p.relative_to(ROOT)}" for p in sorted(ROOT.glob("examples/*/README.md"))]
    parts.append(contents("Examples", examples))
    return text + "\n" + "\n".join(parts)


def from_root(text):
    """The first page as it stands a folder higher."""

    def led(match):
        goal = match[2]
        return f"{match[1]}{goal[3:] if goal.startswith('../') else 'docs/' + goal}"

    return re.sub(r"(\]\(|^)((?:\.\./)?[\w/.-]+\.(?:md|rst|png))", led, text, flags=re.M)


def contents(caption, names):
    """A hidden table of contents, which the sidebar shows."""
    return "\n".join(["```{toctree}", ":hidden:", f":caption: {caption}", "", *names, "```", ""])


def page_of(path, target):
    """Markdown of a notebook; its pictures are written beside `target`."""
    cells = json.loads(path.read_text(encoding="utf-8"))["cells"]
    parts, pictures = [], 0
    if not title_of(cells):
        parts.append(f"# {name_of(path)}")
    for cell in cells:
        source = "".join(cell["source"])
        if cell["cell_type"] == "markdown":
            parts.append(MATH.sub(in_mathml, source))
            continue
        if cell["cell_type"] != "code" or not source.strip():
            continue
        parts.append(fenced(source, "python"))
        for output in cell["outputs"]:
            text, picture, ending = shown(output)
            if picture:
                pictures += 1
                name = f"{target.stem}-{pictures}.{ending}"
                target.parent.mkdir(parents=True, exist_ok=True)
                (target.parent / name).write_bytes(picture)
                text = f"![a figure of this notebook]({name})"
            parts.append(text)
    return "\n\n".join(part for part in parts if part) + "\n"


def name_of(path):
    """The title of a notebook that has none: its file's name."""
    return path.stem[3:].replace("_", " ").capitalize()


def title_of(cells):
    """The first heading of a notebook, or None."""
    for cell in cells:
        found = re.match(r"# (.+)", "".join(cell["source"]))
        if cell["cell_type"] == "markdown" and found:
            return found[1]
    return None


def shown(output):
    """(text, picture, ending of its file) of one output of a cell."""
    if output["output_type"] == "stream":
        told = "" if output["name"] == "stderr" else fenced("".join(output["text"]), "text")
        return told, None, None
    if output["output_type"] == "error":
        raise SystemExit(f"docs/stage.py: a cell failed: {output['ename']}: {output['evalue']}")
    data = {kind: "".join(value) for kind, value in output["data"].items() if "json" not in kind}
    if "image/svg+xml" in data:
        return "", data["image/svg+xml"].encode(), "svg"
    if "image/png" in data:
        return "", base64.b64decode(data["image/png"]), "png"
    if "text/html" in data:
        return fenced(data["text/html"], "{raw} html"), None, None
    return fenced(data.get("text/plain", ""), "text"), None, None


def in_mathml(match):
    """A formula of a text as MathML, which every browser sets without the network."""
    return f"<math>{formula(match[1]).mathml}</math>"


def fenced(text, kind):
    """A block that no fence inside it ends."""
    fence = "`" * max(3, *(len(run) + 1 for run in re.findall("`+", text)), 3)
    return f"{fence}{kind}\n{text.rstrip()}\n{fence}"


def list_notebooks(notebooks):
    """A page of all notebooks: picture, title, first sentence."""
    parts = [
        "# Notebooks",
        "Each notebook was executed when this site was built; the results are those of that run.",
    ]
    for path in notebooks:
        cells = json.loads(path.read_text(encoding="utf-8"))["cells"]
        name = path.relative_to(ROOT).with_suffix("")
        parts.append(f"## {title_of(cells) or name_of(path)}")
        picture = ROOT / "docs/images" / f"{path.stem}.png"
        if picture.exists() and path.parent.name == "notebooks":
            parts.append(f"![{name_of(path)}](docs/images/{picture.name})")
        words = next(("".join(c["source"]) for c in cells if c["cell_type"] == "markdown"), "")
        told = re.sub(r"^#.*\n+", "", words).split("\n\n")[0].strip()
        parts.append(LINK.sub(r"\2", MATH.sub(in_mathml, told)))
        parts.append(f"[Open the notebook]({name}.md)")
    return "\n\n".join([*parts, contents("Notebooks", [f"{n}.md" for n in names(notebooks)])])


def names(notebooks):
    """Paths of the notebooks in the source, without their ending."""
    return [path.relative_to(ROOT).with_suffix("") for path in notebooks]


def api_page(title, modules):
    """Page of the reference with the public names of modules."""
    lines = [title, "=" * len(title), ""]
    for module in modules:
        if len(modules) > 1 or module != title:
            lines += [f"``{module}``", "-" * (len(module) + 4), ""]
        lines += [f".. automodule:: {module}", "   :members:"]
        lines += ["   :imported-members:"] if hasattr(import_module(module), "__all__") else []
        lines += [f"   :exclude-members: {TWICE[module]}"] if module in TWICE else []
        lines += ["   :undoc-members:"] if module == "tankcal" else []
        lines += [""]
    return "\n".join(lines)


if __name__ == "__main__":
    main(*sys.argv[1:])
