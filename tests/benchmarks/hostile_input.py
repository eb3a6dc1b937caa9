"""Commands with hostile input: internal errors, exit codes, time, memory and control characters.

The seed of a case decides its files and its command, which runs in a forked child process, so that all
modules are imported already. A command has a problem if it has an internal error, exceeds a limit, ends with
another exit code than 0, 1, 2 or 4, or prints a control character or one character more than 200 times.
"""

from __future__ import annotations

import json
import os
import re
import resource
import signal
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from importlib import import_module
from pathlib import Path
from random import Random
from shutil import copytree

import cv2
import numpy as np
from PIL import Image

from executive.behaviours import load_skills
from executive.cli.main import COMMANDS, main
from tests.benchmarks.report import Figures, run_command, show_progress

MAX_CPU_TIME = 5.0
"""Largest accepted CPU time of a command, without the import of Python modules [s]."""
MAX_MEMORY = 300.0
"""Largest accepted resident memory of `check`, `sweep` and `compare` [MB]."""
MAX_WALL_TIME = 60
"""Wall time after which a command is killed [s]."""
EXIT_CODES = (0, 1, 2, 4)
"""Exit codes that a command with hostile input may have."""
FORBIDDEN = re.compile(r"[\x00-\x08\x0b-\x1f\x7f-\x9f]|(.)\1{200}")
"""Control characters but tab and new line, and one character more than 200 times in a row."""

MISSIONS = Path(__file__).parents[2] / "missions"
ODD_WORDS = (
    "\x1b[31mred\x1b[0m", "\x07", "\x00", "\x9b2J", "\u202eabc", "a/b", "../x", "", " ", "\n", "x" * 5_000,
    "nan", "-inf", "1e308", "-1e308", "1e-300", "9" * 400, "é" * 100, "\U0001f980", "$", "!!python/name:os",
)  # fmt: skip
"""Words that replace a word of a file."""
MAX_REPEATED_TEXT = 4_000_000
"""Largest text that repeats one line of a file [characters]."""
DATA_SETS: tuple[dict[str, str], ...] = (
    {
        "_annotations.coco.json": json.dumps(
            {
                "images": [{"id": 1, "file_name": "a.jpg", "width": 64, "height": 48}],
                "annotations": [{"id": 1, "image_id": 1, "category_id": 3, "bbox": [10, 20, 30, 20]}],
                "categories": [{"id": 3, "name": "duck"}],
            },
            indent=1,
        )
    },
    {
        "../data.yaml": "train: train/images\nval: valid/images\nnc: 2\nnames: {0: cube, 1: duck}\n",
        "labels/a.txt": "1 0.5 0.5 0.25 0.5\n0 0.1 0.1 0.3 0.1 0.3 0.2\n",
    },
)
"""Files of a COCO and of a YOLO folder, relative to the folder of the split `train`, `valid` or `test`."""
MODEL_FILES = {
    "cell.yaml": (
        "cell: hostile\nbase: overhead.yaml\nobjects:\n  cube: {MODEL, height: 0.05, radius: 0.0354}\n"
    ),
    "mission.yaml": ("mission: hostile\ncell: cell.yaml\nroutes: {cube: red_bin}\ntree: [MoveToScan]\n"),
    "m.urdf": (
        "<robot name='r'><link name='l'><inertial><mass value='0.1'/><inertia ixx='1e-4' ixy='0' ixz='0' "
        "iyy='1e-4' iyz='0' izz='1e-4'/></inertial><visual><geometry><box size='0.05 0.05 0.05'/></geometry>"
        "</visual><collision><geometry><mesh filename='m.obj'/></geometry></collision></link></robot>\n"
    ),
    "a.mtl": "newmtl a\nKd 1 1 1\nmap_Kd t.png\n",
    "m.obj": "mtllib a.mtl\nusemtl a\ng a\n"
    "v 0 0 0\nv 0.05 0 0\nv 0 0.05 0\nv 0 0 0.05\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 1 4 3\n",
    "m.onnx": "model",
    "labels.txt": "cube\nsphere\nduck\n",
}
"""Files of a mission with an object and a detector of its own."""

