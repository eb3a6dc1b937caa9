"""Names: unique classes, verbs for functions, and none of the words that nobody outside the project uses."""

from __future__ import annotations

import ast
import re
from collections import Counter
from collections.abc import Iterator

from guide_blocks import GUIDES, ROOT

FORBIDDEN_WORDS = frozenset((ROOT / "tests/words.txt").read_text(encoding="utf-8").split())
IRREGULAR_PARTICIPLES = re.compile(
    "begun|bought|broken|brought|built|caught|chosen|done|drawn|driven|fallen|found|given|gone|grown|heard|held|"
    "kept|known|laid|left|lost|made|meant|met|paid|seen|sent|shown|sold|spent|stood|stuck|taken|thrown|written"
)
NO_PARTICIPLES = frozenset({"during", "finding", "mapping", "proceed", "succeed", "warning"})
VALUE_DECORATORS = ("property", "contextmanager", "fixture", "parametrize")
"""Decorators of functions that are used like values."""
PREPOSITIONS = frozenset({"as", "at", "by", "for", "from", "in", "into", "of", "on", "to", "up", "with"})


def _modules(*folders: str) -> Iterator[tuple[str, ast.Module]]:
    for folder in folders:
        for path in sorted((ROOT / folder).rglob("*.py")):
            yield str(path.relative_to(ROOT)), ast.parse(path.read_text(encoding="utf-8"))


def _identifiers(tree: ast.Module) -> Iterator[tuple[int, str]]:
    """Yield the line and the name of every definition."""
    for node in ast.walk(tree):
        match node:
            case ast.FunctionDef() | ast.AsyncFunctionDef() | ast.ClassDef():
                yield node.lineno, node.name
            case ast.arg():
                yield node.lineno, node.arg
            case ast.Name(ctx=ast.Store()):
                yield node.lineno, node.id
            case ast.Attribute(ctx=ast.Store()):
                yield node.lineno, node.attr


def _words(text: str) -> set[str]:
    return {word.lower() for word in re.findall(r"[A-Z]?[a-z]+|[A-Z]+(?![a-z])", text)}


def test_no_two_classes_have_the_same_name() -> None:
    names = Counter(
        node.name
        for _, tree in _modules("executive", "skills")
        for node in tree.body
        if isinstance(node, ast.ClassDef)
    )
    assert [name for name, count in names.items() if count > 1] == []


def test_no_name_contains_a_forbidden_word() -> None:
    found = [
        f"{path}:{line} {name}"
        for path, tree in _modules("executive", "skills")
        for line, name in _identifiers(tree)
        if _words(name) & FORBIDDEN_WORDS
    ]
    assert found == []


def test_no_text_contains_a_forbidden_word() -> None:
    texts = [
        (f"{path}:{node.lineno}", node.value)
        for path, tree in _modules("executive", "skills")
        for node in ast.walk(tree)
        if isinstance(node, ast.Constant) and isinstance(node.value, str)
    ]
    guides = [*GUIDES, "CONTRIBUTING.md", "executive/README.md", "tests/benchmarks/README.md"]
    files = [*(ROOT / "missions").rglob("*.yaml"), *(ROOT / "executive").rglob("*.jinja")]
    pages = [path for path in (ROOT / "executive/view").rglob("*") if path.suffix in (".html", ".js", ".svg")]
    for path in (*(ROOT / guide for guide in guides), *files, *pages):
        for number, line in enumerate(path.read_text(encoding="utf-8").splitlines(), 1):
            texts.append((f"{path.relative_to(ROOT)}:{number}", line))
    assert [f"{place} {words}" for place, text in texts if (words := _words(text) & FORBIDDEN_WORDS)] == []


def test_no_function_that_acts_is_named_by_a_participle() -> None:
    found = [
        f"{path}:{node.lineno} {node.name}"
        for path, tree in _modules("executive", "skills")
        for node in ast.walk(tree)
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef)
        and _is_participle(node.name.strip("_"))
        and not any(word in ast.unparse(one) for one in node.decorator_list for word in VALUE_DECORATORS)
    ]
    assert found == []


def _is_participle(name: str) -> bool:
    """Return True for `killed` and `taken_from`, False for a value such as `learning_rate`."""
    first, *others = name.split("_")
    if others and others[0] not in PREPOSITIONS:
        return False
    return IRREGULAR_PARTICIPLES.fullmatch(first) is not None or (
        re.fullmatch(r"\w\w+(ed|ing)", first) is not None and first not in NO_PARTICIPLES
    )


PARALLEL_PACKAGES = (
    {
        "executive/cell",
        "executive/cell/config",
        "executive/cells",
        "executive/cells/sim",
        "executive/cells/fake",
    },
    {"executive/view/live", "executive/view/report"},
)
"""Packages with the same structure; `executive/cli` mirrors the packages whose commands it contains."""


def test_modules_have_the_same_name_only_in_parallel_packages() -> None:
    packages: dict[str, set[str]] = {}
    for path, _ in _modules("executive", "skills"):
        package, _, name = path.rpartition("/")
        if not name.startswith("__") and package != "executive/cli":
            packages.setdefault(name, set()).add(package)
    repeated = {name: found for name, found in packages.items() if len(found) > 1}
    assert {
        name: found
        for name, found in repeated.items()
        if not any(found <= parallel for parallel in PARALLEL_PACKAGES)
    } == {}
