"""The README's pictures of the notebooks: a figure of each executed one (`make picture`)."""

import base64
import io
import json
import sys
from pathlib import Path

import matplotlib
import typst
from PIL import Image

from tankcal.report.blocks import MIME

FIGURES = {  # which of its figures, counted from 0
    "01_main_job": 1,
    "02_adjustment": 0,
    "03_sections_and_volumes": 1,
    "05_uncertainty": 1,
    "06_new_tank": 0,
    "07_planning": 0,
}
WIDTH, HEIGHT, DPI = 420, 200, 220
PAGE = b'#set page(width: auto, height: auto, margin: 2mm)\n#image("figure.svg", width: 165mm)'


def figures_of(path):
    """The figures of an executed notebook, in order."""
    cells = json.loads(path.read_text(encoding="utf-8"))["cells"]
    for output in (output for cell in cells for output in cell.get("outputs", [])):
        data = output.get("data", {})
        block = data.get(MIME, {})
        if "image/png" in data:
            yield Image.open(io.BytesIO(base64.b64decode(data["image/png"])))
        elif block.get("kind") == "figure" and "svg" in block:
            yield _drawn(block["svg"])


def _drawn(svg):
    files = {"main.typ": PAGE, "figure.svg": svg.encode("utf-8")}
    fonts = Path(matplotlib.get_data_path()) / "fonts" / "ttf"
    return Image.open(io.BytesIO(typst.compile(files, font_paths=[fonts], format="png", ppi=DPI)))


def main(executed, target):
    """Write target/<notebook>.png of each notebook in the folder `executed`."""
    for name, number in FIGURES.items():
        figure = list(figures_of(Path(executed) / f"{name}.ipynb"))[number].convert("RGB")
        figure.thumbnail((WIDTH, HEIGHT), Image.Resampling.LANCZOS)
        card = Image.new("RGB", (WIDTH, HEIGHT), "white")
        card.paste(figure, ((WIDTH - figure.width) // 2, (HEIGHT - figure.height) // 2))
        card.quantize(96).save(Path(target) / f"{name}.png", optimize=True)


if __name__ == "__main__":
    main(*sys.argv[1:])
