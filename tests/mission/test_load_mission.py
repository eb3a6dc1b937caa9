# ruff: noqa: E501 - findings are quoted as they are printed
"""Loading missions: overrides, files, and what is put in the place of names."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from unittest.mock import Mock

import pytest

from executive.errors import InputError
from executive.mission.load import LoadedMission
from executive.station.check import CellChecker
from executive.text.files import find_mission, get_shipped_folder
from executive.text.findings import MissionError
from executive.tree.specification import Reference, SkillNode

Load = Callable[..., LoadedMission]

HEAD = "mission: m\ncell: cells/small.yaml\n"
PARAMS = HEAD + "params: {tries: 2, high: 0.2, name: a, wide: true, kinds: [cube]}\ntree: Look\n"


def skill(loaded: LoadedMission, name: str) -> SkillNode:
    walked = loaded.tree.walk()
    return next(node for node in walked if isinstance(node, SkillNode) and node.skill == name)


def test_overrides_take_the_type_of_the_default(load: Load) -> None:
    given = {"tries": "5", "high": "1", "name": "007", "wide": "false", "kinds": "[cube, sphere]"}
    params = load(PARAMS, given).params
    assert params == {
        "tries": 5, "high": 1.0, "name": "007", "wide": False, "kinds": ["cube", "sphere"],
    }  # fmt: skip
    assert isinstance(params["high"], float)


@pytest.mark.parametrize(
    ("key", "value", "expected"),
    [
        ("tries", "many", "--set:1:7: error[wrong-type]: tries must be a whole number, not the text \"many\""),
        ("trys", "1", '--set:1:1: error[unknown-param]: the mission has no param "trys"\n   1 | trys=1\n     | ^^^^\n  Did you mean "tries"?'),
    ],
)  # fmt: skip
def test_wrong_overrides_are_findings(load: Load, key: str, value: str, expected: str) -> None:
    with pytest.raises(MissionError) as caught:
        load(PARAMS, {key: value})
    assert expected in str(caught.value)


def test_an_override_out_of_range_is_shown_where_it_was_given(load: Load) -> None:
    text = HEAD + "params: {tries: 2}\ntree: {retry: {attempts: $tries, do: Look}}\n"
    with pytest.raises(MissionError) as caught:
        load(text, {"tries": "0"})
    assert str(caught.value) == (
        "--set:1:7: error[out-of-range]: retry.attempts must be at least 1, not 0 (value of $tries in m.yaml:4)\n"
        "   1 | tries=0\n"
        "     |       ^"
    )


def make_checker(*errors: tuple[tuple[str, ...], str]) -> Mock:
    """Return a checker that finds these errors in every cell file."""
    return Mock(spec=CellChecker, check=Mock(return_value=errors), labels=Mock(return_value={}))


def test_findings_of_the_robot_stand_in_the_cell_file(load: Load) -> None:
    checker = make_checker((("bins", "blue_bin", "position"), "0.3 m out of reach"))
    with pytest.raises(MissionError) as caught:
        load(HEAD + "tree: Look\n", find_checker=lambda name: checker)
    assert str(caught.value).startswith("cells/small.yaml:16:14: error[robot]: 0.3 m out of reach\n")


def test_an_error_of_compute_mass_is_a_finding(load: Load) -> None:
    checker = make_checker()
    checker.compute_mass.side_effect = InputError("no scale")
    with pytest.raises(MissionError, match=r"cells/small.yaml.*robot.*cube.*no scale"):
        load(HEAD + "routes: {cube: red_bin}\ntree: Look\n", find_checker=lambda name: checker)


def test_a_link_out_of_the_folder_is_refused(load: Load, tmp_path: Path, small_cell: str) -> None:
    outside = tmp_path.parent / f"{tmp_path.name}_outside.yaml"
    outside.write_text(small_cell)
    Path("link.yaml").symlink_to(outside)
    with pytest.raises(MissionError, match=r'"link\.yaml" is a link to a file outside'):
        load("mission: m\ncell: link.yaml\ntree: Look\n")


def test_another_cell_replaces_the_cell_of_the_mission(load: Load) -> None:
    Path("other.yaml").write_text(Path("cells/small.yaml").read_text())
    loaded = load("mission: m\ncell: missing.yaml\ntree: Look\n", replacing_cell="other.yaml")
    assert (loaded.cell_path, loaded.replacing_cell) == (Path("other.yaml"), "other.yaml")


@pytest.mark.parametrize("name", ["sort_overhead", "sort_overhead.yaml", "missions/sort_overhead.yaml"])
def test_shipped_missions_go_by_name(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    assert find_mission(name) == get_shipped_folder() / "sort_overhead.yaml"


@pytest.mark.parametrize(
    ("text", "found", "port", "value"),
    [
        ("tree: {use: look}\ntrees: {look: {args: {view: table}, do: {Look: {view: $view}}}}\n", "Look", "view", "table"),
        ("tree: {use: look, with: {view: full}}\ntrees: {look: {args: {view: table}, do: {Look: {view: $view}}}}\n", "Look", "view", "full"),
        ("tree: [{Look: {seen: $first}}, {use: pick, with: {what: $first}}]\n"
         "trees: {pick: {args: [what], returns: [held], do: {Pick: {seen: $what}}}}\n", "Pick", "seen", "first"),
        ("tree: [Look, {Pick: {only: $$5}}]\n", "Pick", "only", "$5"),
    ],
    ids=["a default of an argument", "an argument", "a variable as argument", "a doubled dollar"],
)  # fmt: skip
def test_names_are_replaced_by_what_they_stand_for(
    load: Load, text: str, found: str, port: str, value: str
) -> None:
    setting = skill(load(HEAD + text), found).settings[port]
    assert (setting.name if isinstance(setting, Reference) else setting.value) == value


def test_a_name_that_no_file_can_have_is_not_there_and_an_empty_one_is_a_finding(load: Load) -> None:
    with pytest.raises(InputError, match="there is no mission file"):
        find_mission("x" * 300)
    with pytest.raises(MissionError, match=r"2:7: error\[no-cell\]: there is no file"):
        load(f"mission: m\ncell: {'x' * 300}\ntree: Look\n")
    with pytest.raises(MissionError) as caught:
        load('mission: ""\ncell: ""\ntree: Look\n')
    assert [(f.line, f.col, f.code) for f in caught.value.findings] == [
        (1, 10, "bad-name"),
        (2, 7, "bad-name"),
    ]


def test_a_section_that_the_cell_file_leaves_out_can_be_set_but_not_to_nothing(load: Load) -> None:
    loaded = load(HEAD + "tree: Look\n", {"cell.motion.descent_speed": "0.05"})
    assert loaded.cell_config.motion.descent_speed == 0.05
    with pytest.raises(MissionError, match=r"--set:1:\d+: error\[wrong-type\]"):
        load(HEAD + "tree: Look\n", {"cell.kind": ""})
