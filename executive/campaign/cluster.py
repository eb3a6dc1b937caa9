"""Execution of the jobs of a sweep on a running dask scheduler; needs the extra `cluster`."""

from __future__ import annotations

import contextlib
import io
import multiprocessing
import os
import shutil
import sys
import tempfile
import threading
import uuid
import zipfile
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import BrokenExecutor
from dataclasses import replace
from pathlib import Path

import distributed

from executive.campaign import cluster_bundle
from executive.campaign.jobs import MAX_CRASHES, JobOptions, SweepJob, make_fault_record, run_job
from executive.campaign.results import RunRecord
from executive.errors import InputError
from executive.processes import WorkerPool
from executive.run.operator import HALT_SIGNALS, handle_signals

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
        InputError: The scheduler cannot be reached, has no workers or was lost, or the software of a worker
            differs.
    """
    crash_counts: Counter[int] = Counter()
    unfinished_jobs: dict[distributed.Future, int] = {}
    signal_event = threading.Event()
    with handle_signals(HALT_SIGNALS, lambda *_: signal_event.set()), _connect(address) as client:
        _check_workers(client, address)
        plugin = BundlePlugin(cluster_bundle.make_bundle(jobs), cluster_bundle.describe_environment())
        client.register_plugin(plugin)

        def submit(index: int) -> distributed.Future:
            future = client.submit(execute_on_worker, plugin.name, jobs[index], pure=False)
            unfinished_jobs[future] = index
            return future

        try:
            completions = distributed.as_completed(list(map(submit, range(len(jobs)))), loop=client.loop)
            while unfinished_jobs and not signal_event.is_set():
                for future in completions.next_batch(block=False):
                    index = unfinished_jobs.pop(future)
                    try:
                        record = cluster_bundle.unpack_run(future.result())
                    except distributed.CancelledError:
                        message = "the scheduler ended or forgot the jobs; continue with --resume"
                        raise InputError(message) from None
                    except InputError:
                        raise
                    except Exception as error:
                        if isinstance(error, (BrokenExecutor, distributed.KilledWorker)):
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


def _connect(address: str) -> distributed.Client:
    try:
        return distributed.Client(address, timeout=CONNECTION_TIMEOUT, set_as_default=False)
    except (OSError, ValueError) as error:
        advice = "start it with `dask scheduler`, and give the address that it prints, like tcp://host:8786"
        raise InputError(f'the scheduler "{address}" cannot be reached: {error}; {advice}') from error


def _check_workers(client: distributed.Client, address: str) -> None:
    """Raise InputError unless there are workers, and all have the software of this computer."""
    try:
        results = client.run(cluster_bundle.check_environment, cluster_bundle.describe_environment())
    except (ImportError, AttributeError) as error:
        message = f"a worker cannot import this project: {error}; {cluster_bundle.INSTALLATION_ADVICE}"
        raise InputError(message) from error
    if not results:
        raise InputError(f"the scheduler has no workers; start one: `dask worker {address} --nthreads 1`")


class BundlePlugin(distributed.WorkerPlugin):
    """A plugin with a bundle; a worker that joins later also receives the plugin.

    Args:
        bundle: Zip file with the files that the jobs read.
        client_versions: Software of the client.
    """

    def __init__(self, bundle: bytes, client_versions: Mapping[str, str]) -> None:
        self.name = f"executive-{uuid.uuid4()}"
        self.client_versions = client_versions
        self._bundle = bundle
        self._working_directory = Path.cwd()

    def setup(self, worker: distributed.Worker) -> None:
        """Unpack the bundle into a temporary folder of the worker."""
        self._root = Path(tempfile.mkdtemp(prefix="executive-", dir=worker.local_directory)).resolve()
        with zipfile.ZipFile(io.BytesIO(self._bundle)) as archive:
            archive.extractall(self._root)
        # A dask nanny starts its worker as a daemon process, and a daemon process may not start a process.
        multiprocessing.current_process().daemon = False
        # A run may crash its process; the worker survives. All threads of the worker share one process.
        self._lock = threading.Lock()
        self._pool: WorkerPool | None = WorkerPool(1)

    def teardown(self, worker: distributed.Worker) -> None:
        """Kill the process of the jobs, and delete the folder."""
        del worker
        if self._pool is not None:
            self._pool.kill()
            self._pool = None
        shutil.rmtree(self._root, ignore_errors=True)

    def execute(self, job: SweepJob) -> cluster_bundle.ReturnedRun:
        """Execute a job in the process of the plugin.

        Raises:
            BrokenExecutor: The process died.
        """
        with self._lock:
            assert self._pool is not None, "The plugin was removed."
            try:
                return self._pool.submit(_execute_job, job, self._root, self._working_directory).result()
            except BrokenExecutor:
                self._pool = self._pool and WorkerPool(1)
                raise


def execute_on_worker(plugin_name: str, job: SweepJob) -> cluster_bundle.ReturnedRun:
    """Execute a job on this worker with the plugin of this name.

    Raises:
        BrokenExecutor: The process of the job died.
        InputError: The software of this worker differs from the software of the client.
    """
    worker = distributed.get_worker()
    plugin = worker.plugins[plugin_name]
    assert isinstance(plugin, BundlePlugin)
    cluster_bundle.check_environment(plugin.client_versions, worker)
    return plugin.execute(job)


def _execute_job(job: SweepJob, root: Path, working_directory: Path) -> cluster_bundle.ReturnedRun:
    """Execute a job in the working directory of the client below `root`, the folder of the bundle."""
    # In a process group of its own, the process receives no Ctrl-C from the terminal of the worker.
    os.setpgid(0, 0)
    worker_directory = _make_worker_path(root, working_directory)
    worker_directory.mkdir(parents=True, exist_ok=True)
    os.chdir(worker_directory)
    packages = str(root / cluster_bundle.PACKAGES_FOLDER)
    if packages not in sys.path:
        sys.path.insert(0, packages)
        search_path = filter(None, (packages, os.environ.get("PYTHONPATH")))
        os.environ["PYTHONPATH"] = os.pathsep.join(search_path)
    mission = str(_make_worker_path(root, Path(job.settings.mission)))
    cell = job.settings.replacing_cell and str(_make_worker_path(root, Path(job.settings.replacing_cell)))
    scene = job.settings.scene and _make_worker_path(root, job.settings.scene)
    settings = replace(job.settings, mission=mission, replacing_cell=cell, scene=scene)
    job = replace(job, settings=settings, runs_folder=_make_worker_path(root, job.runs_folder))
    try:
        return cluster_bundle.pack_run(run_job(job), root)
    except Exception as error:
        return cluster_bundle.pack_run(make_fault_record(job, error), root)


def _make_worker_path(root: Path, path: Path) -> Path:
    """Return `root` joined with an absolute path without its leading slash, or a relative path as it is."""
    return root / path.relative_to(path.anchor) if path.is_absolute() else path
