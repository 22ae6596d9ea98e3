"""How is work handed to a Ray cluster? Ray is imported only where one is asked for (extra ``scale``)."""

import contextlib
import socket
from collections.abc import Callable, Iterator, Sequence
from typing import TypeVar

from mission.errors import FlightError, InputError

Shared = TypeVar("Shared")
Task = TypeVar("Task")
Result = TypeVar("Result")

LOCAL = "local"  # ``--cluster local``: a Ray of its own on this machine
AUTO = "auto"  # the cluster that this machine belongs to
KNOCK_S = 5.0


def check_address(address: str) -> None:
    """Ray itself tries for minutes: ``HOST:PORT`` and ``ray://HOST:PORT`` are knocked at. Raises InputError."""
    if address in (LOCAL, AUTO):
        return
    host, separator, port = address.removeprefix("ray://").rpartition(":")
    if not separator:
        raise InputError(f"--cluster '{address}' wants HOST:PORT, ray://HOST:PORT, {AUTO} or {LOCAL}")
    try:
        socket.create_connection((host, int(port)), KNOCK_S).close()
    except (OSError, ValueError, OverflowError) as error:
        raise InputError(f"--cluster '{address}': nobody answers there ({error})") from error


@contextlib.contextmanager
def connected(address: str, jobs: int) -> Iterator[None]:
    """A connection to the cluster at ``address``, or a Ray of ``jobs`` cores on this machine. Raises InputError."""
    check_address(address)
    import ray

    try:
        if address == LOCAL:
            ray.init(num_cpus=jobs, include_dashboard=False, log_to_driver=False)
        else:
            ray.init(address=address, log_to_driver=False)
    except (ConnectionError, ValueError, RuntimeError) as error:
        raise InputError(f"--cluster '{address}': {error}") from error
    try:
        yield
    finally:
        ray.shutdown()


def on_cluster(
    work: Callable[[Shared, Task], Result], shared: Shared, tasks: Sequence[Task], address: str, jobs: int
) -> Iterator[Result]:
    """What ``work(shared, task)`` gives for each task, each as soon as it is there; one core a task.

    Raises:
        InputError: nobody answers at ``address``.
        FlightError: a machine or process of the cluster was lost, more often than Ray tries again.
    """
    with connected(address, jobs):
        import ray
        from ray.exceptions import RayError, RayTaskError

        remote, kept = ray.remote(num_cpus=1)(work), ray.put(shared)
        waiting = [remote.remote(kept, task) for task in tasks]
        while waiting:
            ready, waiting = ray.wait(waiting)
            try:
                yield ray.get(ready[0])
            except RayTaskError:
                raise
            except RayError as error:
                raise FlightError(f"--cluster '{address}': {str(error).strip().splitlines()[-1]}") from error
