"""Generator of `skills/reference.md`: all that a skill may call, and the test kit, from docstrings.

Write the file again with `uv run python .ci/skill_reference.py`.
"""

from __future__ import annotations

import ast
import inspect
import re
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).parent.parent
PATH = ROOT / "skills" / "reference.md"
COMMAND = "uv run python .ci/skill_reference.py"
INTRODUCTION = f"""# Reference: everything that a skill may call, and the test kit

Generated from the docstrings of the protocols by `{COMMAND}`. The guide is [README.md](README.md).

* No call waits. A method or function that returns `Steps` or a `Generator` is called with `yield from`.
* Units are in brackets, shapes of arrays in parentheses.
* Positions are in the world frame: z points up, and the top of the table is at z = 0.
* `Array` is a NumPy array of floats, and `Item` the name of an item (`cube-2`).
* `Box` contains the left, top, right and bottom side of a box in an image [pixel].
* `Seconds`, `Metres` and `MetresPerSecond` are floats with a unit; so is `Annotated[float, "N"]`.
* Exceptions are defined in `executive/errors.py`, `SkillFailed` in `executive/skill.py`.
* All times and effects of faults are imported from `executive.testing.faults`.
"""

PARTS: dict[str, list[tuple[str, str, str]]] = {
    "The cell": [("cell", "cell/protocols.py", "Cell")],
    "Clock": [("cell.clock", "cell/protocols.py", "Clock")],
    "Arm": [
        ("cell.arm", "cell/arm.py", "Arm"),
        ("class Arm(MovingArm)", "cell/arm.py", "MovingArm"),
        ("planning = cell.arm.plan(goal, task)", "cell/arm.py", "Planning"),
        ("motion = planning.result()", "cell/arm.py", "Motion"),
        ("goal = Goal(...)", "cell/arm.py", "Goal"),
        ("task = Task(...)", "cell/arm.py", "Task"),
        ("obstacle = Obstacle(...)", "cell/objects.py", "Obstacle"),
        ("tool_pose = cell.arm.tool_pose", "geometry.py", "Pose"),
    ],
    "Tool": [
        ("cell.tool", "cell/protocols.py", "Tool"),
        ("cell.tool_model", "cell/tools.py", "ToolModel"),
        ("grasp = cell.tool_model.list_grasps(...)[0]", "cell/tools.py", "GraspPose"),
        ("measurement = cell.tool_model.measure_contact(...)", "cell/tools.py", "ToolMeasurement"),
    ],
    "Camera": [
        ("cell.camera", "cell/protocols.py", "Camera"),
        ("frame = cell.camera.capture()", "cell/frame.py", "Frame"),
    ],
    "Detectors": [
        ("detector = cell.detectors[name]", "cell/protocols.py", "Detector"),
        ("request = detector.request(frame, view)", "cell/protocols.py", "Request"),
        ("answer = request.result()", "cell/frame.py", "Answer"),
        ("answer.error_rates", "cell/frame.py", "ErrorRates"),
        ("detection = answer.confident[0]", "cell/frame.py", "Detection"),
        ("detections = Detections(...)", "cell/frame.py", "Detections"),
    ],
    "Localizer": [
        ("cell.localizer", "cell/protocols.py", "Localizer"),
        ("observation = cell.localizer.localize(detections)[0]", "cell/frame.py", "Observation"),
    ],
    "Ledger": [
        ("cell.ledger", "cell/ledger.py", "Ledger"),
        ("target = cell.ledger.find_targets()[0]", "cell/objects.py", "Target"),
    ],
    "Operator": [("cell.operator", "cell/protocols.py", "Operator")],
    "Bins and classes": [
        ("bin = cell.bins[name]", "cell/objects.py", "Bin"),
        ("kind = cell.classes[label]", "cell/objects.py", "ObjectClass"),
    ],
    "The skill itself": [
        ("self", "skill.py", "Skill"),
        ("executive.skill", "skill.py", ""),
        ("param(...)", "skill.py", "Param"),
        ("port(...)", "skill.py", "Port"),
    ],
    "Functions that skills share": [
        ("executive.manipulation.motions", "manipulation/motions.py", ""),
        ("executive.manipulation.tool_goals", "manipulation/tool_goals.py", ""),
        ("executive.perception.evidence", "perception/evidence.py", ""),
    ],
    "Test kit: fake cell": [
        ("fake = FakeCell()", "testing/fake_cell.py", "FakeCell"),
        ("fake.world", "drivers/fake_world.py", "FakeWorld"),
        ("fake.arm", "drivers/fake.py", "FakeArm"),
        ("fake.tool", "drivers/fake.py", "FakeTool"),
        ("fake.camera", "drivers/fake.py", "FakeCamera"),
        ("fake.detector", "perception/detectors/cell_detector.py", "TruthDetector"),
    ],
    "Test kit: run a skill or a mission": [
        ("executive.testing.run_skill", "testing/run_skill.py", ""),
        ("result = run_skill(...)", "testing/run_skill.py", "SkillResult"),
        ("executive.testing.run_mission", "testing/run_mission.py", ""),
        ("result = run_mission(...)", "testing/run_mission.py", "MissionResult"),
        ("class MissionResult(RunEnded)", "events.py", "RunEnded"),
    ],
    "Test kit: faults": [
        ("Times and effects", "testing/faults.py", ""),
        ("effect = Effect(...)", "testing/faulty_cell.py", "Effect"),
    ],
    "Test kit: conformance": [
        ("Checks", "testing/conformance.py", ""),
        ("scene", "testing/conformance.py", "SkillScene"),
    ],
}
"""For each section and table the expression of the object, the file, and the class; "": the functions."""

