"""A comparison of calibrations as plain lists and numbers, for files and papers.

`as_json(result)` gives

    format, kind  "tankcal-camera/2", "stability"
    method        "mis", "zrot", "rot" or "spr"
    as_published  whether Pessoa's own conventions are followed
    conventions   [{code, ...}], each choice that a figure depends on, in the order of reading:
                  figure_rmse | figure_mean_distance | figure_sigma0 {points, unknowns}
                      sqrt(mean(dx2 + dy2)); mean(hypot(dx, dy)); sqrt(v'v / (2 points - unknowns))
                  focal_as_they_are     image points compared as they are (mis)
                  focal_own             each bundle has its own focal length (rot, spr)
                  focal_scaled {of, to} second set scaled by c of the first / c of the second (zrot)
                  focal_same {of}       both bundles have the focal length of the first set (rot)
                  direction {from, to}  second set brought onto the first; of spr: object points
                                        from the first set, resection of the second
                  pixel {x_um, y_um}    a pixel of this size, each axis by its own side
                  terrain_random {position_m, low_m, range_m, seed, terrains}   (spr)
                  sds_uncorrelated | covariance_known {cameras}       (where expected_px is there)
    grid          {columns, rows, start_px: [x, y], step_px}
    threshold_px  similar when the figure is below it
    terrain       {position_m: [x, y, z], low_m, range_m, seed, terrains}; null but for spr
    cameras       [{name, c_mm, x0_mm, y0_mm, K1_mm-2 ... B, sd: {the same keys: number or null},
                  convention, affinity, radial_balance_mm, format_px: [columns, lines],
                  pixel_um: [x, y]}]
    pairs         rows of the published tables: (2, 1), (3, 1), (3, 2), (4, 1) ... each
                  {a, b          names; a stands before b in the file
                  method
                  figure_px, similar      of spr pooled over the terrains
                  scatter_px     its standard deviation from terrain to terrain (spr), else null
                  largest_px, mean_px, rmse_px    of the lengths of the differences
                  expected_px    figure that the declared sds alone would make; null: no sds
                  scale          of the second set (zrot), else null
                  rotation_deg   [omega, phi, kappa] of the second bundle against the first (rot,
                                 spr), else null
                  shift_m        [x, y, z] of the second projection centre from the first (spr),
                                 else null
                  difference_px  [rows][columns] lengths of the difference vectors, 1e-4 px
                  difference_x_px, difference_y_px  [rows][columns] second set minus first, y up}
"""

import numpy as np

from tankcal.camera.model import PARAMETERS, UNITS
from tankcal.record.camera_versions import FORMAT
from tankcal.record.plain_data import plain

DECIMALS = 4  # of a difference in pixels


def as_json(result):
    """The whole Stability (see above): dicts, lists, texts, numbers and None."""
    grid = result.grid
    return {
        "format": FORMAT,
        "kind": "stability",
        "method": result.method,
        "as_published": result.as_published,
        "conventions": [{"code": one.code, **one.values} for one in result.conventions],
        "grid": {
            "columns": grid.columns,
            "rows": grid.rows,
            "start_px": list(grid.start_px),
            "step_px": grid.step_px,
        },
        "threshold_px": result.threshold_px,
        "terrain": None if result.terrain is None else _terrain(result.terrain, result.seed),
        "cameras": [_camera(setup, result.format_px) for setup in result.setups],
        "pairs": [_pair(pair, result) for pair in result.pairs],
    }


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


def _terrain(terrain, seed):
    return {
        "position_m": list(terrain.position_m),
        "low_m": terrain.low_m,
        "range_m": terrain.range_m,
        "seed": seed,
        "terrains": terrain.drawn,
    }


def _camera(setup, format_px):
    camera = setup.camera
    keys = [f"{name}_{UNITS[name]}" if UNITS[name] else name for name in PARAMETERS]
    return {
        "name": camera.name,
        **dict(zip(keys, np.asarray(camera.values, dtype=float).tolist(), strict=True)),
        "sd": plain(dict(zip(keys, camera.sd, strict=True))),
        "convention": camera.form.convention,
        "affinity": camera.form.affinity,
        "radial_balance_mm": camera.form.radial_balance_mm,
        "format_px": list(format_px),
        "pixel_um": (1000 * np.asarray(setup.pixel_mm)).tolist(),
    }


def _pair(pair, result):
    length = np.hypot(*pair.difference_px.T)
    along, up = (_on_grid(part, result.grid) for part in pair.difference_px.T)
    rotation = None if pair.rotation_rad is None else np.degrees(pair.rotation_rad).tolist()
    return {
        "a": pair.a,
        "b": pair.b,
        "method": result.method,
        "figure_px": pair.figure_px,
        "scatter_px": pair.scatter_px,
        "similar": pair.similar,
        "largest_px": float(length.max()),
        "mean_px": float(length.mean()),
        "rmse_px": float(np.sqrt(np.mean(length**2))),
        "expected_px": pair.expected_px,
        "scale": pair.scale,
        "rotation_deg": rotation,
        "shift_m": None if pair.shift_m is None else list(pair.shift_m),
        "difference_px": _on_grid(length, result.grid),
        "difference_x_px": along,
        "difference_y_px": up,
    }


def _on_grid(values, grid):
    """[rows][columns] of a value for each grid point, which are stored row by row."""
    return np.round(values, DECIMALS).reshape(grid.rows, grid.columns).tolist()
