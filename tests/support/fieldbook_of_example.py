"""The readings of the example of wall hits as a survey of `written_fieldbooks`."""

import csv
import datetime

from written_fieldbooks import Aim, Stand


def survey_of(folder):
    """The one set-up of a job, its hits with the code WALL, or CHECK where only compared."""
    aims = []
    for table in ("wall_hits", "control_readings"):
        with (folder / f"{table}.csv").open(encoding="utf-8") as file:
            for number, row in enumerate(csv.DictReader(file), 1):
                code = "" if "target" in row else "CHECK" if row["use"] else "WALL"
                values = (float(row[key]) for key in ("direction_deg", "zenith_deg", "distance_m"))
                time = datetime.datetime.fromisoformat(row["time"])
                aims.append(Aim(row.get("target", str(number)), *values, code=code, time=time))
    return [Stand("SI", 1.573, (0.0, 0.0, 0.0), tuple(aims))]
