"""Hostile files and arguments for the command line, each decided by its seed."""

from __future__ import annotations

import json
import os
import random
import re
from pathlib import Path

import cv2
import numpy as np

from tests.mission.mutations import mutate_text
from tests.mission.mutator import Base, Mutator

Arguments = list[str]
"""Arguments of the command `executive`."""

MISSIONS = Path(__file__).parents[2] / "missions"
ODD_WORDS = (
    "\x1b[31mred\x1b[0m", "\x07", "\x00", "\x9b2J", "\u202eabc", "a/b", "../x", "", " ", "\n", "x" * 5_000,
    "nan", "-inf", "1e308", "-1e308", "1e-300", "9" * 400, "é" * 100, "\U0001f980", "$", "!!python/name:os",
)  # fmt: skip
"""Words that replace a word of a file."""
REPETITIONS = (10, 200, 3_000, 50_000, 300_000)
MAX_REPEATED_TEXT = 4_000_000
"""Largest text that repeats one line of a file [characters]."""
URDF = (
    "<robot name='r'><link name='l'><inertial><mass value='0.1'/><inertia ixx='1e-4' ixy='0' ixz='0' "
    "iyy='1e-4' iyz='0' izz='1e-4'/></inertial><visual><geometry><box size='0.05 0.05 0.05'/></geometry>"
    "</visual><collision><geometry><mesh filename='m.obj'/></geometry></collision></link></robot>\n"
)
MESH = "v 0 0 0\nv 0.05 0 0\nv 0 0.05 0\nv 0 0 0.05\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 1 4 3\n"
MISSION = (
    "mission: hostile\ncell: cell.yaml\n"
    "routes: {cube: red_bin, sphere: red_bin, duck: red_bin}\ntree: [MoveToScan]\n"
)
COCO = {
    "images": [{"id": 1, "file_name": "a.jpg", "width": 64, "height": 48}],
    "annotations": [{"id": 1, "image_id": 1, "category_id": 3, "bbox": [10, 20, 30, 20]}],
    "categories": [{"id": 3, "name": "duck"}],
}


class TextMaker:
    """Writes mission, cell and library files that are mutated or corrupted."""

    def __init__(self) -> None:
        missions = {file.stem: file.read_text() for file in sorted(MISSIONS.glob("*.yaml"))}
        library = (MISSIONS / "library" / "sorting.yaml").read_text()
        cells = {name: re.search(r"^cell: (\S+)$", text, re.MULTILINE) for name, text in missions.items()}
        files = {name: found[1] for name, found in cells.items() if found}
        self._bases = [
            *(Base(name, "mission.yaml", text, text) for name, text in missions.items()),
            *(Base(f, f, (MISSIONS / f).read_text(), missions[name]) for name, f in files.items()),
            *[Base("library", "library/sorting.yaml", library, missions["sort_overhead"])] * 4,
        ]
        self._mutator = Mutator(self._bases)

    def write(self, seed: int, folder: Path) -> Arguments:
        """Write a mission and the files it names; return the command that checks it."""
        rng = random.Random(seed)
        base, text = self._mutator.mutant(seed)
        content = text.encode()
        if rng.random() < 0.5:
            base = rng.choice(self._bases)
            content = corrupt_text(rng, base.text)
        (folder / base.file).parent.mkdir(parents=True, exist_ok=True)
        (folder / "mission.yaml").write_text(base.mission)
        (folder / base.file).write_bytes(content)
        return ["check", "mission.yaml", *rng.choice(([], ["--json"]))]


