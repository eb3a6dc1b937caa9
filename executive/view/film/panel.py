"""Panel at the right of a film frame: the running branches of the tree, and the items of the run."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from PIL import Image, ImageDraw

from executive.cell.frame import Box
from executive.events import ItemChanged
from executive.mission.outline import OutlineNode
from executive.view.film import style
from executive.view.film.run_state import FilmRunState
from executive.view.film.style import FAILURE, INACTIVE, LINE, RUNNING, SECONDARY_TEXT, SUCCESS, TEXT
from executive.view.tree.tree_text import draw_line_prefixes, select_active_nodes

TEXT_SIZE, HEADING_SIZE, MARK_SIZE = 14, 12, 11
"""Font sizes of text and of column headings, and width and height of a status mark [pixel]."""
NODE_ROW_HEIGHT, ITEM_ROW_HEIGHT, INDENT = 18, 20, 17
"""Height of a row of the tree, height of a row of the items, and indentation per tree level [pixel]."""
MAX_ITEM_ROWS = 9
"""Maximum number of items that are drawn."""
_CHARACTERS_PER_LEVEL = 3
"""Number of characters per tree level in a prefix from `draw_line_prefixes`."""
_COLUMN_STARTS = {"item": 0.0, "class": 0.32, "state": 0.53, "bin": 0.74}
"""Left edge of each column [fraction of the width of the panel]."""
STATE_COLOURS = {"placed": SUCCESS, "rejected": FAILURE, "lost": FAILURE, "held": RUNNING, "dropped": RUNNING}
"""Colour of the text of an item state; the text of any other state has the colour `SECONDARY_TEXT`."""
_FINAL_STATES = ("placed", "rejected", "skipped", "lost", "phantom")
"""States of items that the run has finished."""
_SWATCH_SIZE = 9
"""Width and height of the square with the colour of a bin [pixel]."""


def draw_tree(image: Image.Image, box: Box, nodes: Sequence[OutlineNode], state: FilmRunState) -> None:
    """Draw the active nodes of a run and their children, one per row, in the region `box` of an image."""
    left, top, right, bottom = box
    shown_nodes = select_nodes(nodes, state, int((bottom - top) // NODE_ROW_HEIGHT))
    draw, font = ImageDraw.Draw(image), style.load_font(TEXT_SIZE)
    for row, (node, prefix) in enumerate(zip(shown_nodes, draw_line_prefixes(shown_nodes), strict=True)):
        middle = top + NODE_ROW_HEIGHT * (row + 0.5)
        _draw_connecting_lines(draw, prefix, left, middle)
        activation = state.timeline.find_current_activation(node.path)
        status = activation.status if activation else ""
        x = left + INDENT * (len(prefix) // _CHARACTERS_PER_LEVEL)
        style.draw_mark(image, status, (x + MARK_SIZE / 2, middle), MARK_SIZE)
        x += MARK_SIZE + 8
        colour = SECONDARY_TEXT if status in ("SUCCESS", "FAILURE") else INACTIVE
        if status == "RUNNING":
            colour = RUNNING if node.skill else TEXT
        name = style.truncate_text(node.name, TEXT_SIZE, right - x)
        draw.text((x, middle), name, colour, font, "lm")
        x += font.getlength(name) + 10
        note = style.truncate_text(activation.reason_or_item if activation else "", TEXT_SIZE, right - x)
        draw.text((x, middle), note, FAILURE if status == "FAILURE" else SECONDARY_TEXT, font, "lm")


def select_nodes(nodes: Sequence[OutlineNode], state: FilmRunState, max_count: int) -> list[OutlineNode]:
    """Return the active nodes and their children, at most `max_count` nodes.

    Nodes that never ran are omitted first, then other inactive nodes, and later nodes before earlier nodes.
    """
    active_paths = state.active_paths
    shown_nodes = select_active_nodes(nodes, active_paths)

    def get_priority(index: int) -> tuple[bool, bool, int]:
        path = shown_nodes[index].path
        activation = state.timeline.find_current_activation(path)
        has_run = activation is not None and activation.status in style.STATUS_COLOURS
        return path in active_paths, has_run, -index

    kept_indices = sorted(sorted(range(len(shown_nodes)), key=get_priority, reverse=True)[:max_count])
    return [shown_nodes[index] for index in kept_indices]


def compute_items_height(item_count: int) -> int:
    """Return the height of the drawing of `item_count` items [pixel]."""
    return ITEM_ROW_HEIGHT * (min(item_count, MAX_ITEM_ROWS) + 1)


def draw_items(
    image: Image.Image, box: Box, items: Sequence[ItemChanged], bin_colours: Mapping[str, str]
) -> None:
    """Draw at most `MAX_ITEM_ROWS` items, one per row, in the region `box` of an image.

    `items` contains the last change of each item, `bin_colours` the colour of each bin by name.
    """
    left, top, right, _ = box
    draw, font = ImageDraw.Draw(image), style.load_font(TEXT_SIZE)
    starts = [left + fraction * (right - left) for fraction in _COLUMN_STARTS.values()]
    text_starts, ends = [*starts[:-1], starts[-1] + _SWATCH_SIZE + 6], [*(x - 8 for x in starts[1:]), right]
    for title, start in zip(_COLUMN_STARTS, starts, strict=True):
        draw.text((start, top + ITEM_ROW_HEIGHT / 2), title, INACTIVE, style.load_font(HEADING_SIZE), "lm")
    for number, item in enumerate(select_items(items), start=1):
        middle = top + ITEM_ROW_HEIGHT * (number + 0.5)
        texts = (item.item, item.label, item.state, item.bin)
        name_colour = SECONDARY_TEXT if item.state in _FINAL_STATES else TEXT
        state_colour = STATE_COLOURS.get(item.state, SECONDARY_TEXT)
        colours = (name_colour, SECONDARY_TEXT, state_colour, SECONDARY_TEXT)
        for text, colour, start, end in zip(texts, colours, text_starts, ends, strict=True):
            visible_text = style.truncate_text(text, TEXT_SIZE, end - start)
            draw.text((start, middle), visible_text, colour, font, "lm")
        if item.bin:
            x, y = starts[-1], round(middle) - _SWATCH_SIZE // 2
            swatch = (x, y, x + _SWATCH_SIZE - 1, y + _SWATCH_SIZE - 1)
            draw.rectangle(swatch, bin_colours.get(item.bin, SECONDARY_TEXT))


def select_items(items: Sequence[ItemChanged]) -> list[ItemChanged]:
    """Return at most `MAX_ITEM_ROWS` items in their order; items in a final state are omitted first."""
    omission_order = sorted(range(len(items)), key=lambda index: items[index].state not in _FINAL_STATES)
    omitted_indices = omission_order[: max(len(items) - MAX_ITEM_ROWS, 0)]
    return [item for index, item in enumerate(items) if index not in omitted_indices]


def _draw_connecting_lines(draw: ImageDraw.ImageDraw, prefix: str, left: float, middle: float) -> None:
    """Draw the box-drawing characters in `prefix` as lines to the rows of the parent and the siblings."""
    for level, character in enumerate(prefix[::_CHARACTERS_PER_LEVEL]):
        x = left + INDENT * level + MARK_SIZE // 2
        if character != " ":
            bottom = middle if character == "└" else middle + NODE_ROW_HEIGHT / 2
            draw.line((x, middle - NODE_ROW_HEIGHT / 2, x, bottom), LINE, 1)
        if character in "├└":
            draw.line((x, middle, x + INDENT - MARK_SIZE // 2 - 3, middle), LINE, 1)
