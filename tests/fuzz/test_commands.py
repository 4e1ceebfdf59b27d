"""Whatever a command line holds: a result, or one sentence and exit status 2, in bounded time and memory.

`python -m tests.fuzz.test_commands` tries all hostile values of all parameters and counts how the calls ended.
"""

from collections import Counter
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pytest

from tests.fuzz.calls import Call, outcomes
from tests.fuzz.declared import LINES, commands, hostile, line
from tests.fuzz.made import make

SAMPLE = 40  # calls in every test run
STREAMS = (  # stdout that takes no letters, or nothing at all
    Call(("list", "trackers"), encoding="ascii"),
    Call(("list", "radars"), stdout="/dev/full"),
    Call(line("run"), encoding="ascii", seconds=5.0),
    Call(("--help",), encoding="ascii"),
    Call(("compare", "--help"), stdout="/dev/full"),
)

ABSURD = (
    line("compare", seeds="0:1000000000000"),
    line("compare", seeds="1" * 25),
    line("run", seed="1" * 25),
    line("reproduce", seed="1" * 25),
    line("learn-htg", bins="1000000000"),
    line("learn-spline", ellipses="1000000"),
    line("learn-htg", count="1000000000000"),
    line("run", duration="1e308"),
    line("compare", jobs="1000000"),
    line("regress", jobs="1000000"),
    line("reproduce", runs="1000000000000"),
    line("regress", baselines="fifo.json"),
)


def faults(calls, template, scratch):
    return [f"{found.call}: {found.fault}" for found in outcomes(calls, template, scratch) if found.fault]


def test_every_command_has_a_correct_call_to_start_from():
    assert set(LINES) == set(commands())


def test_a_sample_of_hostile_values_ends_in_a_sentence_or_a_result(template, tmp_path):
    every = [call for command in LINES for call in hostile(command)]
    chosen = np.random.default_rng(20261122).choice(len(every), SAMPLE, replace=False)
    assert faults([every[k] for k in chosen], template, tmp_path / "scratch") == []


def test_numbers_that_would_take_all_memory_or_all_time_are_refused(template, tmp_path):
    ended = outcomes([Call(args, seconds=10.0) for args in ABSURD], template, tmp_path / "scratch")
    assert [(str(found.call), found.fault) for found in ended if found.fault or found.status != 2] == []


def test_streams_that_take_nothing_are_no_traceback(template, tmp_path):
    assert faults(STREAMS, template, tmp_path / "scratch") == []


@pytest.mark.slow
@pytest.mark.parametrize("command", LINES)
def test_every_hostile_value_of_every_parameter(command, template, tmp_path):
    assert faults(hostile(command), template, tmp_path / "scratch") == []


if __name__ == "__main__":
    with TemporaryDirectory() as folder:
        base = make(Path(folder) / "template")
        total: Counter[str] = Counter()
        for name in LINES:
            ended = outcomes(hostile(name), base, Path(folder) / "scratch")
            wrong = [found for found in ended if found.fault]
            print(f"{name}: {len(ended)} calls, {len(ended) - len(wrong)} clear, {len(wrong)} wrong", flush=True)
            for found in wrong[:10]:
                print(f"   {found.call}: {found.fault}", flush=True)
            total.update(tried=len(ended), wrong=len(wrong))
        print(f"all: {total['tried']} calls, {total['wrong']} wrong")
