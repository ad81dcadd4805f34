"""Clouds read by workers: the same sums, samples and records as in this process; what goes wrong.

Truth: the passes in this process, which `tests/clouds` hold to their own; integers are compared to
the last byte.
"""

import json
import os
import pickle
import signal
import socket
import threading
from dataclasses import replace

import numpy as np
import pytest
from generated_hits import Tool
from job_builder import write_folder
from numpy.testing import assert_array_equal
from scanned_tanks import SCANS, scanned_parts
from written_clouds import UNMOVED, some_wall, write_cloud, write_ptx

import tankcal
from tankcal.clouds import describe_cloud
from tankcal.clouds.inside import ThingCells, sample_things
from tankcal.clouds.inside.bottom import FloorCells, floor_grid, sum_floor_cells
from tankcal.clouds.wall.cells import SUMMED, CellGrid
from tankcal.clouds.wall.start import CylinderSurface
from tankcal.errors import InputError, Problem
from tankcal.messages import message
from tankcal.methods.clouds import cluster
from tankcal.methods.clouds import passes as cloud_cluster
from tankcal.methods.clouds import wall as cloud_wall
from tankcal.methods.clouds.passes import (
    ClusterPasses,
    JobPasses,
    Placing,
    Reading,
    Share,
    Telling,
    open_passes,
)
from tankcal.methods.clouds.readings import CloudFile
from tankcal.record import record_of
from tankcal.survey.registration import ScanSetup
from tankcal.survey.wall_hits import RangingInstrument

distributed = pytest.importorskip("distributed")

GRID = CellGrid(np.linspace(0, 9.5, 20), 60)
SURFACE = CylinderSurface(np.array([10.0, 20.0, 4.0]), 6.5, (1e-3, 2e-3))
BOX = np.array([[0.0, 0.0, -1.0, 10.0, 20.0, 4.0]])
THREADS = {"processes": False, "dashboard_address": ":0", "silence_logs": 50}
QUICK = {"CONNECT_S": 0.5, "ALONE_S": 0.5}


def placing_of(folder):
    """Three files of four scans, two of them in one PTX, with corrections, turns and a box."""
    paths = [write_cloud(folder / f"wall.{kind}", some_wall(5000)) for kind in ("las", "xyz")]
    two = [(some_wall(count, seed=count), UNMOVED) for count in (700, 900)]
    write_ptx(folder / "wall.ptx", two)
    turn = np.radians([0.0, 5.0, 30.0, 200.0])
    rotation = np.array(
        [[[np.cos(a), np.sin(a), 0], [-np.sin(a), np.cos(a), 0], [0, 0, 1]] for a in turn]
    )
    files = []
    for first, path in enumerate([*paths, folder / "wall.ptx"]):
        files.append(CloudFile(path.stem, path.name, describe_cloud(path), 1.0, first, BOX))
    scans = tuple(
        ScanSetup(name, "S", beam_from_m=np.array([0.1, 0.0, 1.0])) for name in ("A", "B", "C", "D")
    )
    tool = RangingInstrument("S", correction=1e-5, correction_m=1e-3)
    return Placing(tuple(files), scans, {"S": tool}, rotation, np.tile([10.0, 20.0, 0.0], (4, 1)))


@pytest.fixture(scope="module")
def placing(tmp_path_factory):
    return placing_of(tmp_path_factory.mktemp("clouds"))


@pytest.fixture(scope="module")
def client():
    """Of two workers that are threads: quick to start."""
    with (
        distributed.LocalCluster(n_workers=2, threads_per_worker=1, **THREADS) as cluster,
        distributed.Client(cluster, set_as_default=False) as found,
    ):
        yield found


def passes_by(client, placing, each=2000):
    return ClusterPasses(client, placing, Telling(), points_each=each)


def assert_same_passes(one, other):
    ours, theirs = one.sample(1000), other.sample(1000)
    assert ours.points().tobytes() == theirs.points().tobytes()
    assert ours.delivered == theirs.delivered
    ours, theirs = one.cells(SURFACE, GRID, 4), other.cells(SURFACE, GRID, 4)
    for name in SUMMED:
        assert getattr(ours, name).tobytes() == getattr(theirs, name).tobytes(), name
    assert_array_equal(one.left_out, other.left_out)
    assert one.left_out.min() > 0


@pytest.mark.slow
@pytest.mark.parametrize("each", [300, 4999, 10**6])
def test_workers_and_pieces_change_no_byte(client, placing, each):  # invariance
    assert_same_passes(passes_by(client, placing, each), JobPasses(placing))


