"""What a browser makes of a page: its elements, and its text."""

from __future__ import annotations

from html.parser import HTMLParser

SECTIONS = ("diagnosis", "commands", "objects", "timeline", "tree", "inputs")
EMPTY = {"meta", "link", "img"}


class Page(HTMLParser):
    """A page that was read.

    Attributes:
        elements: Name and attributes of every element, in order.
        texts: What stands in each section, by its id, in one line; what stands above them under `header`.
        raw: What stands in elements whose content is no text for a reader.
    """

    def __init__(self, text: str) -> None:
        super().__init__()
        self.elements: list[tuple[str, dict[str, str]]] = []
        self.texts: dict[str, str] = {}
        self.raw: list[str] = []
        self._open: list[str] = []
        self._place = "header"
        self.feed(text)
        self.close()
        self.texts = {place: " ".join(words.split()) for place, words in self.texts.items()}

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.elements.append((tag, {key: value or "" for key, value in attrs}))
        if tag == "section":
            self._place = self.elements[-1][1]["id"]
        if tag not in EMPTY:
            self._open.append(tag)

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.elements.append((tag, {key: value or "" for key, value in attrs}))

    def handle_endtag(self, tag: str) -> None:
        assert self._open.pop() == tag, f"{tag} closes what it did not open"

    def handle_data(self, data: str) -> None:
        if self._open and self._open[-1] in ("style", "script"):
            self.raw.append(data)
        elif "body" in self._open:
            self.texts[self._place] = self.texts.get(self._place, "") + data + " "

    @property
    def shape(self) -> set[tuple[str, frozenset[str]]]:
        """The kinds of elements, each with the names of its attributes."""
        return {(tag, frozenset(attributes)) for tag, attributes in self.elements}
