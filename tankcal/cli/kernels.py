"""`python -m tankcal.cli.kernels`: compile the loops once, at installation, for all users.

The compiled loops are saved beside the sources for this kind of processor. A write-protected
installation reads them from there. A small photogrammetric survey and a small table require every
loop of a large computation.
"""

import os
import sys
from pathlib import Path

import numpy as np

from tankcal.messages import message

ROWS = 3000  # rows of a table whose breakpoints are searched by compiled loops


def main():
    """Compile the loops that are not saved yet, print the result, and return the exit status."""
    os.environ["TANKCAL_COMPILED"] = "1"
    from tankcal.products.exports.breakpoints import best_breakpoints, fewest_breakpoints
    from tankcal.solver.compiled import available, mark_as_kept
    from tankcal.survey.network import adjust

    if not available():
        text = message("kernels_no_numba", "numba is not installed: no loop was compiled")
        print(text, file=sys.stderr)
        return 1
    adjusted = adjust(small_survey())
    adjusted.residuals  # noqa: B018 (its computation needs further loops)
    adjusted.point_covariances_m2  # noqa: B018
    adjusted.covariance_m2()
    height_m = np.linspace(0.0, 10.0, ROWS)
    volume_m3 = 100.0 * height_m + np.sin(height_m)
    best_breakpoints(height_m, volume_m3, 10)
    fewest_breakpoints(height_m, volume_m3, 0.1)
    package = Path(__file__).parents[1]
    kept = sorted(package.glob("**/__pycache__/*.nbc"))
    if not mark_as_kept():
        text = message(
            "kernels_not_kept",
            "{folder} is write-protected: the compiled loops were not saved",
            folder=package,
        )
        print(text, file=sys.stderr)
        return 1
    text = message(
        "kernels_kept",
        "{count} compiled loops are saved in {folder}",
        count=len(kept), folder=package,
    )  # fmt: skip
    print(text)
    return 0


def small_survey():
    """Return a Survey of 16 points in 4 photographs, half of them control, without residuals."""
    from tankcal.camera.model import Form
    from tankcal.survey.network import Camera, Photos, Survey
    from tankcal.survey.observations import ControlCoordinates, ImageCoordinates

    azimuth = np.arange(16) * np.pi / 8
    xyz_m = np.column_stack([np.sin(azimuth), np.cos(azimuth), 0.1 * np.arange(16) - 0.8])
    centres_m = 8.0 * np.array([[1, 0, 0.1], [0, 1, -0.1], [-1, 0, 0.2], [0, -1, -0.2]])
    back = centres_m / np.linalg.norm(centres_m, axis=1)[:, None]
    right = np.cross([0.0, 0.0, 1.0], back)
    right /= np.linalg.norm(right, axis=1)[:, None]
    rotation = np.stack([right, np.cross(back, right), back], axis=1)
    photo, point = np.divmod(np.arange(64), 16)
    u, v, w = np.einsum("nij,nj->in", rotation[photo], xyz_m[point] - centres_m[photo])
    interior = np.zeros(13)
    interior[0] = 50.0
    known = np.repeat(np.arange(8), 3), np.tile(np.arange(3), 8)
    return Survey(
        points=tuple(f"P{i}" for i in range(16)),
        xyz_m=xyz_m,
        image_points=ImageCoordinates(
            -50.0 * np.column_stack([u, v]) / w[:, None], np.full((64, 2), 0.01), point, photo
        ),
        photos=Photos(("A", "B", "C", "D"), np.zeros(4, dtype=int), centres_m, rotation),
        cameras=(Camera(interior, Form(), scope=("block",) + ("off",) * 12),),
        observations=(ControlCoordinates(xyz_m[known], np.full(24, 0.001), *known),),
    )


if __name__ == "__main__":
    sys.exit(main())
