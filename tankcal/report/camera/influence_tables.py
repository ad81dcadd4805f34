"""The CSV tables of the influence of calibrations on a survey."""


def tables(result):
    """Rows of the CSV files."""
    return {
        "runs.csv": [_run_row(run) for run in result["runs"]],
        "pairs.csv": [
            {key: result["runs"][pair[key]]["label"] for key in ("one", "other")} | _moved(pair)
            for pair in result["pairs"]
        ],
        "cameras.csv": [
            {"run": run["label"], **one} for run in result["runs"] for one in run["interior"] or []
        ],
        "axes.csv": [
            {"run": run["label"]} | {key: row[key] for key in row if key != "precision"}
            for run in result["runs"]
            for row in (run["product"] or {}).get("axes", [])
        ],
    }


def _run_row(run):
    quality = run["quality"] or {}
    row = {"run": run["label"]}
    row |= {key: run[key] for key in ("calibration", "state", "outcome", "message")}
    row |= {key: quality.get(key) for key in ("sigma0", "chi2", "redundancy", "passed")}
    row |= {key: (run["volume"] or {}).get(key) for key in ("volume_m3", "U_m3", "k", "height_m")}
    return row | _moved(run["shifts"])


def _moved(shift):
    points, photos = (shift or {}).get("points", {}), (shift or {}).get("photos", {})
    volume = (shift or {}).get("volume") or {}
    row = {}
    for what, of in (("points", points), ("photos", photos)):
        values = of.get("rms_mm") or [None] * 3
        row |= {f"{what}_rms_{axis}_mm": v for axis, v in zip("xyz", values, strict=True)}
        row[f"{what}_largest_mm"] = of.get("largest_xyz_mm")
    row["photos_rms_turn_arcsec"] = photos.get("rms_turn_arcsec")
    row["volume_difference_m3"] = volume.get("difference_m3")
    row["volume_difference_percent"] = volume.get("percent")
    return row
