"""Execution of the jobs of a sweep on a running dask scheduler; needs the extra `cluster`.

A worker gets a bundle of files, must have the same software as this computer, and returns run directories.
"""

from __future__ import annotations

import contextlib
import functools
import hashlib
import importlib.util
import io
import multiprocessing
import os
import re
import shutil
import sys
import tempfile
import threading
import uuid
import zipfile
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import BrokenExecutor
from dataclasses import dataclass, replace
from importlib.metadata import distributions
from pathlib import Path

import distributed
from packaging.utils import canonicalize_name

import executive
from executive import plugins
from executive.behaviours import SKILL_GROUP, load_skills
from executive.campaign.jobs import MAX_CRASHES, JobOptions, SweepJob, make_fault_record, run_job
from executive.campaign.results import RunRecord, SweepSettings
from executive.cell.devices import DRIVER_GROUP
from executive.cell.tools import TOOL_GROUP
from executive.errors import InputError, explain_os_errors
from executive.mission.load import load_mission
from executive.motion.joints import IK_SOLVER_GROUP
from executive.perception.detectors.detector_registry import DETECTOR_GROUP
from executive.perception.detectors.envelope import MEASUREMENT_SUFFIX
from executive.physics.model_files import list_model_files
from executive.processes import WorkerPool
from executive.record.run_directory import FOLDER_ADVICE, make_unique_folder
from executive.run.operator import HALT_SIGNALS, handle_signals
from executive.text.files import find_file_below, get_shipped_folder, has_outside_link
from executive.tree.node import ENTRY_POINT_GROUP as CONTROL_NODE_GROUP

CONNECTION_TIMEOUT = 10.0
"""Maximum time for the connection to the scheduler [s]."""
POLLING_PERIOD = 0.1
"""Time between two requests for the results of finished jobs [s]."""
PACKAGES_FOLDER = ".packages"
"""Folder of the packages with plugins (`PLUGIN_GROUPS`), in an unpacked bundle."""
_ADDRESS = re.compile(r"((?:tcp|tls)://)?(\[[\da-fA-F:.]+\]|[^\s:/\[\]]+):\d{1,5}")
"""Addresses of a scheduler; ucx:// needs hardware and a configuration of its own."""
MAX_RUN_SIZE = 300_000_000
"""Maximum size of the files of a run that a worker returns [byte]."""
MAX_LINE_LENGTH = 10_000_000
"""Maximum length of a line in which paths are replaced at once [byte]."""
PLUGIN_GROUPS = (
    SKILL_GROUP, CONTROL_NODE_GROUP, DETECTOR_GROUP, DRIVER_GROUP, IK_SOLVER_GROUP, TOOL_GROUP,
)  # fmt: skip
"""Groups of entry points with which a package extends this project."""
PROJECT_PACKAGES = ("executive", "skills")
"""Top-level packages of this project, which each worker has."""
METADATA_FILES = ("METADATA", "entry_points.txt")
"""Files of a `dist-info` folder from which Python reads the entry points of a package."""
CLUSTER_EXTRA = "cluster"
"""Extra of this project with the packages for the connection to a scheduler."""
FILES_KEY = "hash of the files of executive"
"""Key of the hash of this project's files, which differs for commits with the same version number."""
HASHED_SUFFIXES = (".py", ".yaml", ".onnx", ".urdf")
"""Suffixes of the hashed files: code, shipped missions and cells, models of detectors and of the tool."""
INSTALLATION_ADVICE = "install the same versions there, and start the scheduler and its workers again"
"""Advice to the user of a worker with other software."""
RUN_TEXT_SUFFIXES = (".html", ".json", ".jsonl", ".yaml")
"""Suffixes of the files of a run that may contain paths."""
RUN_FILE = re.compile(
    r"(?:libraries/|(?=.*\.(html|jsonl?|yaml|log|jpg|png)$))(?:[^./\\][^/\\]*/)*[^./\\][^/\\]*"
)
"""Relative paths of the files of a run; no part begins with a dot."""


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
    if not jobs:
        return
    crash_counts: Counter[int] = Counter()
    unfinished_jobs: dict[distributed.Future, int] = {}
    signal_event = threading.Event()
    with handle_signals(HALT_SIGNALS, lambda *_: signal_event.set()), _connect(address) as client:
        _check_workers(client, address)
        plugin = BundlePlugin(make_bundle(jobs[0].settings), describe_environment())
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
                        record = unpack_run(future.result(), jobs[index])
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
                        else:
                            _check_workers(client, address)  # A worker may have joined later.
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
    advice = "start it with `dask scheduler`, and give the address that it prints, like tcp://host:8786"
    try:
        if (match := _ADDRESS.fullmatch(address)) is None:
            raise ValueError("the address is not tcp://HOST:PORT or tls://HOST:PORT")
        if match[1] == "tls://" and not distributed.Security().get_connection_args("client")["ssl_context"]:
            raise ValueError("tls:// needs certificates, `distributed.comm.tls` in the configuration of dask")
        return distributed.Client(address, timeout=CONNECTION_TIMEOUT, set_as_default=False)
    except (OSError, ValueError, TypeError, RuntimeError) as error:
        raise InputError(f'the scheduler "{address}" cannot be reached: {error}; {advice}') from error


