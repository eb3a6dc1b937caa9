"""Search for files, and their content within limits: text, and the headers of images."""

from __future__ import annotations

import os.path
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path, PurePosixPath
from typing import BinaryIO

import executive
from executive.errors import InputError
from executive.text.findings import Source, suggest_choice

MAX_TEXT_SIZE = 1_000_000
"""Maximum size of a mission, a cell or another file that people write [byte]."""
MAX_RECORD_SIZE = 10_000_000
"""Maximum size of a file of a run that is read as a whole: tree, result, state of the world [byte]."""
MAX_PIXEL_COUNT = 25_000_000
"""Maximum number of pixels of an image file."""


def is_outside_path(path_text: str) -> bool:
    """Return True if a path may lead out of its folder: it is absolute, or contains `..` or a backslash."""
    path = PurePosixPath(path_text)
    return path.is_absolute() or ".." in path.parts or "\\" in path_text


def has_outside_link(folder: Path, path_text: str) -> bool:
    """Return True if a relative path leads out of a folder through a symbolic link."""
    return not (folder / path_text).resolve().is_relative_to(folder.resolve())


def describe_outside_path(folder: Path, path_text: str) -> str:
    """Return a message if a path in a file in a folder leads out of the folder, otherwise ""."""
    if is_outside_path(path_text):
        return f'"{path_text}" must be a relative path without ".."'
    is_link = has_outside_link(folder, path_text)
    return f'"{path_text}" is a link to a file outside {folder}' if is_link else ""


def get_shipped_folder() -> Path:
    """Return the folder of the shipped missions, in a wheel or in a checkout."""
    package = Path(executive.__file__).parent
    wheel_folder = package / "shipped"
    return wheel_folder if wheel_folder.is_dir() else package.parent / "missions"


def list_shipped_missions() -> list[str]:
    """Return the names of the shipped missions."""
    return sorted(path.stem for path in get_shipped_folder().glob("*.yaml"))


def find_mission(name: str | Path) -> Path:
    """Return the mission file with the path `name`, or the shipped mission with this name.

    Raises:
        InputError: There is no such file and no such shipped mission.
    """
    return _find_file_or_shipped(str(name), "mission", Path("missions"))


def find_cell(name: str) -> Path:
    """Return the cell file with the path `name`, or the shipped cell with this name.

    Raises:
        InputError: There is no such file and no such shipped cell.
    """
    return _find_file_or_shipped(name, "cell", Path("missions/cells"))


def _find_file_or_shipped(name: str, noun: str, folder: Path) -> Path:
    path = Path(name)
    # Unlike the methods of Path, these functions return False for invalid file names.
    if os.path.isfile(path):
        return path
    if os.path.lexists(path):
        raise InputError(f'"{name}" is {_describe_kind(path)}, not a file')
    shipped_folder = get_shipped_folder() / folder.relative_to("missions")
    shipped_files = {file.stem: file for file in sorted(shipped_folder.glob("*.yaml"))}
    stem = name.removeprefix(f"{folder}/").removesuffix(".yaml")
    if stem in shipped_files:
        return shipped_files[stem]
    hint = suggest_choice(stem, shipped_files, f"Shipped {noun}s")
    raise InputError(f'there is no {noun} file and no shipped {noun} "{name}". {hint}')


def find_file_below(folder: Path, reference: str, shipped_subfolders: Sequence[str] = ("",)) -> Path:
    """Return the file with the relative path `reference` in `folder`, otherwise in a shipped subfolder.

    Raises:
        InputError: The reference leaves the folder, or the file does not exist.
    """
    if is_outside_path(reference):
        advice = 'give a relative path without ".."'
        raise InputError(f'"{reference}" is outside the folder of the file that names it; {advice}')
    roots = (folder, *(get_shipped_folder() / subfolder for subfolder in shipped_subfolders))
    for root in roots:
        path = root / reference
        if os.path.isfile(path):
            if has_outside_link(root, reference):
                raise InputError(f'"{reference}" is a link to a file outside {root}')
            return path
        if os.path.lexists(path):
            raise InputError(f'"{reference}" in {_shorten_path(root)} is {_describe_kind(path)}, not a file')
    subfolder = PurePosixPath(reference).parent
    existing_files = {
        path.relative_to(root).as_posix()
        for root in roots
        if os.path.isdir(root / subfolder)
        for path in (root / subfolder).glob("*.yaml")
    }
    hint = suggest_choice(reference, sorted(existing_files), "Existing files")
    folders = " or ".join(dict.fromkeys(map(_shorten_path, roots)))
    raise InputError(f'there is no file "{reference}" in {folders}. {hint}')


