"""Time of corrections for trim and list: 82 000 triangles, 7 trims, 5 lists, about 1000 soundings.

    python benchmarks/ships.py

The goal: seconds, uncertainties of every volume and correction included.
"""

import os
import sys
import tempfile
import time
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests" / "support"))

import trimesh
from job_builder import write_job
from measured import Row, tell

import tankcal

SETTINGS = {
    "table.step_m": 0.05,
    "ship.trim_m": [-1.0, 0.0, 1.0, 2.0, 3.0, 4.0, 5.0],
    "ship.list_deg": [-4.0, -2.0, 0.0, 2.0, 4.0],
    "ship.length_between_marks_m": 100.0,
    "ship.pipe_bottom_m": [0.0, 0.0, -9.9],
    "ship.pipe_top_m": [0.5, 0.0, 14.0],
    "ship.correction_step_m": 0.02,
}
UNCERTAINTY = [
    ("scale", 100, "ppm"),
    ("surface", 2, "mm"),
    ("datum", 2, "mm"),
    ("trim", 20, "mm"),
    ("list", 0.1, "deg"),
    ("pipe_x", 50, "mm"),
    ("pipe_y", 50, "mm"),
    ("pipe_lean", 2, "mm/m"),
]


def main():
    """A row with triangles and the shape of the corrections."""
    mesh = trimesh.creation.icosphere(subdivisions=6, radius=10.0)
    with tempfile.TemporaryDirectory() as folder:
        job = tankcal.load(
            write_job(
                Path(folder) / "job",
                kind="mesh",
                mesh=mesh.export(file_type="stl"),
                settings=SETTINGS,
                uncertainty=UNCERTAINTY,
            )
        )
        start = time.process_time()
        result = tankcal.run(job, simulated=False)
    seconds = time.process_time() - start
    shape = " x ".join(map(str, result.ship.state.shape))
    tell(Row("ship, trim and list", f"{len(mesh.faces)} triangles, {shape}", (seconds,)))


if __name__ == "__main__":
    main()