def _check_workers(client: distributed.Client, address: str) -> None:
    """Raise InputError unless there are workers, and all have the software of this computer."""
    results = client.run(check_environment, describe_environment(), on_error="return")
    if not results:
        raise InputError(f"the scheduler has no workers; start one: `dask worker {address} --nthreads 1`")
    for worker_address, error in results.items():
        if error is not None:
            problem = (
                f"the worker {worker_address} cannot import this project: {error}; {INSTALLATION_ADVICE}"
            )
            raise error if isinstance(error, InputError) else InputError(problem)


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
    worker = distributed.get_worker()
    plugin = worker.plugins.get(plugin_name)
    if not isinstance(plugin, BundlePlugin):
        problem = f"the worker {worker.address} has not unpacked the files of the sweep; look into its log"
        raise InputError(f"{problem}; {INSTALLATION_ADVICE}")
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
    cell = job.settings.replacing_cell and str(_make_worker_path(root, Path(job.settings.replacing_cell)))
    scene = job.settings.scene and _make_worker_path(root, job.settings.scene)
    settings = replace(job.settings, mission=mission, replacing_cell=cell, scene=scene)
    job = replace(job, settings=settings, runs_folder=_make_worker_path(root, job.runs_folder))
    try:
        return pack_run(run_job(job), root)
    except Exception as error:
        return pack_run(make_fault_record(job, error), root)


def _make_worker_path(root: Path, path: Path) -> Path:
    """Return `root` joined with an absolute path without its leading slash, or a relative path as it is."""
    return root / path.relative_to(path.anchor) if path.is_absolute() else path


def make_bundle(settings: SweepSettings) -> bytes:
    """Return a zip file with the files of `list_bundle`; equal files have an equal zip file."""
    files = list_bundle(settings)
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w") as archive:
        for name in sorted(files):
            # A ZipInfo without a time has the year 1980, so that the content does not depend on the time.
            archive.writestr(zipfile.ZipInfo(name), files[name], zipfile.ZIP_DEFLATED)
    return buffer.getvalue()


