"""A prediction as plain numbers and texts, units in the keys: what plan.json holds."""

import numpy as np

from tankcal.record.plain_data import plain, plain_problems
from tankcal.record.plan_versions import PLAN


def plain_of(prediction):
    """{key: value} of a Prediction, ready for JSON: NaN and infinity are null."""
    plan, table, stated = prediction.plan, prediction.table, prediction.tabled.stated
    return plain(
        {
            "format": PLAN.format,
            "tank": plan.job.tank.id,
            "side": plan.job.survey.side,
            "survey": _survey(prediction),
            "limit": {
                "relative_u": plan.limits.relative_u,
                "of": plan.limits.of,
                "predicted": prediction.relative_u,
                "met": prediction.meets,
            },
            "table": {
                "height_m": table.height_m,
                "volume_m3": table.volume_m3,
                "u_m3": table.u_m3,
                "k": table.k,
                "U_m3": table.U_m3,
            },
            "sources": [
                {"input": one.kind, "u_top_m3": float(np.linalg.norm(one.columns_m3[-1]))}
                for one in table.sources
            ],
            "worst_deliveries": [_worst(one) for one in stated.worst],
            "sections": [vars(one) for one in prediction.sections],
            "points": [vars(one) for one in prediction.points],
            "precision": _precision(prediction.precision),
            "reliability": [vars(one) for one in prediction.reliability],
            "warnings": plain_problems(prediction.warnings),
        }
    )


def _survey(prediction):
    plan, datum = prediction.plan, prediction.datum
    solution = prediction.predicted.adjusted.solution
    return {
        "photo_stations": len(plan.stations),
        "photographs": len(plan.photos),
        "setups": len(plan.setups),
        "ties": len(plan.ties),
        "control_points": len(plan.known),
        "targets": len(plan.targets.names),
        "observations": solution.rows,
        "unknowns": solution.unknowns,
        "redundancy": solution.dof,
        "datum": {
            "choice": datum.choice,
            "defect": datum.defect,
            "words": datum.words,
            "held": datum.held,
            "vertical": datum.vertical,
            "scale": datum.scale,
        },
    }


def _worst(one):
    return {"minimum_m": one.minimum_m, **vars(one.relative)}


def _precision(one):
    return {
        "mean_sd_m": one.mean_sd_m,
        "axis_sd_m": one.axis_sd_m,
        "range_m": one.range_m,
        "proportional": one.proportional,
    }


def simulated_plain(found):
    """{key: value} of a `simulations.Simulated`, ready for JSON."""
    return plain(
        {
            "seed": found.seed,
            "blunders": found.blunders,
            "runs": found.runs,
            "failed": found.failed,
            "coordinates_scatter_over_predicted": found.ratio,
            "volume_scatter_over_predicted": found.volume_ratio,
            "volume_scatter_over_predicted_sd": found.volume_ratio_sd,
            "set_aside": found.set_aside,
            "volumes_m3": found.volumes_m3,
        }
    )
