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
    lines: set[int] = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef):
            strings = [one for one in node.body if _is_string(one)]
        else:
            continue
        for one in strings:
            lines.update(range(one.lineno, (one.end_lineno or one.lineno) + 1))
    return lines


def _is_string(statement: ast.stmt) -> bool:
    """Return True for a docstring of a module, class or function, and for one below a constant."""
    return (
        isinstance(statement, ast.Expr)
        and isinstance(statement.value, ast.Constant)
        and isinstance(statement.value.value, str)
    )


def main() -> None:
    """Print the code lines of every package of `executive/` and `skills/`, and the lines of all tests."""
    sizes: Counter[str] = Counter()
    for root in ("executive", "skills"):
        for path in (ROOT / root).rglob("*.py"):
            parts = path.relative_to(ROOT).parts
            sizes["/".join(parts[:-1][:2])] += count_code_lines(path.read_text())
    for name, size in sorted(sizes.items()):
        print(f"{size:7,}  {name}")
    print(f"{sum(sizes.values()):7,}  code lines of executive/ and skills/")
    tests = sum(len(path.read_text().splitlines()) for path in (ROOT / "tests").rglob("*.py"))
    print(f"{tests:7,}  lines of tests")


if __name__ == "__main__":
    sys.exit(main())
