"""Worker side of the cluster execution: a dask plugin that unpacks a bundle and executes jobs."""

from __future__ import annotations

import io
import multiprocessing
import os
import shutil
import sys
import tempfile
import threading
import uuid
import zipfile
from collections.abc import Mapping
from concurrent.futures import BrokenExecutor
from dataclasses import replace
from pathlib import Path

from distributed import Worker, WorkerPlugin, get_worker

from executive.campaign.cluster.bundle import PACKAGES_FOLDER
from executive.campaign.cluster.environment import check_environment
from executive.campaign.cluster.returned_run import ReturnedRun, pack_run
from executive.campaign.sweep_job import SweepJob, make_fault_record, run_job
from executive.processes import WorkerPool


class BundlePlugin(WorkerPlugin):
    """A plugin with a bundle; a worker that joins later also receives the plugin.

    Args:
        bundle: Zip file with the files that the jobs read.
        client_versions: Software of the client.
    """

    def __init__(self, bundle: bytes, client_versions: Mapping[str, str]) -> None:
        self.name = f"executive-{uuid.uuid4()}"
        self.client_versions = client_versions
        self._bundle, self._working_directory = bundle, Path.cwd()

    def setup(self, worker: Worker) -> None:
        """Unpack the bundle into a temporary folder of the worker."""
        self._root = Path(tempfile.mkdtemp(prefix="executive-", dir=worker.local_directory)).resolve()
        with zipfile.ZipFile(io.BytesIO(self._bundle)) as archive:
            archive.extractall(self._root)
        # A dask nanny starts its worker as a daemon process, and a daemon process may not start a process.
        multiprocessing.current_process().daemon = False
        # A run may crash its process; the worker survives. All threads of the worker share one process.
        self._lock = threading.Lock()
        self._pool: WorkerPool | None = WorkerPool(1)

    def teardown(self, worker: Worker) -> None:
        """Kill the process of the jobs, and delete the folder."""
        del worker
        pool, self._pool = self._pool, None
        if pool is not None:
            pool.kill()
        shutil.rmtree(self._root, ignore_errors=True)

    def execute(self, job: SweepJob) -> ReturnedRun:
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


def execute_on_worker(plugin_name: str, job: SweepJob) -> ReturnedRun:
    """Execute a job on this worker with the plugin of this name.

    Raises:
        BrokenExecutor: The process of the job died.
        InputError: The software of this worker differs from the software of the client.
    """
    worker = get_worker()
    plugin = worker.plugins[plugin_name]
    assert isinstance(plugin, BundlePlugin)
    check_environment(plugin.client_versions, worker)
    return plugin.execute(job)


def _execute_job(job: SweepJob, root: Path, working_directory: Path) -> ReturnedRun:
    """Execute a job in the working directory of the client below `root`, the folder of the bundle."""
    # In a process group of its own, the process receives no Ctrl-C from the terminal of the worker.
    os.setpgid(0, 0)
    worker_directory = _make_worker_path(root, working_directory)
    worker_directory.mkdir(parents=True, exist_ok=True)
    os.chdir(worker_directory)
    packages = str(root / PACKAGES_FOLDER)
    if packages not in sys.path:
        sys.path.insert(0, packages)
        search_path = filter(None, (packages, os.environ.get("PYTHONPATH")))
        os.environ["PYTHONPATH"] = os.pathsep.join(search_path)
    mission = str(_make_worker_path(root, Path(job.settings.mission)))
    scene = job.settings.scene and _make_worker_path(root, job.settings.scene)
    settings = replace(job.settings, mission=mission, scene=scene)
    job = replace(job, settings=settings, runs_folder=_make_worker_path(root, job.runs_folder))
    try:
        return pack_run(run_job(job), root)
    except Exception as error:
        return pack_run(make_fault_record(job, error), root)


def _make_worker_path(root: Path, path: Path) -> Path:
    """Return `root` joined with an absolute path without its leading slash, or a relative path as it is."""
    return root / path.relative_to(path.anchor) if path.is_absolute() else path
