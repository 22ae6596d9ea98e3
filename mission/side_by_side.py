"""How do processes share a list of flights? Ctrl-C ends them quietly; one that dies is told, not awaited."""

import multiprocessing
import signal
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from typing import Any, TypeVar

from mission.errors import FlightError

Task = TypeVar("Task")
Result = TypeVar("Result")
DIED = "a process that was flying died: killed, or out of memory; with fewer --jobs there is more for each"


def side_by_side(
    work: Callable[[Task], Result],
    tasks: Sequence[Task],
    jobs: int,
    begin: Callable[..., None] | None = None,
    arguments: tuple[Any, ...] = (),
    in_order: bool = True,
) -> Iterator[Result]:
    """What ``work`` makes of each task, each as soon as it is there; processes end with the iterator.

    Args:
        work: runs in a process of its own; it and what it takes and gives must survive pickling.
        tasks: what is to be done.
        jobs: how many at a time.
        begin: called with ``arguments`` once in every process.
        arguments: of ``begin``.
        in_order: results in the order of the tasks; otherwise as they end.

    Raises:
        FlightError: a process died.
    """
    context = multiprocessing.get_context("spawn")
    others = set(multiprocessing.active_children())
    executor = ProcessPoolExecutor(max(1, min(jobs, len(tasks))), context, _begin, (begin, arguments))
    done = False
    try:
        futures = [executor.submit(work, task) for task in tasks]
        for future in futures if in_order else as_completed(futures):
            yield future.result()
        done = True
    except BrokenProcessPool as error:
        raise FlightError(DIED) from error
    finally:
        executor.shutdown(wait=done, cancel_futures=True)
        if not done:
            for child in set(multiprocessing.active_children()) - others:
                child.terminate()


def _begin(begin: Callable[..., None] | None, arguments: tuple[Any, ...]) -> None:
    """Ctrl-C is the first process's business: it ends this one."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    if begin is not None:
        begin(*arguments)