def corrupt_text(rng: random.Random, text: str) -> bytes:
    """Return a text with an odd word, repetitions, deep nesting, aliases, another encoding or wrong bytes."""
    lines, count, word = text.splitlines(keepends=True), rng.choice(REPETITIONS), rng.choice(ODD_WORDS)
    line, spot = rng.randrange(len(lines)), rng.choice(list(re.finditer(r"[\w.$]+", text)))
    repetitions = min(count, 1 + MAX_REPEATED_TEXT // len(lines[line]))
    before, after = text[: spot.start()], text[spot.end() :]
    bomb = "".join(f"k{n}: &a{n} [{', '.join([f'*a{n - 1}'] * 10)}]\n" for n in range(1, rng.choice((3, 9))))
    changed = rng.choice(
        (
            before + word + after,
            before + json.dumps(word) + after,
            "".join([*lines[:line], lines[line] * repetitions, *lines[line:]]),
            before + "[" * count + after,
            before + "{a: " * min(count, 50_000) + after,
            before + "[" + "1," * count + "]" + after,
            text + "".join(f"key{n}: 1\n" for n in range(count)),
            text + "again: 1\n" * count,
            before + "{parallel: [" + "Wait," * min(count, 50_000) + "]}" + after,
            before + "x" * count + after,
            "k0: &a0 x\n" + bomb + text,
        )
    )
    encoding = rng.choice(("utf-8", "utf-8", "utf-8", "utf-8", "utf-16", "utf-8-sig", "latin-1"))
    content = changed.encode(encoding, "replace")
    if rng.random() < 0.1:
        at = rng.randrange(len(content))
        content = content[:at] + rng.randbytes(rng.choice((1, 9, 1_000))) + content[at:]
    return content


def write_data_set(seed: int, folder: Path) -> Arguments:
    """Write a COCO or YOLO folder with one image, damage it, and return a command that reads it."""
    rng = random.Random(seed)
    split = folder / "data" / rng.choice(("train", "valid", "test"))
    is_yolo = rng.random() < 0.5
    image = split / "images/a.jpg" if is_yolo else split / "a.jpg"
    image.parent.mkdir(parents=True)
    cv2.imwrite(str(image), np.full((48, 64, 3), 120, np.uint8))
    if is_yolo:
        names = rng.choice(("names: [cube, duck]\n", "names: {0: cube, 1: duck}\n"))
        texts = {
            split.parent / "data.yaml": f"train: train/images\nval: valid/images\nnc: 2\n{names}",
            split / "labels/a.txt": "1 0.5 0.5 0.25 0.5\n0 0.1 0.1 0.3 0.1 0.3 0.2\n",
        }
    else:
        texts = {split / "_annotations.coco.json": json.dumps(COCO, indent=1)}
    for file, text in texts.items():
        file.parent.mkdir(exist_ok=True)
        file.write_text(text)
    for _ in range(rng.choice((1, 1, 2))):
        _damage(rng, rng.choice([*texts, *texts, image]))
    return ["evaluate", "--dataset", "data", "--cell", "overhead", "--out", "measured.json", "--json"]


def write_model(seed: int, folder: Path) -> Arguments:
    """Write a cell with a damaged URDF, mesh or detector model, and return a command that reads it."""
    rng = random.Random(seed)
    mesh = rng.random() < 0.4
    cube = f"{{{'mesh: m.obj' if mesh else 'urdf: m.urdf'}, height: 0.05, radius: 0.0354}}"
    cell = f"cell: hostile\nbase: overhead.yaml\nobjects:\n  cube: {cube}\n"
    if rng.random() < 0.2:
        cell += "detectors: {embedded: {kind: rfdetr, model_path: m.onnx, labels: labels.txt}}\n"
    model = "m.obj" if mesh or rng.random() < 0.3 else "m.urdf"
    texts = {
        "cell.yaml": cell,
        "mission.yaml": MISSION,
        "m.urdf": URDF,
        "m.obj": MESH,
        "m.onnx": "model",
        "labels.txt": "cube\nsphere\nduck\n",
    }
    for name, text in texts.items():
        (folder / name).write_text(text)
    _damage(rng, folder / rng.choice((model, model, "m.onnx", "labels.txt")))
    return rng.choice(
        (
            ["check", "mission.yaml"],
            ["dataset", "cell.yaml", "--images", "1", "--workers", "1", "--out", "out"],
        )
    )


def write_odd_paths(seed: int, folder: Path) -> Arguments:
    """Return a command with an odd path or number."""
    rng = random.Random(seed)
    (folder / "folder.yaml").mkdir()
    os.mkfifo(folder / "pipe.yaml")
    (folder / "dangling.yaml").symlink_to("nowhere")
    (folder / "loop.yaml").symlink_to("loop.yaml")
    (folder / "garbage.yaml").write_bytes(rng.randbytes(300))
    odd = [word for word in ODD_WORDS if "\0" not in word]
    local = ["folder.yaml", "pipe.yaml", "dangling.yaml", "loop.yaml", "garbage.yaml", "no.yaml", "x" * 300]
    path = rng.choice([*odd, *local, *local, "/etc/passwd", "/dev/null", "/dev/full", "/proc/self/mem", "~"])
    fake = ["sort_overhead", "--set", "cell.kind=fake"]
    return rng.choice(
        [
            ["check", path], ["run", path], ["tree", path], ["run", "--resume", path], ["replay", path],
            ["report", path], ["skills", path], ["schema", path], [path],
            ["replay", path, "--video", "a.gif"],
            ["run", *fake, "--seed", path], ["run", *fake, "--runs", path], ["sweep", *fake, "--seeds", path],
            ["run", *fake, "--set", path], ["run", *fake, "--request", path], ["run", *fake, "--scene", path],
            ["check", "sort_overhead", "--set", f"cell.objects.cube.urdf={path}"],
            ["check", "sort_overhead", "--set", f"cell.table.colour={path}"],
            ["evaluate", "--weights", path, "--dataset", "folder.yaml"], ["evaluate", "--dataset", path],
            ["evaluate", "--cell", path], ["dataset", path, "--out", "out"],
            ["dataset", "overhead", "--images", "1", "--workers", "1", "--out", path],
        ]
    )  # fmt: skip


def _damage(rng: random.Random, file: Path) -> None:
    """Change the content of a file, or put something else in its place."""
    change = rng.random()
    if change < 0.75 and file.is_file() and file.suffix != ".jpg":
        text = file.read_text(errors="replace")
        content = text if re.search(r"\w", text) else "a"
        mutated = mutate_text(rng, content).encode(errors="replace")
        file.write_bytes(rng.choice((mutated, corrupt_text(rng, content))))
        return
    if file.is_dir() and not file.is_symlink():
        file.rmdir()
    file.unlink(missing_ok=True)
    kind = rng.randrange(6)
    if kind == 0:
        os.mkfifo(file)
    elif kind == 1:
        file.mkdir()
    elif kind == 2:
        file.symlink_to(rng.choice(("/etc/passwd", "nowhere", file.name, "../../other")))
    elif kind == 3:
        file.write_bytes(rng.randbytes(rng.choice((0, 1, 5_000))))
    elif kind == 4:
        with file.open("wb") as sparse:
            sparse.truncate(rng.choice((1_000_001, 20_000_001, 3_000_000_000)))