Arguments = list[str]
"""Arguments of the command `executive`."""
Writer = Callable[[Random, Path], Arguments]
"""Writes the files of a case into a folder, and returns a command."""


def write_texts(rng: Random, folder: Path) -> Arguments:
    """Write a mission and damage it, its cell or its library; return a command that checks it."""
    mission = rng.choice(sorted(MISSIONS.glob("*.yaml"))).read_text()
    cell = re.search(r"^cell: (\S+)$", mission, re.MULTILINE)
    names = ["mission.yaml", "mission.yaml", "library/sorting.yaml", *([cell[1]] if cell else [])]
    name = rng.choice([*names, "pyproject.toml"])
    texts = {"mission.yaml": mission, "pyproject.toml": (MISSIONS.parent / "pyproject.toml").read_text()}
    text = texts.get(name) or (MISSIONS / name).read_text()
    (folder / "mission.yaml").write_text(mission)
    (folder / name).parent.mkdir(exist_ok=True)
    (folder / name).write_bytes(damage_text(rng, text))
    return ["check", "mission.yaml", *rng.choice(([], ["--json"]))]


def write_data_set(rng: Random, folder: Path) -> Arguments:
    """Write a COCO or YOLO folder with one image, damage it, and return a command that reads it."""
    split = folder / "data" / rng.choice(("train", "valid", "test"))
    texts = rng.choice(DATA_SETS)
    image = split / ("images/a.jpg" if "labels/a.txt" in texts else "a.jpg")
    image.parent.mkdir(parents=True)
    cv2.imwrite(str(image), np.full((48, 64, 3), 120, np.uint8))
    for name, text in texts.items():
        (split / name).parent.mkdir(exist_ok=True)
        (split / name).write_text(text)
    for _ in range(rng.choice((1, 1, 2))):
        damage_file(rng, rng.choice([*[split / name for name in texts] * 2, image]))
    return ["evaluate", "--dataset", "data", "--cell", "overhead", "--out", "measured.json", "--json"]


def write_model(rng: Random, folder: Path) -> Arguments:
    """Write a cell with a damaged URDF, mesh or detector model, and return a command that reads it."""
    model = rng.choice(("mesh: m.obj", "urdf: m.urdf"))
    for name, text in MODEL_FILES.items():
        (folder / name).write_text(text.replace("MODEL", model))
    if rng.random() < 0.2:
        with (folder / "cell.yaml").open("a") as cell:
            cell.write("detectors: {embedded: {kind: rfdetr, model_path: m.onnx, labels: labels.txt}}\n")
    cv2.imwrite(str(folder / "t.png"), np.full((4, 4, 3), 120, np.uint8))
    names = ("m.urdf", "m.obj", "m.obj", "a.mtl", "t.png", "m.onnx", "labels.txt")
    damage_file(rng, folder / rng.choice(names))
    dataset = ["dataset", "cell.yaml", "--images", "1", "--workers", "1", "--out", "out"]
    return rng.choice((["check", "mission.yaml"], dataset))


def write_record(run: Path, rng: Random, folder: Path) -> Arguments:
    """Copy a run, damage a file of the copy, and return a command that reads it."""
    copytree(run, folder / "run")
    damage_file(rng, folder / "run" / rng.choice(("cell.yaml", "tree.json", "result.json", "mission.yaml")))
    return [rng.choice(("report", "replay")), "run"]


def write_odd_paths(rng: Random, folder: Path) -> Arguments:
    """Return a command with an odd path or number."""
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
            ["run", *fake, "--seed", path], ["run", *fake, "--runs", path], ["sweep", *fake, "--seeds", path],
            ["run", *fake, "--set", path], ["run", *fake, "--request", path], ["run", *fake, "--scene", path],
            ["check", "sort_overhead", "--set", f"cell.objects.cube.urdf={path}"],
            ["check", "sort_overhead", "--set", f"cell.table.colour={path}"],
            ["evaluate", "--weights", path, "--dataset", "folder.yaml"], ["evaluate", "--dataset", path],
            ["evaluate", "--cell", path], ["dataset", path, "--out", "out"],
            ["dataset", "overhead", "--images", "1", "--workers", "1", "--out", path],
        ]
    )  # fmt: skip


