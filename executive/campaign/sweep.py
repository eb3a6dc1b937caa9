"""Sweep: runs of one mission with many seeds and variants, in worker processes, and its folder.

A folder is only created if the inputs are valid, and only opened if they have not changed since.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping, Sequence
from contextlib import ExitStack, closing
from dataclasses import replace
from datetime import datetime
from pathlib import Path
from types import ModuleType

from executive.behaviours import load_skills
from executive.campaign.jobs import JobOptions, list_jobs, make_fault_record, run_job, run_jobs
from executive.campaign.results import FILE_NAME, ResultsDatabase, RunRecord, SweepSettings
from executive.campaign.sweep_summary import SweepResults, summarize_runs
from executive.cell.devices import check_driver_options, is_rehearsal, load_driver_kind
from executive.drivers.sim.scene import load_scene
from executive.errors import InputError
from executive.mission.load import load_mission
from executive.perception.detectors.envelope import compute_fingerprint
from executive.plugins import DISTRIBUTION, list_versions
from executive.record.run_directory import make_dated_folder
from executive.station.check import load_checker
from executive.text.files import read_source

SIDES = ("a", "b")
"""Names of the folders of the two sweeps of a comparison."""


def make_settings(
    mission: str, seeds: range, overrides: Mapping[str, str], variations: Mapping[str, tuple[str, ...]],
    scene: Path | None, saves_images: bool, cell: str = "",
) -> SweepSettings:  # fmt: skip
    """Check the inputs of a sweep, and return its settings.

    Args:
        mission: Mission file, or name of a shipped mission.
        seeds: Seeds of each variant.
        overrides: Values of params of the mission and keys of the cell, as given with `--set`.
        variations: Values of `--vary`, by param of the mission or key of the cell.
        scene: Scene file; None: no change of the simulated world.
        saves_images: True to save the images on which decisions are based.
        cell: Cell file or name of a shipped cell that replaces the mission's cell, or "".

    Raises:
        MissionError: A variant has errors.
        InputError: An input does not exist.
    """
    return _complete_settings(SweepSettings(
        mission=mission, mission_name="", cell="", replacing_cell=cell, overrides=overrides,
        variations=variations, first_seed=seeds[0], last_seed=seeds[-1], scene=scene,
        saves_images=saves_images, inputs_hash="", versions=dict(list_versions()),
    ))  # fmt: skip


def _complete_settings(settings: SweepSettings) -> SweepSettings:
    """Check all inputs; return the settings with name and cell of the mission, and with a hash of the inputs.

    The inputs are the texts of the missions, libraries and scene, the cell configurations, and the detector
    weights.
    """
    skills = load_skills()
    inputs: list[object] = []
    for variant in settings.variants:
        overrides = {**settings.overrides, **variant}
        loaded = load_mission(settings.mission, skills, overrides, load_checker, settings.replacing_cell)
        cell = loaded.cell_config
        check_driver_options(cell.kind, settings.driver_options)
        load_scene(settings.scene, cell)
        names = [] if is_rehearsal(load_driver_kind(cell.kind)) else [*cell.detectors]
        weights = [compute_fingerprint(cell, name, loaded.cell_path.parent)["weights"] for name in names]
        inputs += [loaded.text, dict(loaded.libraries), cell.model_dump(mode="json"), weights]
    if settings.scene is not None:
        inputs.insert(0, read_source(settings.scene).text)
    inputs_hash = hashlib.sha256(json.dumps(inputs, sort_keys=True).encode()).hexdigest()
    name = loaded.mission.name
    return replace(settings, mission_name=name, cell=str(loaded.cell_path), inputs_hash=inputs_hash)


def create_sweep(settings: SweepSettings, runs_folder: Path) -> ResultsDatabase:
    """Create the folder `RUNS/<YYYY-MM-DD>/<HH-MM-SS>_sweep_<mission>` with a locked database.

    Raises:
        InputError: The folder cannot be made.
    """
    folder = make_dated_folder(runs_folder, f"sweep_{settings.mission_name}", datetime.now())
    return ResultsDatabase(folder / FILE_NAME, settings)


def open_sweep(path: Path) -> ResultsDatabase:
    """Open the database of a sweep to resume the sweep; `path` is the file, or the folder of the sweep.

    Raises:
        InputError: There is no such sweep, another process executes the sweep, or an input has changed.
    """
    with ExitStack() as stack:  # It closes the database after an error.
        file = path / FILE_NAME if path.is_dir() else path
        database = stack.enter_context(closing(ResultsDatabase(file)))
        settings = database.settings
        if _complete_settings(settings).inputs_hash != settings.inputs_hash:
            raise InputError(
                f'the mission "{settings.mission}", its libraries, its cell, its weights or its scene '
                f'changed after the sweep "{path}" began, and the results would mix both versions; restore '
                "the files, or start a new sweep without --resume"
            )
        database.lock()
        stack.pop_all()
    return database


def create_comparison(settings: Sequence[SweepSettings], runs_folder: Path) -> list[ResultsDatabase]:
    """Create the folder `RUNS/<YYYY-MM-DD>/<HH-MM-SS>_compare_<mission>` with the databases of two sweeps.

    Raises:
        InputError: The folder cannot be made.
    """
    name = "_".join(dict.fromkeys(side_settings.mission_name for side_settings in settings))
    folder = make_dated_folder(runs_folder, f"compare_{name}", datetime.now())
    for side in SIDES:
        (folder / side).mkdir()
    files = [folder / side / FILE_NAME for side in SIDES]
    return list(map(ResultsDatabase, files, settings))


def open_comparison(folder: Path) -> list[ResultsDatabase]:
    """Open the databases of a comparison to resume the comparison.

    Raises:
        InputError: There is no such comparison, another process executes it, or an input has changed.
    """
    with ExitStack() as stack:  # It closes the first database if the second one cannot be opened.
        databases = [stack.enter_context(closing(open_sweep(folder / side))) for side in SIDES]
        stack.pop_all()
    return databases


def run_sweep(database: ResultsDatabase, options: JobOptions, cluster: str | None = None) -> None:
    """Execute the missing runs of a sweep, and store the record of each run as soon as the run ends.

    Stored runs that ended because of disk, memory or a killed process are executed again. A run gets the
    status `FAULT` after two of its worker processes died. After Ctrl-C or SIGTERM no further run starts, and
    current runs are halted; halted runs are not stored. `cluster` is the address of a dask scheduler, whose
    workers execute the runs, or None.

    Raises:
        InputError: The jobs cannot be executed on the cluster.
    """
    database.delete_environment_faults()
    stored_indices = {run.run_index for run in database.read_runs()}
    jobs = list_jobs(database.settings, database.path.parent)
    missing_jobs = [job for job in jobs if job.index not in stored_indices]

    def store(_: int, record: RunRecord, crash_count: int) -> None:
        if record.run.status != "HALTED":
            database.append(replace(record, run=replace(record.run, crashes=crash_count)))

    if cluster is None:
        run_jobs(missing_jobs, run_job, make_fault_record, options, store)
        return
    import_cluster().run_jobs_on_cluster(missing_jobs, cluster, options, store)


def import_cluster() -> ModuleType:
    """Return the module `executive.campaign.cluster`.

    Raises:
        InputError: The extra `cluster` is not installed.
    """
    try:
        # The packages of the extra `cluster` are optional.
        import executive.campaign.cluster as cluster
    except ImportError:
        advice = f'install them with `uv sync --extra cluster` or `pip install "{DISTRIBUTION}[cluster]"`'
        raise InputError(f'--cluster needs the packages of the extra "cluster"; {advice}') from None
    return cluster


def read_results(database: ResultsDatabase, side: str = "") -> SweepResults:
    """Return the results of all stored runs of a sweep; `side` is `A` or `B` in a comparison, else ""."""
    runs = database.read_runs()
    summaries = summarize_runs(runs, database.read_skills(), database.settings)
    return SweepResults(side, database.settings, runs, summaries)