@pytest.mark.slow
def test_workers_change_no_byte_of_the_inside(client, placing):  # invariance
    floor = floor_grid(SURFACE, 0.0, 4.0)
    inside = (True, True, False, True)
    ours = passes_by(client, placing).gather(sum_floor_cells, floor, inside)
    theirs = JobPasses(placing).gather(sum_floor_cells, floor, inside)
    for name in FloorCells.NAMES:
        assert getattr(ours, name).tobytes() == getattr(theirs, name).tobytes(), name
    assert ours.scan_counts.any(axis=(1, 2)).sum() <= 3
    rng = np.random.default_rng(1)
    label = rng.integers(3, size=(floor.across, floor.across, floor.levels))
    cells = ThingCells(floor, label, np.full(label.shape[:2], -1e9), inside)
    ours = passes_by(client, placing).gather(sample_things, cells).samples
    theirs = JobPasses(placing).gather(sample_things, cells).samples
    assert [one.points().tobytes() for one in ours] == [one.points().tobytes() for one in theirs]
    assert sum(len(one.points()) for one in ours) > 0


@pytest.mark.slow
def test_chunks_change_no_byte(placing, monkeypatch):  # invariance: no rounding hangs on a number
    whole = JobPasses(placing)
    from tankcal.methods.clouds import passes as cloud_passes

    def by_few(*args, **settings):
        return tankcal.clouds.read_cloud(*args, chunk=501, **settings)

    sample, cells = whole.sample(1000), whole.cells(SURFACE, GRID, 4)
    monkeypatch.setattr(cloud_passes, "read_cloud", by_few)
    assert whole.sample(1000).points().tobytes() == sample.points().tobytes()
    assert whole.cells(SURFACE, GRID, 4).sums.tobytes() == cells.sums.tobytes()


def test_points_are_turned_and_moved(placing):  # a second method: a product of matrices
    share = placing.shares()[1]
    (scan, found), *_ = placing.points([share], placing.tally())
    own = some_wall(5000)
    beam = own - [0.1, 0.0, 1.0]
    length = np.linalg.norm(beam, axis=1)[:, None]
    beam *= (length + 1e-3) * (1 + 1e-5) / length
    expected = beam @ placing.rotation[scan].T + placing.place_m[scan]
    box = np.all((expected >= BOX[0, :3]) & (expected <= BOX[0, 3:]), axis=1)
    np.testing.assert_allclose(found, expected[~box], atol=1e-12)


def test_workers_tell_how_far_they_are(client, placing):
    told = []
    telling = Telling(None, lambda *args: told.append(args))
    telling.step("first pass")
    ClusterPasses(client, placing, telling, points_each=2000).sample(100)
    assert told
    assert all(text == "first pass" and 0 <= read <= about for text, read, about in told)


def test_shares_that_lost_points_are_told(placing):
    tally = placing.tally()
    tally.read[:] = [4999, 5000, 1600]
    with pytest.raises(InputError, match=r"wall\.las: declares 5000 points and holds 4999"):
        tally.check(placing)


@pytest.mark.slow
def test_a_problem_of_a_file_comes_from_a_worker_in_its_words(client, placing, tmp_path):
    path = write_cloud(tmp_path / "wall.xyz", some_wall(500))
    path.write_text(path.read_text().replace("\n", "\nx y z\n", 1))
    file = replace(placing.files[1], header=describe_cloud(path))
    spoilt = replace(placing, files=(placing.files[0], file, placing.files[2]))
    with pytest.raises(InputError, match="row 2") as caught:
        passes_by(client, spoilt, 100).sample(100)
    assert caught.value.problems[0].expected.code == "cloud_file_number"


def test_an_input_error_is_pickled_with_its_problems():
    error = InputError([Problem("a.csv", message("one", "one {n}", n=1), 3), Problem("b", "two")])
    found = pickle.loads(pickle.dumps(error))
    assert found.problems == error.problems
    assert str(found) == str(error)
    assert found.problems[0].expected.values == {"n": 1}


def test_a_file_that_a_worker_has_not_is_told_with_its_path(placing, tmp_path):
    header = replace(placing.files[0].header, path=tmp_path / "elsewhere.las")
    moved = replace(placing, files=(replace(placing.files[0], header=header),))
    with pytest.raises(InputError, match="same path on all machines"):
        cloud_cluster._tally_of(moved, Share(0), "topic", 0)


def refusal(placing, cluster):
    with (
        pytest.raises(InputError) as caught,
        open_passes(placing, Reading(cluster), Telling()),
    ):
        pass
    (problem,) = caught.value.problems
    assert problem.file == "--cluster"
    return problem.expected.code


@pytest.fixture
def quick(monkeypatch):
    for name, seconds in QUICK.items():
        monkeypatch.setattr(cluster, name, seconds)


