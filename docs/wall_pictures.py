"""The pictures of the wall in docs/uncertainty.md (`make picture`): a field, and its components."""

import sys
from pathlib import Path

import matplotlib
import numpy as np
from matplotlib.figure import Figure
from PIL import Image

import tankcal
from tankcal.geometry.field.components import COMPONENTS, azimuth_correlations
from tankcal.report.plots.style import FAINT, INK, RED, STYLE, WIDTH, set_margins

ROOT = Path(__file__).resolve().parent.parent
DPI, COLOURS, RADIUS_M = 130, 128, 7.5


def components():
    """Profiles up a course, and correlations along the arc."""
    figure = Figure(figsize=(WIDTH, 2.3))
    left, right = figure.subplots(1, 2)
    zeta = np.linspace(-1, 1, 201)
    shown = {"common bulge": (INK, 1), "drawn-in joints": (RED, -1), "own taper": (FAINT, 1)}
    for one in COMPONENTS:
        if one.name in shown:
            colour, sign = shown[one.name]
            profiles = sign * 1e3 * one.median_m * one.height_columns(zeta)
            if one.orders == "joints":  # each as if it were alone
                profiles = profiles * np.sqrt(profiles.shape[1])
            else:
                profiles = profiles[:, :1]
            left.plot(
                profiles, zeta, color=colour, label=[one.name, *["_"] * 9][: profiles.shape[1]]
            )
    left.set(xlabel="radius / mm", ylabel="height in the course", ylim=(-1, 1))
    left.set_yticks([-1, 0, 1], ["joint", "middle", "joint"])
    arc = np.linspace(0, 4, 400)
    along = azimuth_correlations(arc / RADIUS_M, np.zeros(1), RADIUS_M)
    right.plot(arc, along["oval"][:, 0], color=INK, label="ovality")
    right.plot(arc, along["seam"][:, 0], color=RED, label="seams, dents")
    right.set(xlabel="along the arc / m", ylabel="correlation", xlim=(0, 4))
    for ax in (left, right):
        ax.grid(True)
        ax.legend(frameon=False, fontsize=7.5)
    set_margins(figure, left=0.75, right=0.12, bottom=0.42, top=0.08, wspace=0.35)
    return figure


def main(target):
    """Write target/wall-field.png and target/wall-components.png."""
    result = tankcal.run(tankcal.load(ROOT / "examples" / "silva-1995"), simulated=False)
    with matplotlib.rc_context(STYLE):
        figures = {"wall-field": result.plot("field"), "wall-components": components()}
        for name, figure in figures.items():
            path = Path(target) / f"{name}.png"
            figure.savefig(path, dpi=DPI)
            Image.open(path).convert("RGB").quantize(COLOURS).save(path, optimize=True)


if __name__ == "__main__":
    main(*sys.argv[1:])
