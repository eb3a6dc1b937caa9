"""Size of the code: lines without blank, comment and docstring lines."""

from __future__ import annotations

import ast
import io
import sys
import tokenize
from collections import Counter
from pathlib import Path

ROOT = Path(__file__).parents[2]

LAYOUT_TOKENS = {
    tokenize.COMMENT,
    tokenize.NL,
    tokenize.NEWLINE,
    tokenize.INDENT,
    tokenize.DEDENT,
    tokenize.ENCODING,
    tokenize.ENDMARKER,
}


def count_code_lines(source: str) -> int:
    """Return the number of lines of a Python module that hold code."""
    lines: set[int] = set()
    for token in tokenize.generate_tokens(io.StringIO(source).readline):
        if token.type not in LAYOUT_TOKENS:
            lines.update(range(token.start[0], token.end[0] + 1))
    return len(lines - _docstring_lines(ast.parse(source)))


def _docstring_lines(tree: ast.Module) -> set[int]:
    """Return the lines of all statements that are only a text: docstrings, also those below constants."""
    lines: set[int] = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.Expr) and isinstance(getattr(node.value, "value", None), str):
            lines.update(range(node.lineno, (node.end_lineno or node.lineno) + 1))
    return lines


def main() -> None:
    """Print the code lines of every package of `executive/` and `skills/`, and those of the tests."""
    sizes: Counter[str] = Counter()
    for path in [path for root in ("executive", "skills", "tests") for path in (ROOT / root).rglob("*.py")]:
        parts = path.relative_to(ROOT).parts[:-1]
        sizes["/".join(parts[:2])] += count_code_lines(path.read_text())
    for name, size in sorted(sizes.items()):
        print(f"{size:7,}  {name}")
    tests = sum(size for name, size in sizes.items() if name.startswith("tests"))
    print(f"{sizes.total() - tests:7,}  code lines of executive/ and skills/")
    print(f"{tests:7,}  code lines of tests/")


if __name__ == "__main__":
    sys.exit(main())
