"""Part of the cluster on the workers: a plugin of dask that unpacks a bundle and executes jobs there."""

from __future__ import annotations

import os
import pickle
import shutil
import subprocess
import tempfile
import threading
from collections.abc import Mapping
from concurrent.futures import BrokenExecutor
from pathlib import Path

from distributed import Worker, WorkerPlugin, get_worker

from executive.campaign.cluster.bundle import PACKAGES_FOLDER, Bundle, make_relative
from executive.campaign.cluster.environment import describe_differences, describe_environment
from executive.campaign.cluster.returned_run import JobOutput
from executive.errors import InputError
from executive.processes import THREAD_COUNT_VARIABLES, build_command


class BundlePlugin(WorkerPlugin):
    """A plugin with a bundle; a worker that joins later gets the plugin, too.

    Args:
        bundle: Files for the jobs.
        name: Name of the plugin, unique in the cluster.
        environment: Software of the client.
    """

    def __init__(self, bundle: Bundle, name: str, environment: Mapping[str, str]) -> None:
        self.name, self._bundle, self._environment = name, bundle, dict(environment)

    def setup(self, worker: Worker) -> None:
        """Unpack the bundle into a temporary folder of the worker."""
        folder = tempfile.mkdtemp(prefix=f"executive-{self._bundle.hash}-", dir=worker.local_directory)
        self._root = Path(folder).resolve()
        self._bundle.unpack(self._root)
        # A worker with several threads executes one job at a time, because a job is a process of its own.
        self._lock = threading.Lock()
        self._process: subprocess.Popen[bytes] | None = None

    def teardown(self, worker: Worker) -> None:
        """Kill the process of the jobs, and delete the folder."""
        del worker
        if self._process is not None:
            self._process.kill()
        shutil.rmtree(self._root, ignore_errors=True)

    def execute(self, call: bytes) -> JobOutput:
        """Execute a pickled pair of function and job in the process of the plugin.

        Raises:
            BrokenExecutor: The process died.
            InputError: The software of this worker differs from the software of the client.
        """
        if differences := describe_differences(self._environment, describe_environment()):
            raise InputError(f"a worker has other software than this computer: {differences}")
        with self._lock:
            process = self._process = self._process or self._start_process()
            assert process.stdin is not None and process.stdout is not None
            try:
                process.stdin.write(call)
                process.stdin.flush()
                output: JobOutput = pickle.load(process.stdout)
            except (EOFError, OSError, pickle.UnpicklingError):
                process.kill()
                self._process = None
                raise BrokenExecutor(f"the process of the run died with code {process.wait()}") from None
            return output

    def _start_process(self) -> subprocess.Popen[bytes]:
        """Start the process in the working directory of the client below the folder of the bundle."""
        threads = dict.fromkeys(THREAD_COUNT_VARIABLES, "1")
        search_path = filter(None, (str(self._root / PACKAGES_FOLDER), os.environ.get("PYTHONPATH")))
        return subprocess.Popen(
            build_command("executive.campaign.cluster.job_process", str(self._root)),
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            cwd=self._root / make_relative(self._bundle.working_directory),
            env={**threads, **os.environ, "PYTHONPATH": os.pathsep.join(search_path)},
            start_new_session=True,  # Ctrl-C at the terminal of the worker must not halt a run.
        )


def execute_on_worker(plugin: str, call: bytes) -> JobOutput:
    """Execute a pickled pair of function and job on this worker with the plugin of this name."""
    bundle_plugin = get_worker().plugins[plugin]
    assert isinstance(bundle_plugin, BundlePlugin)
    return bundle_plugin.execute(call)