@pytest.mark.parametrize("speech", [b"", b"HTTP/1.1 400 Bad Request\r\n\r\n", None])
def test_a_port_that_is_none_of_dask(placing, quick, speech):
    with socket.create_server(("127.0.0.1", 0)) as server:

        def answer():
            with server.accept()[0] as stream:
                if speech is not None:
                    stream.sendall(speech)
                    return
                threading.Event().wait(2)

        threading.Thread(target=answer, daemon=True).start()
        address = f"127.0.0.1:{server.getsockname()[1]}"
        assert refusal(placing, address) == "cluster_no_answer"


@pytest.mark.parametrize("address", ["127.0.0.1:1", "foo://x:1", "a:", "tcp://x:notaport", ":1"])
def test_an_address_that_does_not_answer(placing, quick, address):
    assert refusal(placing, address) == "cluster_no_answer"


def test_without_the_library(placing, monkeypatch):
    monkeypatch.setattr(cluster.importlib.util, "find_spec", lambda name: None)
    assert refusal(placing, 2) == "cluster_no_library"
    with open_passes(placing, Reading("auto"), Telling()) as passes:
        assert isinstance(passes, JobPasses)


@pytest.mark.slow
def test_a_scheduler_without_workers(placing, quick):
    with distributed.LocalCluster(n_workers=0, protocol="tcp", **THREADS) as it:
        assert refusal(placing, it.scheduler_address) == "cluster_no_workers"


@pytest.mark.slow
def test_workers_that_all_go(placing, quick, monkeypatch):
    with (
        distributed.LocalCluster(n_workers=0, **THREADS) as cluster,
        distributed.Client(cluster, set_as_default=False) as client,
        pytest.raises(InputError, match="has no workers"),
    ):
        passes_by(client, placing).sample(100)


def test_local_workers_where_they_pay(placing, monkeypatch):
    monkeypatch.setattr(cloud_cluster, "count_cores", lambda: 4)
    assert cloud_cluster._workers_for(placing, "auto") == 0
    assert cloud_cluster._workers_for(placing, "local") == 4
    monkeypatch.setattr(cloud_cluster, "PAYS", 10_000)
    assert cloud_cluster._workers_for(placing, "auto") == 4
    monkeypatch.setattr(cloud_cluster, "count_cores", lambda: 2)
    assert cloud_cluster._workers_for(placing, "auto") == 0


@pytest.mark.slow
def test_a_worker_that_dies_changes_no_byte(placing):
    killed = []

    class Killing(Telling):
        def tell(self, read, about):
            if not killed:
                killed.append(pids.pop())
                os.kill(killed[0], signal.SIGKILL)

    with open_passes(placing, Reading(2), Killing()) as passes:
        pids = [*passes.client.run(os.getpid).values()]
        passes.points_each = 300
        assert_same_passes(passes, JobPasses(placing))
    assert killed


@pytest.mark.slow
def test_a_scheduler_that_dies_is_told(placing):
    import subprocess
    import sys

    port = str(_free_port())
    command = [sys.executable, "-m", "distributed.cli.dask_scheduler"]
    scheduler = subprocess.Popen(
        [*command, "--host", "127.0.0.1", "--port", port, "--no-dashboard"],
        stderr=subprocess.DEVNULL,
    )
    try:
        with distributed.Client(f"127.0.0.1:{port}", timeout=15, set_as_default=False) as client:

            class Killing(Telling):
                def tell(self, read, about):
                    scheduler.kill()

            passes = ClusterPasses(client, placing, Killing())
            with pytest.raises(InputError, match="--cluster"):
                passes.sample(100)
    finally:
        scheduler.kill()
        scheduler.wait()


def _free_port():
    with socket.create_server(("127.0.0.1", 0)) as server:
        return server.getsockname()[1]


@pytest.mark.slow
def test_a_record_has_the_same_bytes_with_any_workers(tmp_path, monkeypatch):
    tool = Tool(offset_m=3e-4, scale=5e-6, bias_m=5e-4, sd_m=1e-3, sd_rad=5e-5)
    scans = {name: replace(one, tool=tool) for name, one in SCANS.items()}
    parts = scanned_parts(np.random.default_rng(3), scans)
    folder = write_folder(tmp_path / "job", parts)
    monkeypatch.setattr(cloud_wall, "MOST_READINGS", 400)
    job, found = tankcal.load(folder), set()
    for workers, each in ((0, 1000), (1, 10_000), (2, 3000), (3, 30_000)):
        monkeypatch.setattr(cloud_cluster, "FEWEST_EACH", each)
        monkeypatch.setattr(cloud_cluster, "MOST_EACH", each)
        result = tankcal.run(job, cluster=workers, simulated=False)
        record = {**record_of(result), "created": ""}
        found.add(json.dumps(record, sort_keys=True, default=str))
    assert len(found) == 1
