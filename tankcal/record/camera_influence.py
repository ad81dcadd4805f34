"""What calibrations do to a block, as plain lists and dicts, ready for JSON.

format         "tankcal-camera/2"            kind  "influence"
camera         name of the job's camera that was replaced
states         those asked for: "fixed", "weighted", "free"
calibrations   names, in their order
photos, points numbers of them in the reference
search         {searched (whether blunders were searched in the reference), removed: [{kind, ids
                (names), element, file, row, w}]}: the readings set aside there are left out of
                all runs, and no run searches again, so that all have the same observations
free           names of the parameters that the runs "free" adjust
runs           [RUN], the reference (the job's own settings) first
pairs          [PAIR] of all runs that could be adjusted, the first of the two in the order of
               `runs`; those with the reference (one = 0) come first

RUN
label          "reference", or "NAME, fixed"      calibration  NAME, null for the reference
state          "fixed", "weighted", "free"; null for the reference
outcome        "adjusted", "failed" or "skipped"
message        why it failed (words), else null
skipped        null or {code: "no_sds"}: a calibration without sds cannot be weighted
held           parameters held at a value that is not 0 in a run "weighted", for want of an sd
quality        null or {sigma0, chi2, chi2_low, chi2_high, passed (two-sided, 95 %), redundancy,
                confidence}; sigma0 and passed null: nothing is redundant
images         null or {n, rms_um: [x, y], largest_um, largest_photo, largest_point,
                rms_px: [x, y] or null, largest_px or null}: residuals of the camera's photos
convention, affinity  of the run's parameters; null: it was not adjusted
interior       null or [{parameter, unit, value, sd, start, start_sd}] after and before
                the adjustment; sd 0: held; start_sd null: not given
product        null or the dict of tankcal.record.camera_product: check points
volume         null or {volume_m3, u_m3, U_m3, k, height_m, points (of the wall)}: at the top
volume_failed  null or why there is no volume (words), of a job with a tank
shifts         null or SHIFTS: what the run changes against the reference; null for it

PAIR
one, other     numbers in `runs`: other minus one
...            and the keys of SHIFTS

SHIFTS
points         {n, rms_mm: [x, y, z], largest_mm: [x, y, z], rms_xyz_mm (of the magnitudes),
                largest_xyz_mm, largest_point}
photos         {n, rms_mm: [x, y, z], rms_xyz_mm, largest_xyz_mm, largest_photo,
                rms_arcsec: [x, y, z] (turn about the axes of the image), rms_turn_arcsec,
                largest_turn_arcsec, largest_turn_photo}
aligned        ways of the datum that nothing observes, and that were therefore taken out of the
               differences first (0 to 7)
volume         null or {difference_m3, percent (of that of `one`)}
"""

from dataclasses import asdict

import numpy as np

from tankcal.record.camera_product import as_json as product_as_json
from tankcal.record.camera_versions import FORMAT
from tankcal.record.plain_data import plain


def as_json(influence):
    """The dict of an Influence, as the head of this module describes it."""
    reference = influence.runs[0]
    found = {
        "format": FORMAT,
        "kind": "influence",
        "camera": influence.camera,
        "states": list(influence.states),
        "calibrations": list(influence.calibrations),
        "photos": len(reference.block.photos) if reference.block else 0,
        "points": len(reference.block.points) if reference.block else 0,
        "search": {
            "searched": influence.searched,
            "removed": [
                {
                    "kind": one.kind,
                    "ids": list(one.ids),
                    "element": one.element,
                    "file": one.file,
                    "row": one.row,
                    "w": one.w,
                }
                for one in influence.removed
            ],
        },
        "free": list(influence.free),
        "runs": [_run(number, one, influence) for number, one in enumerate(influence.runs)],
        "pairs": [{"one": one.one, "other": one.other, **_shifts(one)} for one in influence.pairs],
    }
    return plain(found)


def _run(number, run, influence):
    against = [one for one in influence.pairs if (one.one, one.other) == (0, number)]
    return {
        "label": run.label,
        "calibration": run.calibration,
        "state": run.state,
        "outcome": run.outcome,
        "message": run.message,
        "skipped": {"code": run.skipped} if run.skipped else None,
        "held": list(run.held),
        "quality": _quality(run.block),
        "images": _images(run.block),
        "convention": run.block and run.block.form.convention,
        "affinity": run.block and run.block.form.affinity,
        "interior": _interior(run.block),
        "product": product_as_json(run.block.check) if run.block and run.block.check else None,
        "volume": _volume(run.volume),
        "volume_failed": run.volume_failed,
        "shifts": _shifts(against[0]) if against else None,
    }


def _quality(block):
    if block is None:
        return None
    test = block.test
    return {
        "sigma0": block.sigma0,
        "chi2": test.chi2,
        "chi2_low": test.low if test.dof else None,
        "chi2_high": test.high if test.dof else None,
        "passed": bool(test.passed) if test.dof else None,
        "redundancy": int(test.dof),
        "confidence": test.confidence,
    }


def _images(block):
    if block is None or block.images is None:
        return None
    images = block.images
    return {
        "n": images.n,
        "rms_um": 1e3 * images.rms_mm,
        "largest_um": 1e3 * images.largest_mm,
        "largest_photo": images.largest_photo,
        "largest_point": images.largest_point,
        "rms_px": images.rms_px,
        "largest_px": images.largest_px,
    }


def _interior(block):
    if block is None:
        return None
    return [
        {
            "parameter": one.parameter,
            "unit": one.unit,
            "value": one.value,
            "sd": one.sd,
            "start": one.start,
            "start_sd": one.start_sd,
        }
        for one in block.interior
    ]


def _volume(volume):
    if volume is None:
        return None
    rest = asdict(volume)
    return {"volume_m3": rest.pop("value_m3"), **rest}


def _shifts(pair):
    points, photos = pair.points, pair.photos
    arcsec = np.degrees(1.0) * 3600
    return {
        "points": {
            "n": points.n,
            "rms_mm": 1e3 * points.rms_m,
            "largest_mm": 1e3 * points.largest_m,
            "rms_xyz_mm": 1e3 * points.rms_xyz_m,
            "largest_xyz_mm": 1e3 * points.largest_xyz_m,
            "largest_point": points.largest_name,
        },
        "photos": {
            "n": photos.n,
            "rms_mm": 1e3 * photos.rms_m,
            "rms_xyz_mm": 1e3 * photos.rms_xyz_m,
            "largest_xyz_mm": 1e3 * photos.largest_xyz_m,
            "largest_photo": photos.largest_name,
            "rms_arcsec": arcsec * photos.rms_rad,
            "rms_turn_arcsec": arcsec * photos.rms_turn_rad,
            "largest_turn_arcsec": arcsec * photos.largest_turn_rad,
            "largest_turn_photo": photos.largest_turn_name,
        },
        "aligned": pair.aligned,
        "volume": None
        if pair.volume_m3 is None
        else {"difference_m3": pair.volume_m3, "percent": pair.volume_percent},
    }
