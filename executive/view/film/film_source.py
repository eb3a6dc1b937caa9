"""Record of a run in a simulated cell, as the source of a film."""

from __future__ import annotations

from executive.cells.sim.command_log import is_command_log
from executive.errors import InputError
from executive.events import ItemChanged
from executive.record.journal import find_run_end, find_run_start, read_journal
from executive.record.recorded_mission import read_cell, read_tree
from executive.record.result import read_result
from executive.record.run_directory import RunDirectory
from executive.replay.input_log import InputLog


class FilmSource:
    """Record of a run in a simulated cell, as the source of a film.

    Attributes:
        directory: Run directory.
        events: Events of the journal in order, without the events that a resumption discarded.
        start: Event of the start of the run.
        nodes: Nodes of the tree.
        config: Configuration of the cell.
        bin_colours: Colour of each bin in the format `#rrggbb` of Pillow, by bin name.
        item_count: Number of items in the run.
        result: Result from result.json, or else from the journal; None for an interrupted run.

    Raises:
        InputError: The journal, the tree, the cell or the log of the world is missing in the record.
    """

    def __init__(self, directory: RunDirectory) -> None:
        problem = f'the run in "{directory.path}" cannot be filmed'
        if not directory.world_log.exists():
            advice = "Run the mission again with `executive run` and the same seed, and film that run"
            raise InputError(
                f"{problem}: it has no world.log, from which its world is simulated again; sweeps do not "
                f"keep this file. {advice}"
            )
        if not is_command_log(directory.world_log):
            advice = "film a run on a cell of `kind: sim`"
            raise InputError(f"{problem}: its cell has no simulated world; {advice}")
        events = read_journal(directory.journal)
        self.directory = directory
        self.start = find_run_start(events, directory.path, "there is nothing to film")
        self.events = InputLog(events).events
        self.nodes = read_tree(directory.tree)
        self.config = read_cell(directory.path)
        self.bin_colours = {
            name: "#" + bytes(round(255 * channel) for channel in bin_config.colour).hex()
            for name, bin_config in self.config.bins.items()
        }
        changes = (timed.event for timed in self.events if isinstance(timed.event, ItemChanged))
        self.item_count = len({change.item for change in changes})
        self.result = read_result(directory, events) or find_run_end(events)
