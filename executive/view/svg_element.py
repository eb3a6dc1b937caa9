"""One element of a picture in SVG."""

from __future__ import annotations

from xml.etree.ElementTree import Element, SubElement

from executive.view.text import writable


def add(parent: Element, tag: str, kind: str = "", text: str = "", **attributes: str) -> Element:
    """Add an element of a kind, which is its class in the style sheet, and return it.

    What XML cannot hold is replaced.
    """
    if kind:
        attributes["class"] = kind
    element = SubElement(parent, tag, {key: writable(value) for key, value in attributes.items()})
    element.text = writable(text) or None
    return element


def at(length: float) -> str:
    """Return a length as SVG has it, to a whole pixel."""
    return f"{length:.0f}"
