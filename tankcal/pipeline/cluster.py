"""Workers of dask, on this machine or by the address of a scheduler, and what goes wrong with them.

`cloud_cluster` reads clouds by them, `tankcal.batch` computes jobs. All that dask, a network or
another machine comes up with is told in one line.
"""

import contextlib
import importlib.util
import logging
import os
import socket
import struct
import tempfile
import time
import warnings
from urllib.parse import urlsplit

import tankcal
from tankcal.errors import InputError, Problem, TankcalError, reason_of
from tankcal.messages import message
from tankcal.version import install_command

OPTION = "--cluster"
WORKER_BYTES = 1 << 30  # of memory that a worker of this machine may take
LENGTH, LONGEST_GREETING = struct.Struct("<Q"), 1 << 20  # bytes of the first message of a scheduler
DEAF = "import signal\nsignal.signal(signal.SIGINT, signal.SIG_IGN)\n"  # Ctrl-C is the client's
CONNECT_S, ALONE_S = 5, 30  # to connect; without any worker


def is_installed():
    """Whether there is the library that workers need."""
    return importlib.util.find_spec("distributed") is not None


def count_cores():
    """Cores of this machine that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()


@contextlib.contextmanager
def open_client(workers, *, worker_bytes=WORKER_BYTES, settings=()):
    """A client of so many workers of this machine, or of the scheduler at an address.

    Parameters
    ----------
    workers : int or str
    worker_bytes : int, optional
        Of memory that each worker of this machine may take; one that takes more is ended, and
        another one started.
    settings : dict, optional
        Further settings of dask for workers of this machine.

    Raises
    ------
    InputError
        Where dask is not installed, or an address does not answer.
    """
    if not is_installed():
        raise refusal(
            message(
                "cluster_no_library",
                "needs the library distributed, which is not installed; expected: {command}",
                command=install_command("cluster"),
            )
        )
    with _quiet(), _client_of(workers, worker_bytes, dict(settings)) as client:
        yield client


@contextlib.contextmanager
def _quiet():
    """Without what dask logs and warns of: problems are told in words."""
    logger = logging.getLogger("distributed")
    before = logger.level
    logger.setLevel(logging.CRITICAL + 1)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            yield
    finally:
        logger.setLevel(before)


@contextlib.contextmanager
def _client_of(workers, worker_bytes, more):
    """A client of local workers, or of the scheduler at an address."""
    import dask
    from distributed import Client, LocalCluster

    with contextlib.ExitStack() as stack:
        if isinstance(workers, str):
            address = workers
            _greet(address)
        else:
            memory = {"pause": False, "spill": False, "target": False}
            settings = {f"distributed.worker.memory.{name}": of for name, of in memory.items()}
            settings["distributed.worker.preload"] = [DEAF]
            stack.enter_context(dask.config.set(settings | more))
            folder = stack.enter_context(tempfile.TemporaryDirectory(prefix="tankcal-"))
            address = stack.enter_context(
                LocalCluster(
                    n_workers=workers,
                    threads_per_worker=1,
                    memory_limit=worker_bytes,
                    dashboard_address=None,
                    local_directory=folder,
                    silence_logs=logging.CRITICAL + 1,
                )
            )
        try:
            client = stack.enter_context(Client(address, timeout=CONNECT_S, set_as_default=False))
        except Exception as error:  # whatever a port that is none of dask comes up with
            raise _no_answer(address, error) from error
        with failures_told():
            _check_workers(client, workers)
        yield client


def _greet(address):
    """InputError where nothing at an address greets as a scheduler of dask does.

    A greeting begins with its length; of a port that speaks otherwise dask would take a number of
    bytes that no memory holds, and of one that is silent it waits for long.
    """
    try:
        found = urlsplit(address if "://" in address else f"tcp://{address}")
        if found.scheme not in ("tcp", "tls") or not (found.hostname and found.port):
            raise ValueError(address)
        with socket.create_connection((found.hostname, found.port), CONNECT_S) as stream:
            if found.scheme == "tls":
                return
            stream.settimeout(CONNECT_S)
            head = b""
            while len(head) < LENGTH.size:
                if not (more := stream.recv(LENGTH.size - len(head))):
                    raise ConnectionError
                head += more
        if LENGTH.unpack(head)[0] > LONGEST_GREETING:
            raise ConnectionError
    except (OSError, ValueError) as error:
        raise _no_answer(address, error) from error


def _check_workers(client, workers):
    """InputError where there are no workers, or some of another version of tankcal."""
    try:
        client.wait_for_workers(1, timeout=CONNECT_S if isinstance(workers, str) else ALONE_S)
    except TimeoutError as error:
        raise _no_workers() from error
    for worker, version in client.run(_version, on_error="return").items():
        if version != tankcal.__version__:
            raise refusal(
                message(
                    "cluster_other_version",
                    "worker {worker} has tankcal {found}; expected {version}, as here",
                    worker=worker,
                    found=version if isinstance(version, str) else type(version).__name__,
                    version=tankcal.__version__,
                )
            )


class Watch:
    """Watches over a cluster while something is waited for.

    client  of the cluster
    """

    def __init__(self, client):
        self._client, self._alone_since = client, None

    def look(self):
        """Number of workers; InputError where there was none for ALONE_S."""
        count = len(self._client.scheduler_info(n_workers=-1)["workers"])
        if count:
            self._alone_since = None
            return count
        self._alone_since = self._alone_since or time.monotonic()
        if time.monotonic() - self._alone_since > ALONE_S:
            raise _no_workers()
        return count


@contextlib.contextmanager
def failures_told():
    """InputError in one line for whatever dask, a network or another machine comes up with."""
    try:
        yield
    except TankcalError:
        raise
    except Exception as error:
        raise refusal(
            message(
                "cluster_failed",
                "its workers came to no end ({reason}): did one run out of memory, or was the "
                "scheduler ended?",
                reason=type(error).__name__,
            )
        ) from error


def _version():
    return tankcal.__version__


def _no_answer(address, error):
    return refusal(
        message(
            "cluster_no_answer",
            "no scheduler of dask answers at {address} ({reason}); expected such as "
            "tcp://192.168.1.20:8786, where `dask scheduler` runs",
            address=str(address),
            reason=reason_of(error),
        )
    )


def _no_workers():
    return refusal(
        message(
            "cluster_no_workers",
            "the cluster has no workers; expected one at least, by `dask worker ADDRESS`",
        )
    )


def refusal(text):
    """The InputError of the option that asks for workers."""
    return InputError(Problem(OPTION, text))