def damage_text(rng: Random, text: str) -> bytes:
    """Return a text with odd or exchanged words, repetitions, deep nesting, aliases, or wrong bytes."""
    lines = text.splitlines(keepends=True)
    line = rng.randrange(len(lines))
    count = rng.choice((10, 200, 3_000, 50_000, 300_000))
    odd_word = rng.choice(ODD_WORDS)
    words = list(re.finditer(r"[\w.$]+", text))
    word = rng.choice(words)
    before = text[: word.start()]
    after = text[word.end() :]
    repetitions = min(count, 1 + MAX_REPEATED_TEXT // len(lines[line]))
    bomb = "".join(f"k{n}: &a{n} [{', '.join([f'*a{n - 1}'] * 10)}]\n" for n in range(1, rng.choice((3, 9))))
    changed = rng.choice(
        (
            before + odd_word + after,
            before + rng.choice(words)[0] + after,
            before + json.dumps(odd_word) + after,
            "".join(lines[:line] + lines[line + 1 :]),
            "".join(lines[:line] + [lines[line]] * repetitions + lines[line + 1 :]),
            "".join([*lines[:line], "  " + lines[line], *lines[line + 1 :]]),
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
    content = changed.encode(rng.choice(("utf-8",) * 4 + ("utf-16", "utf-8-sig", "latin-1")), "replace")
    if rng.random() < 0.1:
        start = rng.randrange(len(content) + 1)
        content = content[:start] + rng.randbytes(rng.choice((1, 9, 1_000))) + content[start:]
    return content


def damage_file(rng: Random, file: Path) -> None:
    """Change the content of a file, or put something else in its place."""
    if rng.random() < 0.75 and file.is_file() and file.suffix not in (".jpg", ".png"):
        text = file.read_text(errors="replace")
        file.write_bytes(damage_text(rng, text if re.search(r"\w", text) else "a"))
        return
    if file.is_dir() and not file.is_symlink():
        file.rmdir()
    file.unlink(missing_ok=True)
    size = rng.choice((0, 1, 5_000, 20_000_001, 3_000_000_000))
    replace = rng.choice(
        (
            lambda: os.mkfifo(file),
            file.mkdir,
            lambda: file.symlink_to(rng.choice(("/etc/passwd", "nowhere", file.name, "../../other"))),
            lambda: file.write_bytes(rng.randbytes(min(size, 5_000))),
            lambda: Image.new("1", (20_000, 20_000)).save(file, "png"),
            lambda: (file.touch(), os.truncate(file, size)),
            lambda: None,
        )
    )
    replace()


@dataclass(frozen=True)
class CommandResult:
    """Result of a command: exit code, standard output and error, CPU time [s] and peak memory [MB]."""

    exit_code: int
    output: str
    errors: str
    cpu_time: float
    memory: float


def measure(texts: int = 5000, data_sets: int = 300, models: int = 300, seed: int = 0) -> Figures:
    """Run commands with hostile missions, cells, libraries, data sets, models, paths and records."""
    for name in COMMANDS:
        import_module(f"executive.cli.{COMMANDS[name]}")
    load_skills()
    runs = tempfile.TemporaryDirectory()  # The end of the function removes the folder.
    run_fake = ["run", "sort_overhead", "--set", "cell.kind=fake", "--runs", "."]
    run_in_child(lambda: main(run_fake), Path(runs.name), Path(runs.name))
    groups: list[tuple[str, int, Writer]] = [
        ("texts", texts, write_texts),
        ("data sets", data_sets, write_data_set),
        ("models", models // 2, write_model),
        ("paths", models - models // 2, write_odd_paths),
        ("records", models, partial(write_record, next(Path(runs.name).glob("2*/*")))),
    ]
    rows: list[Figures] = []
    problems: list[str] = []
    for group, count, write in groups:
        results = []
        for case in show_progress(range(seed, seed + count), group):
            with tempfile.TemporaryDirectory() as folder, tempfile.TemporaryDirectory() as logs:
                arguments = write(Random(case), Path(folder))
                result = run_in_child(lambda words=arguments: main(words), Path(folder), Path(logs))
            results.append(result)
            found = find_problems(arguments, result)
            problems += [f"{group} {case}, {' '.join(arguments)[:80]}: {problem}" for problem in found]
        rows.append({"group": group, **summarize(results)})
    return {"seed": seed, "groups": rows, "problems": problems}


def run_in_child(command: Callable[[], object], folder: Path, logs: Path) -> CommandResult:
    """Run a command, which ends with SystemExit, in a forked child whose working directory is `folder`."""
    outputs = [logs / "output.txt", logs / "errors.txt"]
    # A child begins with the memory of this process, which is not counted.
    inherited_pages = int(Path("/proc/self/statm").read_text().split()[1])
    child = os.fork()
    if child == 0:
        try:
            os.chdir(folder)
            for descriptor, file in zip((1, 2), outputs, strict=True):
                os.dup2(os.open(file, os.O_WRONLY | os.O_CREAT), descriptor)
            sys.stdout, sys.stderr = (os.fdopen(os.dup(number), "w") for number in (1, 2))
            os.environ["TMPDIR"] = tempfile.tempdir = str(logs)
            command()
        except SystemExit as end:
            sys.stdout.flush()
            sys.stderr.flush()
            os._exit(end.code if isinstance(end.code, int) else 0)
        finally:
            os._exit(99)
    status, usage = _wait(child)
    output, errors = (file.read_bytes().decode(errors="backslashreplace") for file in outputs)
    cpu_time = usage.ru_utime + usage.ru_stime
    memory = usage.ru_maxrss / 1e3 - inherited_pages * resource.getpagesize() / 1e6
    return CommandResult(os.waitstatus_to_exitcode(status), output, errors, cpu_time, memory)


def _wait(child: int) -> tuple[int, resource.struct_rusage]:
    """Wait for a child, kill it after `MAX_WALL_TIME`, and return its status and its use of resources."""
    end = time.monotonic() + MAX_WALL_TIME
    while True:
        pid, status, usage = os.wait4(child, os.WNOHANG)
        if pid:
            return status, usage
        if time.monotonic() > end:
            os.kill(child, signal.SIGKILL)
        time.sleep(0.002)


def find_problems(arguments: Arguments, result: CommandResult) -> list[str]:
    """Return everything that is wrong with the result of a command."""
    text = result.output + result.errors
    problems = []
    if "internal error" in text or "Traceback" in text:
        problems.append(f"an internal error: {text[-300:]}")
    if result.exit_code not in EXIT_CODES:
        problems.append(f"exit code {result.exit_code}: {text[-300:]}")
    if result.cpu_time > MAX_CPU_TIME:
        problems.append(f"{result.cpu_time:.1f} s of CPU time; {MAX_CPU_TIME:g} s are allowed")
    if result.memory > MAX_MEMORY and arguments[0] in ("check", "sweep", "compare"):
        problems.append(f"{result.memory:.0f} MB of memory; {MAX_MEMORY:g} MB are allowed")
    if found := FORBIDDEN.search(text):
        problems.append(f"prints {found[0][:20]!r}: {text[max(found.start() - 60, 0) : found.end()][:300]!r}")
    if result.exit_code and not text.strip():
        problems.append(f"exit code {result.exit_code} without a message")
    if "--json" in arguments and result.output:
        try:
            json.loads(result.output)
        except ValueError as error:
            problems.append(f"standard output is no JSON: {error}")
    return problems


def summarize(results: list[CommandResult]) -> Figures:
    """Return the exit codes of commands, and their largest CPU time and memory."""
    codes = Counter(result.exit_code for result in results)
    return {
        "cases": len(results),
        "exit codes": ", ".join(f"{count} x {code}" for code, count in sorted(codes.items())),
        "cpu_time_s": max((result.cpu_time for result in results), default=0.0),
        "memory_mb": max((result.memory for result in results), default=0.0),
    }


if __name__ == "__main__":
    run_command(measure)
