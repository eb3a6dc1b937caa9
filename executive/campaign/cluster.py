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
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import BrokenExecutor
from dataclasses import dataclass, replace
from importlib.metadata import distributions
from pathlib import Path

import distributed
from packaging.utils import canonicalize_name

import executive
from executive import plugins
from executive.behaviours import SKILL_GROUP
from executive.campaign.jobs import MAX_CRASHES, JobOptions, SweepJob, make_fault_record, run_job
from executive.campaign.results import RunRecord
from executive.cell.devices import DRIVER_GROUP
from executive.cell.tools import TOOL_GROUP
from executive.errors import InputError, explain_os_errors
from executive.motion.joints import IK_SOLVER_GROUP
from executive.perception.detectors.detector_registry import DETECTOR_GROUP
from executive.perception.detectors.envelope import MEASUREMENT_SUFFIX
from executive.processes import WorkerPool
from executive.record.run_directory import FOLDER_ADVICE, make_unique_folder
from executive.run.operator import HALT_SIGNALS, handle_signals
from executive.text.files import find_cell, find_mission, get_shipped_folder
from executive.tree.node import ENTRY_POINT_GROUP as CONTROL_NODE_GROUP

CONNECTION_TIMEOUT = 10.0
"""Maximum time for the connection to the scheduler [s]."""
POLLING_PERIOD = 0.1
"""Time between two requests for the results of finished jobs [s]."""
PACKAGES_FOLDER = ".packages"
"""Folder of the packages with plugins (`PLUGIN_GROUPS`), in an unpacked bundle."""
TEXT_SUFFIXES = (".yaml", ".yml", ".urdf", ".obj", ".mtl")
"""Suffixes of files that name further files: libraries, cells, weights, labels, meshes and textures."""
_FILE_NAME_PATTERN = re.compile(r""""([^"\n]+)"|'([^'\n]+)'|([^\s"'<>,\[\]{}]+)""")
"""Pattern of a possible file name in a text: a quoted text or a word."""
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
"""Suffixes of the files that may contain paths."""


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
        plugin = BundlePlugin(make_bundle(jobs), describe_environment())
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
                        record = unpack_run(future.result())
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
        results = client.run(check_environment, describe_environment())
    except (ImportError, AttributeError) as error:
        message = f"a worker cannot import this project: {error}; {INSTALLATION_ADVICE}"
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


def make_bundle(jobs: Sequence[SweepJob]) -> bytes:
    """Return a zip file with the files that jobs read, and of the packages with plugins.

    Each file of a mission, cell or scene has its absolute path, so that all relative paths stay valid. A
    shipped file that is named in another folder is not included, because each worker has the same version
    of this project. Equal files have an equal zip file.

    Raises:
        InputError: A file names another file by its absolute path, or the module of a plugin does not exist.
    """
    settings = [job.settings for job in jobs]
    paths = {find_mission(each.mission) for each in settings}
    paths |= {find_cell(each.replacing_cell) for each in settings if each.replacing_cell}
    paths |= {each.scene for each in settings if each.scene}
    values = {text for job in jobs for text in (*job.settings.overrides.values(), *job.variant.values())}
    files = {f"{PACKAGES_FOLDER}/{name}": content for name, content in _list_plugin_files()}
    files |= {str(path): path.read_bytes() for path in _find_named_files(paths, values)}
    if project := plugins.find_project():
        files[str(project.file)] = project.file.read_bytes()
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w") as archive:
        for name in sorted(files):
            # A ZipInfo without a time has the year 1980, so that the content does not depend on the time.
            archive.writestr(zipfile.ZipInfo(name), files[name], zipfile.ZIP_DEFLATED)
    return buffer.getvalue()


def _find_named_files(paths: Iterable[Path], values: Iterable[str]) -> set[Path]:
    """Return the absolute paths of the given files and of all files that these files name.

    A named file may name further files. The measurement files in the folder of a file with names are
    included. A name is a path relative to the folder of the file that contains the name. Each value of an
    override may also be a name.
    """
    files: set[Path] = set()
    pending_paths = list(paths)
    while pending_paths:
        path = Path(os.path.abspath(pending_paths.pop()))
        if path in files:
            continue
        files.add(path)
        if path.suffix in TEXT_SUFFIXES:
            matches = _FILE_NAME_PATTERN.findall(path.read_text(encoding="utf-8", errors="replace"))
            names = {"".join(match) for match in matches}.union(values)
            for name in (name for name in names if os.path.isfile(path.parent / name)):
                if os.path.isabs(name):
                    advice = f"write a path relative to {path.parent}"
                    raise InputError(f'{path} names "{name}", a path that workers may not have; {advice}')
                pending_paths.append(path.parent / name)
            pending_paths += path.parent.glob(f"*{MEASUREMENT_SUFFIX}")
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
            if path.is_file() and "__pycache__" not in path.parts:
                yield f"{module}/{path.relative_to(folder)}", path.read_bytes()
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
    content = b""
    if record.run.run_directory:
        archive = Path(shutil.make_archive(record.run.run_directory, "zip", record.run.run_directory))
        content = archive.read_bytes()
        archive.unlink()
        shutil.rmtree(record.run.run_directory)
    return ReturnedRun(str(root), record, content)


def unpack_run(returned: ReturnedRun) -> RunRecord:
    """Write the run directory, and return the record; both contain the paths on the client.

    Raises:
        InputError: A file cannot be written.
    """
    run = returned.record.run
    message = run.message.replace(returned.root, "")
    path = Path(run.run_directory.replace(returned.root, ""))
    if run.run_directory:
        folder = path
        with explain_os_errors(InputError, f'cannot write the run directory "{folder}"', FOLDER_ADVICE):
            folder.parent.mkdir(parents=True, exist_ok=True)
            # Runs of two workers may have the same name.
            path = make_unique_folder(folder.parent, folder.name)
            with zipfile.ZipFile(io.BytesIO(returned.run_directory)) as archive:
                archive.extractall(path)
            for file in (file for file in path.rglob("*") if file.suffix in RUN_TEXT_SUFFIXES):
                content = file.read_bytes().replace(returned.root.encode(), b"")
                file.write_bytes(content.replace(bytes(folder), bytes(path)))
        message = message.replace(str(folder), str(path))
    directory = str(path) if run.run_directory else ""
    return replace(returned.record, run=replace(run, message=message, run_directory=directory))
