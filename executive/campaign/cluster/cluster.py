"""Execution of the jobs of a sweep on a running dask scheduler."""

from __future__ import annotations

import contextlib
import pickle
import threading
import uuid
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import BrokenExecutor
from typing import TYPE_CHECKING

from executive.campaign.cluster.bundle import make_bundle
from executive.campaign.cluster.environment import describe_differences, describe_environment
from executive.campaign.cluster.returned_run import JobOutput, unpack_returned_run
from executive.campaign.pool import MAX_CRASHES, MAX_HALT_DELAY
from executive.campaign.results.rows import RunRecord
from executive.campaign.sweep import SweepJob
from executive.errors import ExecutiveError, InputError
from executive.run.signals import HALT_SIGNALS, handle_signals

if TYPE_CHECKING:
    from distributed import Client, Future

CONNECTION_TIMEOUT = 10.0
"""Maximum time for the connection to the scheduler [s]."""


def run_jobs_on_cluster(
    jobs: Sequence[SweepJob],
    run_job: Callable[[SweepJob], RunRecord],
    make_failure: Callable[[SweepJob, BaseException], RunRecord],
    *,
    address: str,
    progress: Callable[[int, int], None] = lambda *_: None,
    on_result: Callable[[int, RunRecord, int], None] = lambda *_: None,
    on_halt: Callable[[], None] = lambda: None,
) -> list[RunRecord | None]:
    """Execute all jobs on the workers of the scheduler at `address`, and return the records of the runs.

    Another worker executes the jobs of a lost worker. After Ctrl-C or SIGTERM all unfinished jobs are
    cancelled. The other arguments have the same meaning as in `executive.campaign.pool.run_jobs`.

    Raises:
        InputError: The extra `cluster` is not installed, the scheduler cannot be reached, has no workers or
            was lost, or a worker has other software.
    """
    records: dict[int, RunRecord] = {}
    crash_counts: Counter[int] = Counter()
    indices: dict[Future, int] = {}
    signal_event = threading.Event()
    with handle_signals(HALT_SIGNALS, lambda *_: signal_event.set()), _connect(address) as client:
        from distributed import as_completed

        from executive.campaign.cluster.worker import BundlePlugin, execute_on_worker

        _check_environments(client, address)
        plugin = BundlePlugin(make_bundle(jobs), f"executive-{uuid.uuid4()}", describe_environment())
        client.register_plugin(plugin)

        def submit(index: int) -> Future:
            call = pickle.dumps((run_job, jobs[index]))
            future = client.submit(execute_on_worker, plugin.name, call, pure=False)
            indices[future] = index
            return future

        try:
            ended_futures = as_completed(list(map(submit, range(len(jobs)))), loop=client.loop)
            while indices and not signal_event.is_set():
                for future in ended_futures.next_batch(block=False):
                    index = indices.pop(future)
                    outcome = _get_outcome(future)
                    if isinstance(outcome, BrokenExecutor):
                        crash_counts[index] += 1
                        if crash_counts[index] < MAX_CRASHES:
                            ended_futures.add(submit(index))
                            continue
                    if isinstance(outcome, Exception):
                        outcome = make_failure(jobs[index], outcome)
                    records[index] = outcome
                    on_result(index, records[index], crash_counts[index])
                    progress(len(records), len(jobs))
                signal_event.wait(MAX_HALT_DELAY)
            if signal_event.is_set():
                on_halt()
        finally:
            with contextlib.suppress(OSError):
                client.cancel(list(indices))
                client.unregister_worker_plugin(plugin.name)
    return list(map(records.get, range(len(jobs))))


@contextlib.contextmanager
def _connect(address: str) -> Iterator[Client]:
    """Connect to the scheduler; a context manager."""
    try:
        from distributed import Client
    except ImportError:
        raise InputError(
            '--cluster needs the packages of the extra "cluster"; install them with '
            '`uv sync --extra cluster` or `pip install "executive[cluster]"`'
        ) from None
    try:
        client = Client(address, timeout=CONNECTION_TIMEOUT, set_as_default=False)
    except (OSError, ValueError) as error:
        advice = "start it with `dask scheduler`, and give the address that it prints, like tcp://host:8786"
        raise InputError(f'the scheduler "{address}" cannot be reached: {error}; {advice}') from error
    with client:
        yield client


def _check_environments(client: Client, address: str) -> None:
    """Raise InputError unless there are workers, and all have the software of this computer."""
    advice = "install the same versions there, and start the scheduler and its workers again"
    try:
        environments = client.run(describe_environment)
    except (ImportError, AttributeError) as error:
        raise InputError(f"a worker cannot import this project: {error}; {advice}") from error
    if not environments:
        raise InputError(f"the scheduler has no workers; start one: `dask worker {address} --nthreads 1`")
    for worker, environment in environments.items():
        if differences := describe_differences(describe_environment(), environment):
            raise InputError(f"the worker {worker} has other software: {differences}; {advice}")


def _get_outcome(future: Future) -> RunRecord | Exception:
    """Return the record of an ended job and write its run directory, or return the error of the job."""
    from distributed import CancelledError, KilledWorker

    try:
        output: JobOutput = future.result()
    except CancelledError:
        raise InputError("the scheduler ended or forgot the jobs; continue with --resume") from None
    except (BrokenExecutor, KilledWorker) as error:
        return BrokenExecutor(str(error))
    return ExecutiveError(output.error) if output.error else unpack_returned_run(output)