def read_file(path: Path, max_size: int = MAX_TEXT_SIZE) -> bytes:
    """Return the content of a file of at most `max_size` [byte].

    Raises:
        InputError: The file is missing, a folder, a pipe or a device, too large, or cannot be read.
    """
    with _open_file(path) as file:
        content = file.read(max_size + 1)
    if len(content) > max_size:
        raise InputError(f"{path} is larger than {max_size} bytes, the maximum size of such a file")
    return content


@contextmanager
def _open_file(path: Path) -> Iterator[BinaryIO]:
    """Yield the open file; raise InputError if it is missing, no regular file, or cannot be read."""
    try:
        # Opening a pipe would wait for a writer.
        if os.path.exists(path) and not os.path.isfile(path):
            raise InputError(f"{path} is {_describe_kind(path)}, not a file")
        with path.open("rb") as file:
            yield file
    except FileNotFoundError:
        raise InputError(f"there is no file {path}") from None
    except (OSError, ValueError) as error:
        raise InputError(f"{path} cannot be read: {getattr(error, 'strerror', error)}") from None


def read_lines(path: Path, max_length: int) -> Iterator[bytes]:
    """Yield the lines of a file, of at most `max_length` [byte], with their line feeds, while it is read.

    A long line of zero bytes, which a power cut may leave at the end of a file, ends the lines.

    Raises:
        InputError: The file is missing, a folder, a pipe or a device, cannot be read, or has a longer line.
    """
    with _open_file(path) as file:
        while line := file.readline(max_length + 1):
            if len(line) > max_length:
                if not line.strip(b"\0"):
                    return
                raise InputError(f"{path} has a line of more than {max_length} bytes; it is damaged")
            yield line


def read_source(path: Path) -> Source:
    """Return the text of a file.

    Raises:
        InputError: The file is missing, too large, or not UTF-8 text.
    """
    try:
        return Source(_shorten_path(path), read_file(path).decode("utf-8-sig"))
    except UnicodeDecodeError as error:
        raise InputError(f"{path} is not UTF-8 text: byte {error.start} is invalid") from None


def read_image_header(path: Path) -> tuple[tuple[int, int], bool]:
    """Return width and height of the upright image, and True if the file contains upright RGB or grey pixels.

    Raises:
        InputError: The image cannot be read, or has more than `MAX_PIXEL_COUNT` pixels.
    """
    from PIL import ExifTags, Image  # The import takes 0.1 s, and missions name no images.

    try:
        with Image.open(path) as image:
            width, height = image.size
            if width * height > MAX_PIXEL_COUNT:
                raise ValueError("it has too many pixels")
            orientation = image.getexif().get(ExifTags.Base.Orientation, 1)
            is_plain = orientation == 1 and image.mode in ("RGB", "L")
    except Exception as error:  # Pillow raises errors of many types for damaged files.
        advice = f"write a sound JPEG or PNG file of at most {MAX_PIXEL_COUNT} pixels"
        raise InputError(f"the image {path} cannot be read; {advice}") from error
    # The orientations 5 to 8 contain a quarter turn.
    return ((height, width) if orientation in range(5, 9) else (width, height)), is_plain


def _describe_kind(path: str | Path) -> str:
    if os.path.isdir(path):
        return "a folder"
    return "a pipe or a device" if os.path.exists(path) else "a link to nothing"


def _shorten_path(path: Path) -> str:
    """Return the path relative to the working directory; a path outside this directory is unchanged."""
    try:
        cwd = Path.cwd()
    except FileNotFoundError:  # The working directory was deleted.
        return str(path)
    return str(path.relative_to(cwd)) if path.is_absolute() and path.is_relative_to(cwd) else str(path)
