"""A comparison of calibrations as it is saved: kind "stability" of camera.json.

Codes of `conventions`, each choice that a figure depends on, in the order of reading:

    figure_rmse | figure_mean_distance | figure_sigma0 {points, unknowns}
        sqrt(mean(dx2 + dy2)); mean(hypot(dx, dy)); sqrt(v'v / (2 points - unknowns))
    focal_as_they_are     image points compared as they are (mis)
    focal_own             each bundle has its own focal length (rot, spr)
    focal_scaled {of, to} second set scaled by c of the first / c of the second (zrot)
    focal_same {of}       both bundles have the focal length of the first set (rot)
    direction {from, to}  second set brought onto the first; of spr: object points from the first
                          set, resection of the second
    pixel {x_um, y_um}    a pixel of this size, each axis by its own side
    terrain_random {position_m, low_m, range_m, seed, terrains}   (spr)
    sds_uncorrelated | covariance_known {cameras}       (where expected_px is there)
"""

from dataclasses import make_dataclass
from typing import Literal

import numpy as np

from tankcal.camera.model import PARAMETERS, UNITS
from tankcal.record.camera_versions import CameraFile
from tankcal.record.schema import Saved, filled_from, key, to_plain

DECIMALS = 4  # of a difference in pixels
_KEYS = [f"{name}_{UNITS[name]}" if UNITS[name] else name for name in PARAMETERS]
Interior = make_dataclass(
    "Interior",
    [
        (name, float, key(f"value or sd of {name}", named=one))
        for name, one in zip(PARAMETERS, _KEYS, strict=True)
    ],
    namespace={"__doc__": "Parameters of the camera, each with its unit; of sds null: not known."},
    frozen=True,
)


class ComparisonGrid(Saved):
    """Grid of image points that are compared."""

    columns: int = key("number")
    rows: int = key("number")
    start_px: list[float] = key("x, y of the first")
    step_px: float = key("between neighbours")


class ComparisonTerrain(Saved):
    """Object points that the bundles are brought together by."""

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

    a: str = key("name of the first, which stands before b in the file")
    b: str = key("name of the second")
    method: str = key("as above")
    figure_px: float = key("of spr pooled over the terrains")
    scatter_px: float | None = key("its sd from terrain to terrain (spr)")
    similar: bool = key("whether the figure is below the threshold")
    largest_px: float = key("length of a difference")
    mean_px: float = key("of the lengths")
    rmse_px: float = key("of the lengths")
    expected_px: float | None = key("figure that the declared sds alone would make")
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
    as_published: bool = key("whether Pessoa's own conventions are followed")
    conventions: list[dict] = key("{code, ...}: each choice that a figure depends on")
    grid: ComparisonGrid = key("image points")
    threshold_px: float = key("similar when the figure is below it")
    terrain: ComparisonTerrain | None = key("null but for spr")
    cameras: list[ComparedCamera] = key("as read")
    pairs: list[ComparedPair] = key("(2, 1), (3, 1), (3, 2), (4, 1) ...")


def as_json(result):
    """The `StabilityFile` of a Stability, as plain data."""
    found = filled_from(
        StabilityFile,
        result,
        conventions=[{"code": one.code, **one.values} for one in result.conventions],
        grid=filled_from(ComparisonGrid, result.grid),
        terrain=result.terrain and filled_from(ComparisonTerrain, result.terrain, seed=result.seed),
        cameras=[_camera(setup, result.format_px) for setup in result.setups],
        pairs=[_pair(pair, result) for pair in result.pairs],
    )
    return to_plain(found)


def summary(result):
    """The pairs alone, [{a, b, method, figure_px, scatter_px, similar}], a before b in the file."""
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
    return filled_from(
        ComparedCamera,
        camera,
        **dict(zip(PARAMETERS, np.asarray(camera.values, dtype=float).tolist(), strict=True)),
        sd=Interior(*camera.sd),
        format_px=format_px,
        pixel_um=1000 * np.asarray(setup.pixel_mm),
    )


def _pair(pair, result):
    length = np.hypot(*pair.difference_px.T)
    along, up = (_on_grid(part, result.grid) for part in pair.difference_px.T)
    return filled_from(
        ComparedPair,
        pair,
        method=result.method,
        largest_px=float(length.max()),
        mean_px=float(length.mean()),
        rmse_px=float(np.sqrt(np.mean(length**2))),
        rotation_deg=None if pair.rotation_rad is None else np.degrees(pair.rotation_rad),
        difference_px=_on_grid(length, result.grid),
        difference_x_px=along,
        difference_y_px=up,
    )


def _on_grid(values, grid):
    """[rows][columns] of a value for each grid point, which are stored row by row."""
    return np.round(values, DECIMALS).reshape(grid.rows, grid.columns)
