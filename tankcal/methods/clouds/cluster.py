"""Dask workers on this machine or of a scheduler at an address, and their errors.

`clouds.cluster` reads clouds by workers, and `tankcal.products.batch` computes jobs. Errors of
dask, of the network or of another machine are reported in one line.
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
WORKER_BYTES = 1 << 30  # memory limit of a local worker
# Format of the length of the first message of a scheduler, and its largest length in bytes.
LENGTH, LONGEST_GREETING = struct.Struct("<Q"), 1 << 20
DEAF = "import signal\nsignal.signal(signal.SIGINT, signal.SIG_IGN)\n"  # Ctrl-C ends the client
CONNECT_S, ALONE_S = 5, 30  # longest time to connect, and without any worker, s


def is_installed():
    """Whether the library distributed is installed."""
    return importlib.util.find_spec("distributed") is not None


def count_cores():
    """Return the number of cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()


@contextlib.contextmanager
def open_client(workers, *, worker_bytes=WORKER_BYTES, settings=()):
    """Open a client of local workers or of the scheduler at an address.

    Parameters
    ----------
    workers : int or str
        Number of local workers, or address of a scheduler.
    worker_bytes : int, optional
        Memory limit of each local worker; a worker beyond the limit is replaced.
    settings : dict, optional
        Further settings of dask for local workers.

    Yields
    ------
    distributed.Client

    Raises
    ------
    InputError
        If dask is not installed, or if an address does not answer.
    """
    if not is_installed():
        raise refusal(
            message(
                "cluster_no_library",
                "needs the library distributed, which is not installed; expected: {command}",
                command=install_command("cluster"),
            )
        )
    with _silence_dask(), _client_of(workers, worker_bytes, dict(settings)) as client:
        yield client


@contextlib.contextmanager
def _silence_dask():
    """Suppress the log and the warnings of dask; this module reports its errors."""
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
    """Client of local workers, or of the scheduler at an address."""
    import dask
    from distributed import Client, LocalCluster

    with contextlib.ExitStack() as stack:
        if isinstance(workers, str):
            address = workers
            _check_greeting(address)
        else:
            memory = {"pause": False, "spill": False, "target": False}
            settings = {
                f"distributed.worker.memory.{name}": limit for name, limit in memory.items()
            }
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
        except Exception as error:  # a port of another service may cause any error
            raise _no_answer_error(address, error) from error
        with report_failures():
            _check_workers(client, workers)
        yield client


def _check_greeting(address):
    """Raise InputError if no dask scheduler answers at an address.

    A greeting begins with its length. Without this check, dask may read a length beyond the memory
    from another service, and waits long for a silent port.
    """
    try:
        url = urlsplit(address if "://" in address else f"tcp://{address}")
        if url.scheme not in ("tcp", "tls") or not (url.hostname and url.port):
            raise ValueError(address)
        with socket.create_connection((url.hostname, url.port), CONNECT_S) as stream:
            if url.scheme == "tls":
                return
            stream.settimeout(CONNECT_S)
            head = b""
            while len(head) < LENGTH.size:
                if not (received := stream.recv(LENGTH.size - len(head))):
                    raise ConnectionError
                head += received
        if LENGTH.unpack(head)[0] > LONGEST_GREETING:
            raise ConnectionError
    except (OSError, ValueError) as error:
        raise _no_answer_error(address, error) from error


def _check_workers(client, workers):
    """Raise InputError if there are no workers, or workers with another version of tankcal."""
    try:
        client.wait_for_workers(1, timeout=CONNECT_S if isinstance(workers, str) else ALONE_S)
    except TimeoutError as error:
        raise _no_workers_error() from error
    for worker, version in client.run(_read_version, on_error="return").items():
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
    """Monitors a cluster during a wait.

    Parameters
    ----------
    client : distributed.Client
    """

    def __init__(self, client):
        self._client, self._alone_since = client, None

    def look(self):
        """Return the number of workers; InputError if there was none for ALONE_S."""
        count = len(self._client.scheduler_info(n_workers=-1)["workers"])
        if count:
            self._alone_since = None
            return count
        self._alone_since = self._alone_since or time.monotonic()
        if time.monotonic() - self._alone_since > ALONE_S:
            raise _no_workers_error()
        return count


@contextlib.contextmanager
def report_failures():
    """Turn any error of dask, of the network or of another machine into a one-line InputError."""
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


def _read_version():
    """Version of tankcal on a worker."""
    return tankcal.__version__


def _no_answer_error(address, error):
    """InputError for an address without an answer."""
    return refusal(
        message(
            "cluster_no_answer",
            "no scheduler of dask answers at {address} ({reason}); expected such as "
            "tcp://192.168.1.20:8786, where `dask scheduler` runs",
            address=str(address),
            reason=reason_of(error),
        )
    )


def _no_workers_error():
    """InputError for a cluster without workers."""
    return refusal(
        message(
            "cluster_no_workers",
            "the cluster has no workers; expected one at least, by `dask worker ADDRESS`",
        )
    )


def refusal(text):
    """Return the InputError of the command-line option that requests workers."""
    return InputError(Problem(OPTION, text))