def list_bundle(settings: SweepSettings) -> dict[str, bytes]:
    """Return the files that the runs of a sweep read, and those of the packages with plugins, by path.

    The files of the runs have absolute paths, so that all relative paths stay valid.

    Raises:
        InputError: The mission is invalid, a file names a file outside of its folder, or the module of a
            plugin does not exist.
    """
    paths = {settings.scene} if settings.scene else set()
    skills = load_skills()
    for variant in settings.variants:
        overrides = {**settings.overrides, **variant}
        loaded = load_mission(settings.mission, skills, overrides, None, settings.replacing_cell)
        paths.update(*map(list_model_files, loaded.files))
        folder = loaded.cell_path.parent
        options = [value for one in loaded.cell_config.detectors.values() for value in one.options.values()]
        names = [name for name in options if isinstance(name, str) and os.path.isfile(folder / name)]
        names += [path.name for path in folder.glob(f"*{MEASUREMENT_SUFFIX}")]
        paths.update(find_file_below(folder, name) for name in names)
    files = {f"{PACKAGES_FOLDER}/{name}": content for name, content in _list_plugin_files()}
    files |= {os.path.abspath(path): path.read_bytes() for path in paths}
    if project := plugins.find_project():
        files[str(project.file)] = project.file.read_bytes()
    return files


def _list_plugin_files() -> Iterator[tuple[str, bytes]]:
    """Yield path and content of each file that a worker needs to load the plugins of other packages.

    The paths are relative to a folder of Python's search path. The packages on which the other packages
    depend are not included.

    Raises:
        InputError: The module of an entry point does not exist.
    """
    for distribution in distributions():
        name = canonicalize_name(distribution.name)
        is_plugin = any(entry.group in PLUGIN_GROUPS for entry in distribution.entry_points)
        if is_plugin and name != plugins.DISTRIBUTION:
            folder = f"{name.replace('-', '_')}-{distribution.version}.dist-info"
            for file in METADATA_FILES:
                yield f"{folder}/{file}", (distribution.read_text(file) or "").encode()
    entries = (entry for group in PLUGIN_GROUPS for entry in plugins.list_entries(group, "plugin").values())
    modules = {entry.value.partition(":")[0].partition(".")[0] for entry in entries}
    for module in sorted(modules.difference(PROJECT_PACKAGES)):
        yield from _list_module_files(module)


def _list_module_files(module: str) -> Iterator[tuple[str, bytes]]:
    spec = importlib.util.find_spec(module)
    if spec is None:
        raise InputError(f'the module "{module}" of an entry point does not exist; install its package again')
    for folder in map(Path, spec.submodule_search_locations or ()):
        for path in sorted(folder.rglob("*")):
            name = str(path.relative_to(folder))
            # Hidden files are no data of a package, but may contain secrets.
            if path.is_file() and not re.search(r"(^|/)(\.|__pycache__)", name):
                if has_outside_link(folder, name):
                    raise InputError(f'"{path}" is a link to a file outside of the package; copy the file')
                yield f"{module}/{name}", path.read_bytes()
    if spec.submodule_search_locations is None and spec.origin:
        yield Path(spec.origin).name, Path(spec.origin).read_bytes()


@functools.cache
def describe_environment() -> Mapping[str, str]:
    """Return versions by name, and a hash of the code, missions and models of this project."""
    cluster_versions = {name: plugins.find_version(name) for name in plugins.list_requirements(CLUSTER_EXTRA)}
    return {**plugins.list_versions(), **cluster_versions, FILES_KEY: _hash_files()}


def _hash_files() -> str:
    """Return a hash of the files of this project; a wheel and a checkout of one commit have the same hash."""
    package = Path(executive.__file__).parent
    digest = hashlib.sha256()
    for folder in (package, package.parent / "skills", get_shipped_folder()):
        for path in sorted(folder.rglob("*")):
            name = path.relative_to(folder).as_posix()
            if name.endswith(HASHED_SUFFIXES) and not name.startswith("shipped/"):
                digest.update(f"{name}\0".encode() + path.read_bytes())
    return digest.hexdigest()[:12]


