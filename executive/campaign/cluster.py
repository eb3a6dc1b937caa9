"""Execution of the jobs of a sweep on a running dask scheduler."""

from __future__ import annotations

import contextlib
import threading
from collections import Counter
from collections.abc import Callable, Sequence
from concurrent.futures import BrokenExecutor
from typing import TYPE_CHECKING

from executive.campaign.cluster_worker import (
    INSTALLATION_ADVICE,
    check_environment,
    describe_environment,
    make_bundle,
    unpack_run,
)
from executive.campaign.jobs import MAX_CRASHES, JobOptions, SweepJob, make_fault_record
from executive.campaign.results import RunRecord
from executive.errors import InputError
from executive.plugins import DISTRIBUTION
from executive.run.run_control import HALT_SIGNALS, handle_signals

if TYPE_CHECKING:
    from distributed import Client, Future


CONNECTION_TIMEOUT = 10.0
"""Maximum time for the connection to the scheduler [s]."""
POLLING_PERIOD = 0.1
"""Time between two requests for the results of finished jobs [s]."""


def run_jobs_on_cluster(
    jobs: Sequence[SweepJob],
    address: str,
    options: JobOptions,
    on_result: Callable[[int, RunRecord, int], None],
) -> None:
    """Execute all jobs on the workers of the scheduler at `address`.

    Another worker executes the jobs of a lost worker. After Ctrl-C or SIGTERM all unfinished jobs are
    cancelled. The other arguments have the same meaning as in `executive.campaign.jobs.run_jobs`.

    Raises:
        InputError: The extra `cluster` is not installed, the scheduler cannot be reached, has no workers or
            was lost, or the software of a worker differs.
    """
    crash_counts: Counter[int] = Counter()
    unfinished_jobs: dict[Future, int] = {}
    signal_event = threading.Event()
    with handle_signals(HALT_SIGNALS, lambda *_: signal_event.set()), _connect(address) as client:
        from distributed import CancelledError, KilledWorker, as_completed

        from executive.campaign.cluster_worker import BundlePlugin, execute_on_worker

        _check_workers(client, address)
        plugin = BundlePlugin(make_bundle(jobs), describe_environment())
        client.register_plugin(plugin)

        def submit(index: int) -> Future:
            future = client.submit(execute_on_worker, plugin.name, jobs[index], pure=False)
            unfinished_jobs[future] = index
            return future

        try:
            completions = as_completed(list(map(submit, range(len(jobs)))), loop=client.loop)
            while unfinished_jobs and not signal_event.is_set():
                for future in completions.next_batch(block=False):
                    index = unfinished_jobs.pop(future)
                    try:
                        record = unpack_run(future.result())
                    except CancelledError:
                        message = "the scheduler ended or forgot the jobs; continue with --resume"
                        raise InputError(message) from None
                    except InputError:
                        raise
                    except Exception as error:
                        if isinstance(error, (BrokenExecutor, KilledWorker)):
                            crash_counts[index] += 1
                            if crash_counts[index] < MAX_CRASHES:
                                completions.add(submit(index))
                                continue
                        record = make_fault_record(jobs[index], error)
                    on_result(index, record, crash_counts[index])
                    options.on_progress(len(jobs) - len(unfinished_jobs), len(jobs))
                signal_event.wait(POLLING_PERIOD)
            if signal_event.is_set():
                options.on_halt()
        finally:
            with contextlib.suppress(OSError):
                client.cancel(list(unfinished_jobs))
                client.unregister_worker_plugin(plugin.name)


def _connect(address: str) -> Client:
    """Return a client that is connected to the scheduler.

    Raises:
        InputError: The extra `cluster` is not installed, or the scheduler cannot be reached.
    """
    try:
        from distributed import Client
    except ImportError:
        advice = f'install them with `uv sync --extra cluster` or `pip install "{DISTRIBUTION}[cluster]"`'
        raise InputError(f'--cluster needs the packages of the extra "cluster"; {advice}') from None
    try:
        return Client(address, timeout=CONNECTION_TIMEOUT, set_as_default=False)
    except (OSError, ValueError) as error:
        advice = "start it with `dask scheduler`, and give the address that it prints, like tcp://host:8786"
        raise InputError(f'the scheduler "{address}" cannot be reached: {error}; {advice}') from error


def _check_workers(client: Client, address: str) -> None:
    """Raise InputError unless there are workers, and all have the software of this computer."""
    try:
        results = client.run(check_environment, describe_environment())
    except (ImportError, AttributeError) as error:
        message = f"a worker cannot import this project: {error}; {INSTALLATION_ADVICE}"
        raise InputError(message) from error
    if not results:
        raise InputError(f"the scheduler has no workers; start one: `dask worker {address} --nthreads 1`")
