"""Tests of BehaviorTree.CPP 4.10, restated as missions whose skills follow scripts.

A script contains one word for each activation of a skill, with one letter per tick: `R` running, `S` success,
`F` failure. The last word is used again and again. An expectation contains one word per tick: the statuses of
a node in the tick, then `H` if the node was halted; `-` if the node was not ticked. If the expectation of
`root` contains the word `H`, the test halts the tree instead of a tick. The script of an action that takes
time in the original has one letter for each tick of the original.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field


@dataclass(frozen=True)
class Case:
    """A restated test.

    Attributes:
        name: Name of the original test: file, fixture and test.
        tree: Tree of the mission. Its skills are `A` to `G` and `T`, each with a digit or not; `C` and `T`
            are conditions, which end in the first tick.
        scripts: Scripts by skill; `S` for other skills.
        expected: Statuses by node in BehaviorTree.CPP; `root` is the root of the tree.
        different: Statuses by node that differ here.
        reason: Reason of the difference.
    """

    name: str
    tree: str
    scripts: Mapping[str, str]
    expected: Mapping[str, str]
    different: Mapping[str, str] = field(default_factory=dict)
    reason: str = ""


ALL_TICKED = (
    "Parallel of BehaviorTree.CPP ends as soon as a child decides; here, all running children are ticked."
)
TICK_PER_ATTEMPT = (
    "The original ticks the node without a tree, so that all attempts run in one tick. In a tree of "
    "BehaviorTree.CPP and here, an attempt of one tick is followed by the next attempt in the next tick."
)
NO_SKIP = "There is no status SKIPPED; a condition in a fallback takes its place, and the sequence succeeds."
NO_POSITION = (
    "SequenceWithMemory continues after a failure at the child that failed; a sequence begins again, as "
    "Sequence of BehaviorTree.CPP. To try only one child again, write a retry around the child."
)
OWN_FAILURE_COUNT = (
    "Parallel has a number of failures of its own, failure_count; here the node fails as soon as too few "
    "children are left that can succeed."
)
TIMER = (
    "A timer thread of BehaviorTree.CPP halts the body before the tick; here the node halts it in the tick."
)
NO_CATCH_ON_HALT = "The option catch_on_halt has no counterpart: neither catch nor finally run after a halt."
NO_LAST_TICK = "A loop of BehaviorTree.CPP needs one more tick after the last element; for_each ends with it."
ONE_SLOW_CHILD = (
    "Only one child of a sequence without memory may take time; so the outer sequence has a memory, and does "
    "not check the condition of its first child again."
)

CASES = (
    # gtest_sequence.cpp
    Case("sequence/SimpleSequenceTest.ConditionTrue", "[C, A]", {"A": "RR"},
         {"root": "R", "C": "S", "A": "R"}),
    Case("sequence/SimpleSequenceTest.ConditionTurnToFalse", "[C, A]", {"C": "F", "A": "RR"},
         {"root": "F F", "C": "F F", "A": "- -"}),
    Case("sequence/ComplexSequenceTest.ComplexSequenceConditionsTrue",
         "{sequence: {memory: false, do: [[C1, C2], A]}}", {"A": "RR"},
         {"root": "R", "C1": "S", "C2": "S", "A": "R"}),
    Case("sequence/SequenceTripleActionTest.TripleAction", "[C, A1, A2, A3]", {"A1": "RRRS", "A3": "RRRS"},
         {"root": "R R R R R R S", "C": "S - - - - - -", "A1": "R R R S - - -", "A2": "- - - S - - -",
          "A3": "- - - R R R S"}),
    Case("sequence/ComplexSequence2ActionsTest.ConditionsTrue", "[[C1, A1], [C2, A2]]",
         {"A1": "RRS", "A2": "RRR"},
         {"root": "R R R R", "C1": "S - - -", "A1": "R R S -", "C2": "- - S -", "A2": "- - R R"}),
    Case("sequence/ComplexSequenceTest.ComplexSequenceConditions1ToFalse",
         "{sequence: {memory: false, do: [[C1, C2], A]}}", {"C1": "S F", "A": "RR"},
         {"root": "R F", "C1": "S F", "C2": "S -", "A": "R H"}),
    Case("sequence/ComplexSequenceTest.ComplexSequenceConditions2ToFalse",
         "{sequence: {memory: false, do: [[C1, C2], A]}}", {"C2": "S F", "A": "RR"},
         {"root": "R F", "C1": "S S", "C2": "S F", "A": "R H"}),
    Case("sequence/SimpleSequenceWithMemoryTest.ConditionTrue", "[C, A]", {"A": "RR"},
         {"root": "R", "C": "S", "A": "R"}),
    Case("sequence/SimpleSequenceWithMemoryTest.ConditionTurnToFalse", "[C, A]", {"C": "S F", "A": "RR"},
         {"root": "R R", "C": "S -", "A": "R R"}),
    Case("sequence/ComplexSequenceWithMemoryTest.ConditionsTrue", "[[C1, C2], [A1, A2]]", {"A1": "RR"},
         {"root": "R", "C1": "S", "C2": "S", "A1": "R", "A2": "-"}),
    Case("sequence/ComplexSequenceWithMemoryTest.Conditions1ToFalse", "[[C1, C2], [A1, A2]]",
         {"C1": "S F", "A1": "RR"},
         {"root": "R R", "C1": "S -", "C2": "S -", "A1": "R R", "A2": "- -"}),
    Case("sequence/SequenceWithMemoryTest.Issue_636", "[A, C, B, D]", {"C": "F F F F S"},
         {"root": "F F F F S", "A": "S - - - -", "C": "F F F F S", "B": "- - - - S", "D": "- - - - S"},
         {"A": "S S S S S"}, NO_POSITION),
    # gtest_fallback.cpp
    Case("fallback/SimpleFallbackTest.ConditionTrue", "{fallback: [C, A]}", {"A": "RR"},
         {"root": "S", "C": "S", "A": "-"}),
    Case("fallback/SimpleFallbackTest.ConditionChangeWhileRunning", "{fallback: [C, A]}",
         {"C": "F S", "A": "RR"}, {"root": "R R", "C": "F -", "A": "R R"}),
    Case("fallback/ReactiveFallbackTest.Condition1ToTrue", "{fallback: {memory: false, do: [C1, C2, A]}}",
         {"C1": "F S", "C2": "F", "A": "RR"}, {"root": "R S", "C1": "F S", "C2": "F -", "A": "R H"}),
    Case("fallback/ReactiveFallbackTest.Condition2ToTrue", "{fallback: {memory: false, do: [C1, C2, A]}}",
         {"C1": "F", "C2": "F S", "A": "RR"}, {"root": "R S", "C1": "F F", "C2": "F S", "A": "R H"}),
    Case("fallback/SimpleFallbackWithMemoryTest.ConditionFalse", "{fallback: [C, A]}",
         {"C": "F", "A": "RR"}, {"root": "R", "C": "F", "A": "R"}),
    Case("fallback/SimpleFallbackWithMemoryTest.ConditionTurnToTrue", "{fallback: [C, A]}",
         {"C": "F S", "A": "RR"}, {"root": "R R", "C": "F -", "A": "R R"}),
    Case("fallback/ComplexFallbackWithMemoryTest.ConditionsTrue",
         "{fallback: [{fallback: [C1, C2]}, {fallback: [A1, A2]}]}", {"A1": "RR"},
         {"root": "S", "C1": "S", "C2": "-", "A1": "-", "A2": "-"}),
    Case("fallback/ComplexFallbackWithMemoryTest.Condition1False",
         "{fallback: [{fallback: [C1, C2]}, {fallback: [A1, A2]}]}", {"C1": "F", "A1": "RR"},
         {"root": "S", "C1": "F", "C2": "S", "A1": "-", "A2": "-"}),
    Case("fallback/ComplexFallbackWithMemoryTest.ConditionsFalse",
         "{fallback: [{fallback: [C1, C2]}, {fallback: [A1, A2]}]}", {"C1": "F", "C2": "F", "A1": "RR"},
         {"root": "R", "C1": "F", "C2": "F", "A1": "R", "A2": "-"}),
    Case("fallback/ComplexFallbackWithMemoryTest.Conditions1ToTrue",
         "{fallback: [{fallback: [C1, C2]}, {fallback: [A1, A2]}]}", {"C1": "F S", "C2": "F", "A1": "RR"},
         {"root": "R R", "C1": "F -", "C2": "F -", "A1": "R R", "A2": "- -"}),
    Case("fallback/ComplexFallbackWithMemoryTest.Conditions2ToTrue",
         "{fallback: [{fallback: [C1, C2]}, {fallback: [A1, A2]}]}", {"C1": "F", "C2": "F S", "A1": "RR"},
         {"root": "R R", "C1": "F -", "C2": "F -", "A1": "R R", "A2": "- -"}),
    Case("fallback/ComplexFallbackWithMemoryTest.Action1Failed",
         "{fallback: [{fallback: [C1, C2]}, {fallback: [A1, A2]}]}",
         {"C1": "F", "C2": "F", "A1": "RRF", "A2": "RR"},
         {"root": "R R R", "C1": "F - -", "C2": "F - -", "A1": "R R F", "A2": "- - R"}),
    # gtest_reactive.cpp. A leaf of one tick between the children represents AsyncSequence.
    Case("reactive/RunningChildren", "{sequence: {memory: false, do: [[T1, T2, T3], [D, G1, E, G2, F]]}}",
         {"G1": "RS", "G2": "RS"},
         {"root": "R R S", "T1": "S S S", "T2": "S S S", "T3": "S S S", "D": "S - -", "E": "- S -",
          "F": "- - S"}),
    # A condition in a fallback represents _skipIf.
    Case("reactive/Issue587",
         "{sequence: {memory: false, do: [{fallback: [C, T]}, {retry: {attempts: 5, do: B}}]}}",
         {"C": "F S", "B": "F"},
         {"root": "R R R R F", "T": "S - - - -", "B": "F F F F F"}),
    Case("reactive/TestLogging", "{sequence: {memory: false, do: [T1, T2, D]}}", {"D": "RRRRS"},
         {"root": "R R R R S", "T1": "S S S S S", "T2": "S S S S S", "D": "R R R R S"}),
    Case("reactive/ReactiveSequence_FirstChildFails", "{sequence: {memory: false, do: [T, A]}}", {"T": "F"},
         {"root": "F", "T": "F", "A": "-"}),
    Case("reactive/ReactiveSequence_HaltOnConditionChange", "{sequence: {memory: false, do: [C, A]}}",
         {"C": "S S F", "A": "RRR"}, {"root": "R R F", "C": "S S F", "A": "R R H"}),
    Case("reactive/ReactiveFallback_FirstChildSucceeds", "{fallback: {memory: false, do: [T, A]}}", {},
         {"root": "S", "T": "S", "A": "-"}),
    Case("reactive/ReactiveFallback_AllChildrenFail", "{fallback: {memory: false, do: [T1, T2, T3]}}",
         {"T1": "F", "T2": "F", "T3": "F"}, {"root": "F", "T1": "F", "T2": "F", "T3": "F"}),
    Case("reactive/ReactiveFallback_SecondChildSucceeds", "{fallback: {memory: false, do: [T, A]}}",
         {"T": "F"}, {"root": "S", "T": "F", "A": "S"}),
    Case("reactive/ReactiveSequence_AllChildrenSucceed", "{sequence: {memory: false, do: [T1, T2, T3]}}", {},
         {"root": "S", "T1": "S", "T2": "S", "T3": "S"}),
    Case("reactive/ReactiveSequence_ReEvaluatesOnEveryTick", "{sequence: {memory: false, do: [C, A]}}",
         {"A": "RRS"}, {"root": "R R S", "C": "S S S", "A": "R R S"}),
    # A guard is a reactive sequence of a condition and a body.
    Case("reactive/ReactiveSequence_FirstChildFails, guard", "{guard: {holds: C, do: A}}", {"C": "F"},
         {"root": "F", "C": "F", "A": "-"}),
    Case("reactive/ReactiveSequence_HaltOnConditionChange, guard", "{guard: {holds: C, do: A}}",
         {"C": "S S F", "A": "RRR"}, {"root": "R R F", "C": "S S F", "A": "R R H"}),
    Case("reactive/ReactiveSequence_ReEvaluatesOnEveryTick, guard", "{guard: {holds: C, do: A}}",
         {"A": "RRS"}, {"root": "R R S", "C": "S S S", "A": "R R S"}),
    # gtest_reactive_backchaining.cpp
    Case("reactive_backchaining/EnsureWarm",
         "{fallback: {memory: false, do: [C1, {sequence: {memory: false, do: [C2, A]}}]}}",
         {"C1": "F F F S", "A": "RRS"},
         {"root": "R R S S", "C1": "F F F S", "C2": "S S S -", "A": "R R S -"}),
    Case("reactive_backchaining/EnsureWarmWithEnsureHoldingHacket",
         "{fallback: {memory: false, do: [C1, [{fallback: {memory: false, do: [C2, "
         "{sequence: {memory: false, do: [C3, A1]}}]}}, A2]]}}",
         {"C1": "F F F F F S", "C2": "F F F S", "A1": "RRS", "A2": "RRS"},
         {"root": "R R R R S S", "C1": "F F F F F S", "C2": "F F F S S -", "C3": "S S S - - -",
          "A1": "R R S - - -", "A2": "- - R R S -"},
         {"C2": "F F F - - -"}, ONE_SLOW_CHILD),
    # gtest_parallel.cpp
    Case("parallel/SimpleParallelTest.ConditionsTrue", "{parallel: {halt: true, do: [C1, A1, C2, A2]}}",
         {"A1": "RS", "A2": "RRS"},
         {"root": "R R S", "C1": "S - -", "A1": "R S -", "C2": "S - -", "A2": "R R S"}),
    Case("parallel/SimpleParallelTest.Threshold_3",
         "{parallel: {wait_for: 3, halt: true, do: [C1, A1, C2, A2]}}", {"A1": "RS", "A2": "RRR"},
         {"root": "R S", "C1": "S -", "A1": "R S", "C2": "S -", "A2": "R H"}, {"A2": "R RH"}, ALL_TICKED),
    Case("parallel/SimpleParallelTest.Threshold_neg2",
         "{parallel: {wait_for: 3, halt: true, do: [C1, A1, C2, A2]}}", {"A1": "RS", "A2": "RRR"},
         {"root": "R S", "C1": "S -", "A1": "R S", "C2": "S -", "A2": "R H"}, {"A2": "R RH"}, ALL_TICKED),
    Case("parallel/SimpleParallelTest.Threshold_neg1", "{parallel: {halt: true, do: [C1, A1, C2, A2]}}",
         {"A1": "RS", "A2": "RRS"},
         {"root": "R R S", "C1": "S - -", "A1": "R S -", "C2": "S - -", "A2": "R R S"}),
    Case("parallel/SimpleParallelTest.Threshold_thresholdFneg1",
         "{parallel: {wait_for: any, do: [C1, A1, C2, A2]}}",
         {"C1": "F", "A1": "RF", "C2": "F", "A2": "RF"},
         {"root": "R F", "C1": "F -", "A1": "R F", "C2": "F -", "A2": "R F"}),
    Case("parallel/SimpleParallelTest.Threshold_2",
         "{parallel: {wait_for: 2, halt: true, do: [C1, A1, C2, A2]}}", {"A1": "RR", "A2": "RR"},
         {"root": "S", "C1": "S", "A1": "RH", "C2": "S", "A2": "-"}, {"A2": "RH"}, ALL_TICKED),
    Case("parallel/ComplexParallelTest.ConditionsTrue",
         "{parallel: {halt: true, do: [{parallel: {wait_for: 3, halt: true, do: [C1, A1, C2, A2]}}, "
         "{parallel: {wait_for: any, do: [C3, A3]}}]}}",
         {"A1": "RS", "A2": "RRS", "A3": "RRRRS"},
         {"root": "R S", "C1": "S -", "A1": "R S", "C2": "S -", "A2": "R H", "C3": "S -", "A3": "- -"},
         {"A2": "R RH", "A3": "RH -"}, ALL_TICKED),
    Case("parallel/ComplexParallelTest.ConditionsLeftFalse",
         "{parallel: {halt: true, do: [{parallel: {wait_for: 3, halt: true, do: [C1, A1, C2, A2]}}, "
         "{parallel: {wait_for: any, do: [C3, A3]}}]}}",
         {"C1": "F", "C2": "F", "A1": "RS", "A2": "RRS", "A3": "RRRRS"},
         {"root": "F", "C1": "F", "A1": "RH", "C2": "F", "A2": "-", "C3": "-", "A3": "-"},
         {"A2": "RH", "C3": "S", "A3": "RH"}, ALL_TICKED),
    Case("parallel/ComplexParallelTest.ConditionRightFalse",
         "{parallel: {halt: true, do: [{parallel: {wait_for: 3, halt: true, do: [C1, A1, C2, A2]}}, "
         "{parallel: {wait_for: any, do: [C3, A3]}}]}}",
         {"C3": "F", "A1": "RS", "A2": "RRS", "A3": "RRRRS"},
         {"root": "F", "A1": "RH", "A2": "RH", "C3": "F", "A3": "-"},
         {"root": "R", "A1": "R", "A2": "R", "A3": "R"}, OWN_FAILURE_COUNT),
    Case("parallel/ComplexParallelTest.ConditionRightFalse_thresholdF_2",
         "{parallel: {halt: true, do: [{parallel: {wait_for: 3, halt: true, do: [C1, A1, C2, A2]}}, "
         "{parallel: {wait_for: any, do: [C3, A3]}}]}}",
         {"C3": "F", "A1": "RS", "A2": "RRS", "A3": "RS"},
         {"root": "R S", "C1": "S -", "A1": "R S", "C2": "S -", "A2": "R H", "C3": "F -", "A3": "R S"},
         {"A2": "R RH"}, ALL_TICKED),
    Case("parallel/ComplexParallelTest.ConditionRightFalseAction1Done",
         "{parallel: {halt: true, do: [{parallel: {halt: true, do: [C1, A1, C2, A2]}}, "
         "{parallel: {wait_for: any, do: [C3, A3]}}]}}",
         {"C3": "F", "A1": "RS", "A2": "RS", "A3": "RRS"},
         {"root": "R R S", "A1": "R S -", "A2": "R S -", "C3": "F - -", "A3": "R R S"}),
    Case("parallel/FailingParallel", "{parallel: {wait_for: any, do: [A, B, D]}}",
         {"A": "RRS", "B": "RF", "D": "RRRS"},
         {"root": "R R S", "A": "R R S", "B": "R F -", "D": "R R H"}, {"D": "R R RH"}, ALL_TICKED),
    Case("parallel/ParallelAll, max_failures 1", "{parallel: [A, B, D]}",
         {"A": "RF", "B": "RRRS", "D": "RRRS"},
         {"root": "R R R F", "A": "R F - -", "B": "R R R S", "D": "R R R S"}),
    Case("parallel/ParallelAll, max_failures 2", "{parallel: {wait_for: 2, do: [A, B, D]}}",
         {"A": "RF", "B": "RRRS", "D": "RRRS"},
         {"root": "R R R S", "A": "R F - -", "B": "R R R S", "D": "R R R S"}),
    Case("parallel/Issue593", "{parallel: {halt: true, do: [{fallback: [C, A]}, B]}}", {"B": "RS"},
         {"root": "R S", "A": "- -", "B": "R S"}),
    # A reactive fallback represents _while.
    Case("parallel/PauseWithRetry",
         "{parallel: {halt: true, do: [[A1, A2], {fallback: {memory: false, do: [C, "
         "{retry: {attempts: 100, do: B}}]}}]}}",
         {"A1": "RRS", "A2": "RRS", "C": "F F S", "B": "F"},
         {"root": "R R R R S", "C": "F F S - -", "B": "F F - - -", "A2": "- - R R S"}),
    Case("parallel/Issue819_SequenceVsReactiveSequence, Sequence",
         "{parallel: {halt: true, do: [[C1, A1], [C2, A2]]}}", {"A1": "RRR", "A2": "RRR"},
         {"root": "R R", "C1": "S -", "C2": "S -", "A1": "R R", "A2": "R R"}),
    Case("parallel/Issue819_SequenceVsReactiveSequence, ReactiveSequence",
         "{parallel: {halt: true, do: [{sequence: {memory: false, do: [C1, A1]}}, "
         "{sequence: {memory: false, do: [C2, A2]}}]}}", {"A1": "RRR", "A2": "RRR"},
         {"root": "R R", "C1": "S S", "C2": "S S", "A1": "R R", "A2": "R R"}),
    # gtest_decorator.cpp; the time between two ticks is 0.1 s.
    Case("decorator/DeadlineTest.DeadlineTriggeredTest", "{timeout: {seconds: 0.1, do: A}}", {"A": "RRR"},
         {"root": "R F", "A": "R H"}, {"A": "R RH"}, TIMER),
    Case("decorator/DeadlineTest.DeadlineNotTriggeredTest", "{timeout: {seconds: 0.15, do: A}}",
         {"A": "RS"}, {"root": "R S", "A": "R S"}),
    Case("decorator/RetryTest.RetryTestA", "{retry: {attempts: 3, do: A}}", {"A": "F F F S"},
         {"root": "F S", "A": "FFF S"}, {"root": "R R F S", "A": "F F F S"}, TICK_PER_ATTEMPT),
    Case("decorator/RepeatTestAsync.RepeatTestAsync", "{repeat: {times: 3, do: A}}", {"A": "RS RS RS RF"},
         {"root": "R R R S R F", "A": "R SR SR S R F"}),
    Case("decorator/RepeatTest.RepeatTestA", "{repeat: {times: 3, do: A}}", {"A": "F S S S"},
         {"root": "F S", "A": "F SSS"}, {"root": "F R R S", "A": "F S S S"}, TICK_PER_ATTEMPT),
    Case("decorator/TimeoutAndRetry.Issue57",
         "{timeout: {seconds: 0.3, do: {retry: {attempts: 1000, do: A}}}}", {"A": "F"},
         {"root": "F F F F"}, {"root": "R R R F"}, TICK_PER_ATTEMPT),
    Case("decorator/DelayWithXML", "[B, A]", {"B": "RRS"}, {"root": "R R S", "A": "- - S"}),
    Case("decorator/ForceFailure_ChildSuccess", "{invert: {succeed: A}}", {}, {"root": "F", "A": "S"}),
    Case("decorator/ForceFailure_ChildFailure", "{invert: {succeed: A}}", {"A": "F"},
         {"root": "F", "A": "F"}),
    Case("decorator/ForceSuccess_ChildFailure", "{succeed: A}", {"A": "F"}, {"root": "S", "A": "F"}),
    Case("decorator/ForceSuccess_ChildSuccess", "{succeed: A}", {}, {"root": "S", "A": "S"}),
    Case("decorator/Inverter_ChildSuccess", "{invert: A}", {}, {"root": "F", "A": "S"}),
    Case("decorator/Inverter_ChildFailure", "{invert: A}", {"A": "F"}, {"root": "S", "A": "F"}),
    Case("decorator/Inverter_InSequence", "[{invert: A}, B]", {"A": "F"}, {"root": "S", "A": "F", "B": "S"}),
    Case("decorator/KeepRunningUntilFailure", "{repeat: {times: 1000, do: A}}", {"A": "S S F"},
         {"root": "R R F", "A": "S S F"}),
    # gtest_skipping.cpp. A condition in a fallback represents _skipIf.
    Case("skipping/Sequence", "[{fallback: [C, A]}, B]", {}, {"root": "S", "A": "-", "B": "S"}),
    Case("skipping/SkipAll", "[{fallback: [C1, A]}, {fallback: [C2, B]}, {fallback: [C3, D]}]", {},
         {"root": "SKIPPED", "A": "-", "B": "-", "D": "-"}, {"root": "S"}, NO_SKIP),
    Case("skipping/SkipSubtree", "[A, {fallback: [C, B]}]", {}, {"root": "S", "A": "S", "B": "-"}),
    Case("skipping/ReactiveSingleChild", "{sequence: {memory: false, do: [{fallback: [C, A]}]}}", {},
         {"root": "SKIPPED", "A": "-"}, {"root": "S"}, NO_SKIP),
    Case("skipping/SkippingReactiveSequence, no skip",
         "{sequence: {memory: false, do: [{fallback: [C, T]}, B]}}", {"C": "F", "B": "RRS"},
         {"root": "R R S R R S", "T": "S S S S S S", "B": "R R S R R S"}),
    Case("skipping/SkippingReactiveSequence, skip",
         "{sequence: {memory: false, do: [{fallback: [C, T]}, B]}}", {"B": "RRS"},
         {"root": "R R S R R S", "T": "- - - - - -", "B": "R R S R R S"}),
    Case("skipping/WhileSkip, no skip", "{sequence: [{fallback: [C, A]}]}", {"C": "F"},
         {"root": "S", "A": "S"}),
    Case("skipping/WhileSkip, skip", "{sequence: [{fallback: [C, A]}]}", {}, {"root": "S", "A": "-"}),
    # gtest_try_catch.cpp. The handler fails after its body, as TryCatch does.
    Case("try_catch/AllTryChildrenSucceed",
         "{try: [A, B], catch: {on: [A.failed, B.failed], do: {invert: {succeed: C}}}}", {},
         {"root": "S", "A": "S", "B": "S", "C": "-"}),
    Case("try_catch/FirstChildFails_CatchExecuted",
         "{try: [D, A], catch: {on: [D.failed, A.failed], do: {invert: {succeed: B}}}}", {"D": "F"},
         {"root": "F", "A": "-", "B": "S"}),
    Case("try_catch/SecondChildFails_CatchExecuted",
         "{try: [A, D], catch: {on: [A.failed, D.failed], do: {invert: {succeed: B}}}}", {"D": "F"},
         {"root": "F", "A": "S", "B": "S"}),
    Case("try_catch/CatchReturnsFailure_NodeStillReturnsFAILURE",
         "{try: A, catch: {on: A.failed, do: {invert: {succeed: B}}}}", {"A": "F", "B": "F"},
         {"root": "F", "A": "F", "B": "F"}),
    Case("try_catch/CatchReturnsSuccess_NodeStillReturnsFAILURE",
         "{try: A, catch: {on: A.failed, do: {invert: {succeed: B}}}}", {"A": "F"},
         {"root": "F", "A": "F", "B": "S"}),
    Case("try_catch/TryChildRunning", "{try: A, catch: {on: A.failed, do: {invert: {succeed: B}}}}",
         {"A": "RS"}, {"root": "R S", "A": "R S", "B": "- -"}),
    Case("try_catch/CatchChildRunning", "{try: A, catch: {on: A.failed, do: {invert: {succeed: B}}}}",
         {"A": "F", "B": "RF"}, {"root": "R F", "A": "F -", "B": "R F"}),
    Case("try_catch/ReExecuteAfterSuccess", "{try: A, catch: {on: A.failed, do: {invert: {succeed: B}}}}", {},
         {"root": "S H S", "A": "S - S", "B": "- - -"}),
    Case("try_catch/ReExecuteAfterFailure", "{try: A, catch: {on: A.failed, do: {invert: {succeed: B}}}}",
         {"A": "F S"}, {"root": "F H S", "A": "F - S", "B": "S - -"}),
    Case("try_catch/CatchOnHalt_Disabled", "{try: A, catch: {on: A.failed, do: {invert: {succeed: B}}}}",
         {"A": "RR"}, {"root": "R H", "A": "R H", "B": "- -"}),
    Case("try_catch/CatchOnHalt_Enabled",
         "{try: A, catch: {on: A.failed, do: {invert: {succeed: B}}}, finally: B}",
         {"A": "RR"}, {"root": "R H", "A": "R H", "B": "- S"}, {"B": "- -"}, NO_CATCH_ON_HALT),
    Case("try_catch/CatchOnHalt_NotTriggeredWhenAlreadyInCatch",
         "{try: A, catch: {on: A.failed, do: {invert: {succeed: B}}}}", {"A": "F", "B": "RR"},
         {"root": "R H", "A": "F -", "B": "R H"}),
    Case("try_catch/AsyncCatchCompletesInsideSequence",
         "[{try: A, catch: {on: A.failed, do: {invert: {succeed: B}}}}, D]", {"A": "F", "B": "RRRRRS"},
         {"root": "R R R R R F", "A": "F - - - - -", "B": "R R R R R S", "D": "- - - - - -"}),
    Case("try_catch/SingleTryChild_Success", "{try: A, catch: {on: A.failed, do: {invert: {succeed: B}}}}",
         {}, {"root": "S", "A": "S", "B": "-"}),
    Case("try_catch/ManyTryChildren_ThirdFails",
         "{try: [A, B, D], catch: {on: [A.failed, B.failed, D.failed], do: {invert: {succeed: C}}}}",
         {"D": "F"}, {"root": "F", "A": "S", "B": "S", "D": "F", "C": "S"}),
    # gtest_loop.cpp
    Case("loop/StaticIntQueue", "{for_each: {each: x, in: [1, 2, 3, 4, 5], do: A}}", {},
         {"root": "R R R R R S", "A": "S S S S S -"}, {"root": "R R R R S", "A": "S S S S S"}, NO_LAST_TICK),
    Case("loop/ChildFailure_StopsLoop", "{for_each: {each: y, in: [1, 2, 3, 4, 5], do: A}}", {"A": "S S F"},
         {"root": "R R F", "A": "S S F"}),
    Case("loop/RestartAfterCompletion", "{for_each: {each: z, in: [1, 2, 3], do: A}}", {},
         {"root": "R R R S H R R R S", "A": "S S S - - S S S -"},
         {"root": "R R S H R R S", "A": "S S S - S S S"}, NO_LAST_TICK),
    # gtest_tree.cpp
    Case("tree/BehaviorTreeTest.Condition1ToFalseCondition2True", "[{fallback: [C1, C2]}, A]",
         {"C1": "F", "A": "RR"}, {"root": "R", "C1": "F", "C2": "S", "A": "R"}),
    Case("tree/BehaviorTreeTest.Condition2ToFalseCondition1True", "[{fallback: [C1, C2]}, A]",
         {"C2": "F", "A": "RR"}, {"root": "R", "C1": "S", "C2": "-", "A": "R"}),
    # gtest_coroutines.cpp
    Case("coroutines/do_action_timeout, long action", "{timeout: {seconds: 0.2, do: A}}", {"A": "RRRR"},
         {"root": "R R F", "A": "R R H"}, {"A": "R R RH"}, TIMER),
    Case("coroutines/do_action_timeout, short action", "{timeout: {seconds: 0.2, do: A}}", {"A": "RS"},
         {"root": "R S", "A": "R S"}),
    Case("coroutines/sequence_child", "{timeout: {seconds: 0.3, do: [A, B]}}", {"A": "RRS", "B": "RRR"},
         {"root": "R R R F", "A": "R R S -", "B": "- - R H"}, {"B": "- - R RH"}, TIMER),
)  # fmt: skip
"""The restated tests, in the order of the files of BehaviorTree.CPP."""

NOT_RESTATED = {
    "reactive/PreTickHooks": "A hook replaces a node from outside, like the substitutes of run_mission.",
    "reactive/TwoAsyncNodesInReactiveSequence": "The test expects an error of the parser for AsyncSequence.",
    "decorator/RunOnce": "There is no node that runs once per run.",
    "try_catch/MinimumTwoChildren_ParseTimeValidation": "The test expects an error of the parser.",
    "loop/StaticDoubleQueue, StaticStringQueue, BoolQueue, DynamicQueueFromBlackboard, VectorInput_Issue969, "
    "RestartAfterCompletion_VectorFromBlackboard": "Only the type of the list differs from StaticIntQueue.",
    "loop/EmptyQueue_ReturnsSuccess": "The checker rejects a loop whose body never runs.",
    "loop/EmptyQueue_ReturnsFailure, EmptyQueue_ReturnsSkipped": "An empty list is always a success.",
    "loop/ConvertFromString_Int, _Double, _Bool, _String": "The tests concern the parser of XML.",
    "coroutines/do_action, OtherThreadHalt": "The tests concern a leaf in a thread.",
    "tree/BehaviorTreeTest.PrintWithStream": "The test concerns a printed tree.",
}
"""Reasons for which the other tests in these files have no counterpart."""