def check_environment(client_versions: Mapping[str, str], dask_worker: distributed.Worker) -> None:
    """Compare the software of the client with the software of this worker.

    Raises:
        InputError: The software differs.
    """
    worker_versions = describe_environment()
    differences = [
        f"{name} {worker_versions.get(name, 'missing')} instead of {client_versions.get(name, 'none')}"
        for name in {**client_versions, **worker_versions}
        if worker_versions.get(name) != client_versions.get(name)
    ]
    if differences:
        subject = f"the software of the worker {dask_worker.address} differs from this computer"
        raise InputError(f"{subject}: {', '.join(differences)}; {INSTALLATION_ADVICE}")


@dataclass(frozen=True)
class ReturnedRun:
    """A run that a worker returns.

    Attributes:
        root: Folder of the unpacked bundle on the worker. A path on the worker is `root` followed by the path
            on the client.
        record: Record of the run.
        run_directory: Zip file with the files of the run directory; empty if there is no run directory.
    """

    root: str
    record: RunRecord
    run_directory: bytes


def pack_run(record: RunRecord, root: Path) -> ReturnedRun:
    """Return a run, and delete its run directory on the worker."""
    buffer = io.BytesIO()
    if record.run.run_directory:
        folder = Path(record.run.run_directory)
        # The clock of a worker may be before 1980, the first year of a zip file.
        with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED, strict_timestamps=False) as archive:
            for path in (path for path in sorted(folder.rglob("*")) if path.is_file()):
                archive.write(path, path.relative_to(folder))
        shutil.rmtree(folder)
    return ReturnedRun(str(root), record, buffer.getvalue())


def unpack_run(returned: ReturnedRun, job: SweepJob) -> RunRecord:
    """Write the run directory of a job, and return the record; both contain the paths on the client.

    Raises:
        InputError: The run is no run of the job, its files are not those of a run, or a file cannot be
            written.
    """
    run = returned.record.run
    message = run.message.replace(returned.root, "")
    path = Path(run.run_directory.replace(returned.root, ""))
    runs_folder = Path(os.path.abspath(job.runs_folder))
    # The folder of a day contains the folder of the run.
    is_inside = not run.run_directory or Path(os.path.abspath(path)).parents[1:2] == (runs_folder,)
    if (run.run_index, run.seed, run.variant) != (job.index, job.seed, job.variant) or not is_inside:
        problem = f'a worker returned the run {run.run_index} (seed {run.seed}, folder "{path}")'
        raise InputError(f"{problem} for the run {job.index} below {runs_folder}; check the workers")
    if run.run_directory:
        folder = path
        with explain_os_errors(InputError, f'cannot write the run directory "{folder}"', FOLDER_ADVICE):
            folder.parent.mkdir(parents=True, exist_ok=True)
            # Runs of two workers may have the same name.
            path = make_unique_folder(folder.parent, folder.name)
            with zipfile.ZipFile(io.BytesIO(returned.run_directory)) as archive:
                _unpack_files(archive, path, {returned.root.encode(): b"", bytes(folder): bytes(path)})
        message = message.replace(str(folder), str(path))
    directory = str(path) if run.run_directory else ""
    return replace(returned.record, run=replace(run, message=message, run_directory=directory))


def _unpack_files(archive: zipfile.ZipFile, folder: Path, replacements: Mapping[bytes, bytes]) -> None:
    """Write files into a folder, and replace bytes in each line of the texts."""
    size = sum(file.file_size for file in archive.infolist())
    unknown_names = [name for name in archive.namelist() if not RUN_FILE.fullmatch(name)]
    if unknown_names or size > MAX_RUN_SIZE:
        problem = f"a worker returned {size} bytes, with files that no run has: {unknown_names[:3]}"
        raise InputError(f"{problem}; at most {MAX_RUN_SIZE} bytes are stored; check the workers")
    for name in archive.namelist():
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        with archive.open(name) as source, path.open("wb") as target:
            while line := source.readline(MAX_LINE_LENGTH):
                for old, new in replacements.items() if path.suffix in RUN_TEXT_SUFFIXES else ():
                    line = line.replace(old, new)
                target.write(line)
