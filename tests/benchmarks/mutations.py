"""Mutation score of the default tests: the share of small random faults in the code that they detect.

`python -m tests.benchmarks.mutations --seed 2` draws 60 mutations and runs, for each one, those tests of the
default tier that execute the changed line. A mutation that no test detects survives and is listed.
`--json` prints all mutations. `--from FILE` reads such an output and makes the same mutations again, also in
statements that have moved to another file; a mutation whose statement does not exist any more is `gone`.
"""

from __future__ import annotations

import argparse
import ast
import json
import os
import random
import shutil
import subprocess
import sys
import tempfile
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, dataclass
from itertools import accumulate
from pathlib import Path
from queue import Queue

from coverage import CoverageData

ROOT = Path(__file__).parents[2]

EXCLUDED_FOLDERS = ("executive/cli/setup", "executive/view/live", "executive/training")
"""Code that slow tests cover: projects in processes of their own, browsers, training."""

MAX_SELECTED_TESTS = 400
"""Greatest number of tests that pytest is given one by one; if there are more, it is given their files."""

MUTANT_TIMEOUT = 420.0
"""Time after which a run of the tests counts as a detected endless loop [s]."""

PYTEST = (sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider")

COMPARISONS: Mapping[type[ast.cmpop], str] = {
    ast.Lt: "<=",
    ast.LtE: "<",
    ast.Gt: ">=",
    ast.GtE: ">",
    ast.Eq: "!=",
    ast.NotEq: "==",
    ast.Is: "is not",
    ast.IsNot: "is",
    ast.In: "not in",
    ast.NotIn: "in",
}
ARITHMETIC: Mapping[type[ast.operator], str] = {ast.Add: "-", ast.Sub: "+", ast.Mult: "/", ast.Div: "*"}


@dataclass(frozen=True)
class Mutation:
    """One changed place of the code.

    Attributes:
        kind: `operator`, `constant`, `deleted line` or `swapped arguments`.
        path: File, relative to the repository.
        line: First line of the place, from 1.
        function: Name of the innermost function around the place, after the name of its class; "" for none.
        text: The first line of the place in the file, without indentation.
        span: First and last offset of the replaced text in the file [byte].
        old: The replaced text.
        new: Its replacement.
    """

    kind: str
    path: str
    line: int
    function: str
    text: str
    span: tuple[int, int]
    old: str
    new: str


def find_mutations(path: Path, source: str) -> Iterator[Mutation]:
    """Yield every mutation of the four kinds in one module; text, messages and imports are left unchanged."""
    lines = source.encode().splitlines(keepends=True)
    starts = [0, *accumulate(map(len, lines))]
    tree = ast.parse(source)
    functions = _name_functions(tree)

    def mutation_of(kind: str, node: ast.expr | ast.stmt, new: str) -> Mutation:
        assert node.end_lineno is not None and node.end_col_offset is not None
        first = starts[node.lineno - 1] + node.col_offset
        last = starts[node.end_lineno - 1] + node.end_col_offset
        text = lines[node.lineno - 1].decode().strip()
        old = source.encode()[first:last].decode()
        return Mutation(
            kind, str(path), node.lineno, functions.get(id(node), ""), text, (first, last), old, new
        )

    skipped = {id(child) for node in ast.walk(tree) if _is_skipped(node) for child in ast.walk(node)}
    for node in ast.walk(tree):
        if id(node) in skipped:
            continue
        if isinstance(node, ast.Compare) and len(node.ops) == 1 and type(node.ops[0]) in COMPARISONS:
            left, right = ast.unparse(node.left), ast.unparse(node.comparators[0])
            yield mutation_of("operator", node, f"({left} {COMPARISONS[type(node.ops[0])]} {right})")
        elif isinstance(node, ast.BinOp) and type(node.op) in ARITHMETIC:
            left, right = ast.unparse(node.left), ast.unparse(node.right)
            yield mutation_of("operator", node, f"(({left}) {ARITHMETIC[type(node.op)]} ({right}))")
        elif isinstance(node, ast.BoolOp):
            word = " or " if isinstance(node.op, ast.And) else " and "
            values = word.join(f"({ast.unparse(value)})" for value in node.values)
            yield mutation_of("operator", node, f"({values})")
        elif isinstance(node, ast.Constant) and type(node.value) in (bool, int, float):
            yield mutation_of("constant", node, _change_constant(node.value))
        elif isinstance(node, ast.FunctionDef):
            yield from (mutation_of("deleted line", child, "pass") for child in _deletable_statements(node))
        if isinstance(node, ast.Call) and len(node.args) >= 2:
            first, second = (ast.unparse(one) for one in node.args[:2])
            if first != second and not any(isinstance(one, ast.Starred) for one in node.args[:2]):
                rest = [*map(ast.unparse, node.args[2:]), *map(ast.unparse, node.keywords)]
                arguments = ", ".join([second, first, *rest])
                yield mutation_of("swapped arguments", node, f"{ast.unparse(node.func)}({arguments})")


def _name_functions(tree: ast.Module) -> dict[int, str]:
    """Return the name of the innermost function around each node, by the identity of the node."""
    names: dict[int, str] = {}
    classes: dict[int, str] = {}
    for node in ast.walk(tree):
        if isinstance(node, ast.ClassDef):
            classes.update({id(child): f"{node.name}." for child in ast.walk(node)})
        elif isinstance(node, ast.FunctionDef):
            names.update({id(child): classes.get(id(node), "") + node.name for child in ast.walk(node)})
    return names


def _is_skipped(node: ast.AST) -> bool:
    """Return True for text, annotations, imports and raised errors: they hold messages or nothing to run."""
    return isinstance(node, ast.JoinedStr | ast.Raise | ast.Import | ast.ImportFrom | ast.arg)


def _change_constant(value: bool | int | float) -> str:
    if isinstance(value, bool):
        return str(not value)
    return str(value + 1) if isinstance(value, int) or value == 0.0 else str(2 * value)


def _deletable_statements(function: ast.FunctionDef) -> Iterator[ast.stmt]:
    """Yield the simple statements of a function, without its docstring."""
    for node in ast.walk(function):
        if isinstance(node, ast.Assign | ast.AugAssign | ast.Return | ast.Continue | ast.Break) or (
            isinstance(node, ast.Expr) and not isinstance(node.value, ast.Constant)
        ):
            yield node


def list_mutations(root: Path) -> list[Mutation]:
    """Return every mutation of `executive/` and `skills/`."""
    return [
        mutation
        for folder in ("executive", "skills")
        for path in sorted((root / folder).rglob("*.py"))
        if not str(path.relative_to(root)).startswith(EXCLUDED_FOLDERS)
        for mutation in find_mutations(path.relative_to(root), path.read_text())
    ]


def draw_mutations(mutations: Sequence[Mutation], seed: int, count: int) -> list[Mutation]:
    """Return `count` random mutations, the four kinds in equal numbers."""
    chance = random.Random(seed)
    kinds = sorted({one.kind for one in mutations})
    by_kind = [[one for one in mutations if one.kind == kind] for kind in kinds]
    return [chance.choice(by_kind[index % len(kinds)]) for index in range(count)]


def find_again(former: Mutation, mutations: Sequence[Mutation]) -> Mutation | None:
    """Return the mutation of the present code that equals a former one; None if there is none, or several.

    The file may have another name, then the class, then the line breaks of the statement.
    """
    equal = [one for one in mutations if _get_change(one) == _get_change(former)]
    for names in (("text", "function", "path"), ("text", "function"), ("text",), ()):
        found = [one for one in equal if all(getattr(one, name) == getattr(former, name) for name in names)]
        if found and len({(one.path, one.function) for one in found}) == 1:
            return min(found, key=lambda one: abs(one.line - former.line))
    return None


def _get_change(mutation: Mutation) -> tuple[str, ...]:
    """Return what equal mutations have in common, whatever their file, class and line breaks are."""
    function = mutation.function.rpartition(".")[2]
    return mutation.kind, function, "".join(mutation.old.split()), "".join(mutation.new.split())


def read_mutations(file: Path) -> list[Mutation]:
    """Return the mutations in the output of an earlier call with `--json`, or in a list of mutations."""
    content = json.loads(file.read_text())
    names = Mutation.__dataclass_fields__
    entries = content["mutations"] if isinstance(content, dict) else content
    return [Mutation(**{name: entry[name] for name in names}) for entry in entries]


def measure_coverage(root: Path) -> None:
    """Run the default tests once, and write which test executes which line."""
    options = ["-n", "2", "--cov=executive", "--cov=skills", "--cov-context=test", "--cov-report="]
    subprocess.run([*PYTEST, *options], cwd=root, check=True)


def select_tests(data: CoverageData, root: Path, mutation: Mutation) -> list[str]:
    """Return the tests that execute the mutated line or, if only imports do, all that execute its module."""
    lines = data.contexts_by_lineno(str(root / mutation.path))
    at_line = {context for context in lines.get(mutation.line, []) if context}
    contexts = at_line or {context for found in lines.values() for context in found if context}
    tests = sorted({context.rpartition("|")[0] for context in contexts})
    package = Path(mutation.path).parts[1]
    if len(tests) > MAX_SELECTED_TESTS:
        tests = sorted({test.partition("::")[0] for test in tests})
    return sorted(tests, key=lambda test: package not in test)


def run_tests_on_mutant(working_copy: Path, mutation: Mutation, tests: Sequence[str]) -> bool:
    """Apply the mutation to a copy of the repository, run the tests, and return True if they fail or hang."""
    if not tests:
        return False
    path = working_copy / mutation.path
    original = path.read_bytes()
    first, last = mutation.span
    path.write_bytes(original[:first] + mutation.new.encode() + original[last:])
    try:
        done = subprocess.run(
            [*PYTEST, "-x", *tests],
            cwd=working_copy,
            env={**os.environ, "PYTHONPATH": str(working_copy), "PYTHONDONTWRITEBYTECODE": "1"},
            capture_output=True,
            timeout=MUTANT_TIMEOUT,
        )
    except subprocess.TimeoutExpired:
        return True
    finally:
        path.write_bytes(original)
    return done.returncode != 0


def main() -> None:
    """Make mutations, test each one, and print those that survive."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--count", type=int, default=60)
    parser.add_argument("--from", dest="file", type=Path, help="make the mutations of an earlier call again")
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--keep-coverage", action="store_true", help="use the coverage of the last run")
    parser.add_argument("--json", action="store_true")
    options = parser.parse_args()
    possible = list_mutations(ROOT)
    if options.file:
        drawn = read_mutations(options.file)
        mutations = [find_again(one, possible) for one in drawn]
    else:
        drawn = draw_mutations(possible, options.seed, options.count)
        mutations = [*drawn]
    if not options.keep_coverage:
        measure_coverage(ROOT)
    data = CoverageData(str(ROOT / ".coverage"))
    data.read()
    with tempfile.TemporaryDirectory() as folder:
        working_copies: Queue[Path] = Queue()
        for number in range(options.workers):
            working_copy = Path(folder) / str(number)
            ignored = shutil.ignore_patterns(".git", ".venv", "runs", "__pycache__", ".*_cache", ".coverage")
            shutil.copytree(ROOT, working_copy, ignore=ignored)
            working_copies.put(working_copy)

        def find_result(mutation: Mutation | None) -> str:
            if mutation is None:
                return "gone"
            working_copy = working_copies.get()
            try:
                tests = select_tests(data, ROOT, mutation)
                return "detected" if run_tests_on_mutant(working_copy, mutation, tests) else "survived"
            finally:
                working_copies.put(working_copy)

        with ThreadPoolExecutor(options.workers) as pool:
            results = list(pool.map(find_result, mutations))
    found = [present or former for present, former in zip(mutations, drawn, strict=True)]
    if options.json:
        rows = [{**asdict(one), "result": result} for one, result in zip(found, results, strict=True)]
        print(json.dumps({"seed": options.seed, "mutations": rows}, indent=1))
        return
    print(f"{len(drawn)} mutations: {dict(Counter(results))}")
    for one, result in zip(found, results, strict=True):
        if result != "detected":
            print(f"{result}: {one.path}:{one.line}: {one.kind}: {one.old!r} -> {one.new!r}")


if __name__ == "__main__":
    main()