Row = tuple[str, str]
"""Code of a member, and its meaning."""


def generate() -> str:
    """Return the text of the reference."""
    sections = (
        f"## {heading}\n\n" + "\n".join(_format_table(*part) for part in parts)
        for heading, parts in PARTS.items()
    )
    return INTRODUCTION + "\n" + "\n".join(sections)


def _format_table(expression: str, file: str, name: str) -> str:
    owner: ast.AST = ast.parse((ROOT / "executive" / file).read_text(encoding="utf-8"))
    title = f"### {expression}"
    if name:
        owner = next(one for one in ast.walk(owner) if isinstance(one, ast.ClassDef) and one.name == name)
        title = f"### {name}: `{expression}`"
    text, entries = _parse_docstring(owner)
    attributes = dict(entries.get("Attributes", ()))
    if file.startswith(("drivers/", "perception/detectors/", "testing/fake_cell")) and name != "FakeWorld":
        # The methods are those of the protocols.
        rows = [(_format_code(attribute), _escape(meaning)) for attribute, meaning in attributes.items()]
    else:
        rows = list(_list_rows(owner, attributes))
    lines = [("member", "meaning"), ("---", "---"), *rows]
    return f"{title}\n\n{text}\n\n" + "".join(f"| {' | '.join(line)} |\n" for line in lines)


def _list_rows(owner: ast.AST, attributes: dict[str, str]) -> Iterator[Row]:
    """Yield a row for each public attribute, property, method or function of a class or module."""
    for member in getattr(owner, "body", ()):
        if isinstance(member, ast.AnnAssign) and isinstance(owner, ast.ClassDef):
            name = ast.unparse(member.target)
            code = re.sub(r": ClassVar\[(.*)\] =", r": \1 =", ast.unparse(member))
            if (meaning := attributes.get(name)) is None:
                continue  # A key of a cell file, which the reference of missions explains.
        elif isinstance(member, ast.FunctionDef) and not member.name.startswith("_"):
            code, meaning = _format_signature(member), _describe(member)
        else:
            continue
        code = re.sub("'([^'\"]*)'", r'"\1"', code).replace("field(default_factory=dict)", "{}")
        yield _format_code(code.replace("field(default_factory=list)", "[]")), _escape(meaning)


def _format_signature(function: ast.FunctionDef) -> str:
    result = "" if function.returns is None else ast.unparse(function.returns)
    if any(isinstance(one, ast.Name) and one.id == "property" for one in function.decorator_list):
        return f"{function.name}: {result}"
    arguments = re.sub(r"^(self|cls)(, |$)", "", ast.unparse(function.args))
    if arguments == "runs: SkillRuns":
        return function.name
    arguments = re.sub(r"(: [^=()]*)=", r"\1 = ", arguments)
    return f"{function.name}({arguments}) -> {result}"


def _describe(function: ast.FunctionDef) -> str:
    text, entries = _parse_docstring(function)
    arguments = [f"`{name}`: {meaning}" for name, meaning in entries.get("Args", ())]
    errors = [f"Raises `{name}`: {meaning}" for name, meaning in entries.get("Raises", ())]
    return " ".join([text, *arguments, *errors])


def _parse_docstring(owner: ast.AST) -> tuple[str, dict[str, list[tuple[str, str]]]]:
    """Return the text of a docstring, and the entries of its sections (`Args`, `Attributes`, `Raises`)."""
    assert isinstance(owner, ast.Module | ast.ClassDef | ast.FunctionDef)
    docstring = inspect.cleandoc(ast.get_docstring(owner) or "")
    text, *parts = re.split(r"^(Args|Attributes|Raises):\n", docstring, flags=re.MULTILINE)
    entries = {}
    for section, lines in zip(parts[::2], parts[1::2], strict=True):
        found = re.findall(r"^    (\w[\w, ]*): (.*(?:\n {5,}.*)*)", lines, re.MULTILINE)
        entries[section] = [
            (name, " ".join(meaning.split())) for names, meaning in found for name in names.split(", ")
        ]
    return " ".join(text.split()), entries


def _format_code(text: str) -> str:
    return f"`{_escape(text)}`"


def _escape(text: str) -> str:
    """Return a text for a cell of a table, in which a bar would begin the next cell."""
    return text.replace("|", r"\|")


if __name__ == "__main__":
    PATH.write_text(generate(), encoding="utf-8")
