"""Comparison of calibrations: kind "stability" of camera.json.

Codes of `conventions`, the choices on which a figure depends, in their order:

    figure_rmse | figure_mean_distance | figure_sigma0 {points, unknowns}
        sqrt(mean(dx2 + dy2)); mean(hypot(dx, dy)); sqrt(v'v / (2 points - unknowns))
    focal_as_they_are     image points compared without scaling (mis)
    focal_own             each bundle has the focal length of its set (rot, spr)
    focal_scaled {of, to} second set scaled by c of the first / c of the second (zrot)
    focal_same {of}       both bundles have the focal length of the first set (rot)
    direction {from, to}  second set transformed to the first; of spr: object points from the first
                          set, resection of the second
    pixel {x_um, y_um}    a pixel of this size, each axis by its side
    terrain_random {position_m, low_m, range_m, seed, terrains}   (spr)
    sds_uncorrelated | covariance_known {cameras}       (if expected_px is given)
"""

from dataclasses import make_dataclass
from typing import Literal

import numpy as np

from tankcal.camera.model import KEYS, PARAMETERS
from tankcal.record.camera_versions import CameraFile
from tankcal.record.schema import Saved, fill_from, key, to_plain

DECIMALS = 4  # of a difference in pixels
Interior = make_dataclass(
    "Interior",
    [
        (name, float, key(f"value or sd of {name}", named=key_in_file))
        for name, key_in_file in KEYS.items()
    ],
    namespace={"__doc__": "Parameters of the camera, each with its unit; of sds null: not known."},
    frozen=True,
)


class ComparisonGrid(Saved):
    """Grid of compared image points."""

    columns: int = key("number")
    rows: int = key("number")
    start_px: list[float] = key("x, y of the first")
    step_px: float = key("between neighbours")


class ComparisonTerrain(Saved):
    """Object points by which the bundles are aligned."""

    position_m: list[float] = key("x, y, z of the projection centre")
    low_m: float = key("lowest height")
    range_m: float = key("of the heights")
    seed: int = key("of the heights")
    terrains: int = key("drawn", of="drawn")


class NameOfCamera(Saved):
    """The first key of a camera."""

    name: str = key("as in the file")


class ComparedCamera(Interior, NameOfCamera):
    """A calibration, as it was read."""

    sd: Interior = key("sds")
    convention: str = key("sign of the distortion's terms", of="form.convention")
    affinity: str = key("form of the affinity terms", of="form.affinity")
    radial_balance_mm: float = key("radius at which distortion is 0", of="form.radial_balance_mm")
    format_px: list[float] = key("columns, lines")
    pixel_um: list[float] = key("sides, x and y")


class ComparedPair(Saved):
    """Two calibrations: second set minus first."""

    a: str = key("name of the first, which is before b in the file")
    b: str = key("name of the second")
    method: str = key("of the comparison")
    figure_px: float = key("of spr pooled over the terrains")
    scatter_px: float | None = key("its sd from terrain to terrain (spr)")
    similar: bool = key("whether the figure is below the threshold")
    largest_px: float = key("length of a difference")
    mean_px: float = key("of the lengths")
    rmse_px: float = key("of the lengths")
    expected_px: float | None = key("figure expected from the declared sds alone")
    scale: float | None = key("of the second set (zrot)")
    rotation_deg: list[float] | None = key("omega, phi, kappa of the second bundle (rot, spr)")
    shift_m: list[float] | None = key("of the second projection centre (spr)")
    difference_px: list[list[float]] = key("rows x columns: lengths, to 1e-4 px")
    difference_x_px: list[list[float]] = key("rows x columns")
    difference_y_px: list[list[float]] = key("rows x columns, y up")


class StabilityFile(CameraFile, kw_only=True):
    """A comparison of calibrations."""

    kind: Literal["stability"] = key("stability", default="stability")
    method: str = key('"mis", "zrot", "rot" or "spr"')
    as_published: bool = key("whether Pessoa's conventions are followed")
    conventions: list[dict] = key("{code, ...}: choices on which a figure depends")
    grid: ComparisonGrid = key("image points")
    threshold_px: float = key("similar when the figure is below it")
    terrain: ComparisonTerrain | None = key("null but for spr")
    cameras: list[ComparedCamera] = key("as read")
    pairs: list[ComparedPair] = key("(2, 1), (3, 1), (3, 2), (4, 1) ...")


def plain_stability(result):
    """Return the `StabilityFile` of a Stability, as plain data."""
    file = fill_from(
        StabilityFile,
        result,
        conventions=[{"code": choice.code, **choice.values} for choice in result.conventions],
        grid=fill_from(ComparisonGrid, result.grid),
        terrain=result.terrain and fill_from(ComparisonTerrain, result.terrain, seed=result.seed),
        cameras=[_camera(setup, result.format_px) for setup in result.setups],
        pairs=[_pair(pair, result) for pair in result.pairs],
    )
    return to_plain(file)


def summary(result):
    """Return the pairs, [{a, b, method, figure_px, scatter_px, similar}], a first in the file."""
    return [
        {
            "a": pair.a,
            "b": pair.b,
            "method": result.method,
            "figure_px": pair.figure_px,
            "scatter_px": pair.scatter_px,
            "similar": pair.similar,
        }
        for pair in result.pairs
    ]


def _camera(setup, format_px):
    camera = setup.camera
    return fill_from(
        ComparedCamera,
        camera,
        **dict(zip(PARAMETERS, np.asarray(camera.values, dtype=float).tolist(), strict=True)),
        sd=Interior(*camera.sd),
        format_px=format_px,
        pixel_um=1000 * np.asarray(setup.pixel_mm),
    )


def _pair(pair, result):
    length = np.hypot(*pair.difference_px.T)
    along, up = (_round_to_grid(part, result.grid) for part in pair.difference_px.T)
    return fill_from(
        ComparedPair,
        pair,
        method=result.method,
        largest_px=float(length.max()),
        mean_px=float(length.mean()),
        rmse_px=float(np.sqrt(np.mean(length**2))),
        rotation_deg=None if pair.rotation_rad is None else np.degrees(pair.rotation_rad),
        difference_px=_round_to_grid(length, result.grid),
        difference_x_px=along,
        difference_y_px=up,
    )


def _round_to_grid(values, grid):
    """Return values of the grid points, stored row by row, as [rows][columns]."""
    return np.round(values, DECIMALS).reshape(grid.rows, grid.columns)
