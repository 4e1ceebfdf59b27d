"""`testbed regret` as a user meets it."""

import pandas as pd
import pytest
from typer.testing import CliRunner

from testbed.cli import app

ASKED = ["regret", "probe-brake", "--planner", "idle", "--tracker", "rm-koch", "--seeds", "0:3", "--duration", "0.4"]


def refused(out, *args):
    """The sentence with which a command line is refused."""
    done = CliRunner().invoke(app, ["regret", "probe-brake", "--out", str(out), *map(str, args)])
    assert done.exit_code == 2, done.output
    assert done.stderr.startswith("testbed: ")
    assert done.stderr.count("\n") == 1
    return done.stderr


@pytest.mark.parametrize(
    ("args", "sentence"),
    [
        (["probe-brak"], "did you mean 'probe-brake'?"),
        (["probe-brake:gab=3"], "probe-brake has no parameter gab; it has gap"),
        (["probe-brake:gap=300"], "gap must be a number from"),
        (["probe-brake:gap"], "a scenario reads NAME or NAME:parameter=value"),
        (["--planner", "imd"], "did you mean 'idm'?"),
        (["--planner", "truth"], "planner truth has no regret"),
        (["--tracker", "htg-mapp"], "did you mean 'htg-map'?"),
        (["--tracker", "in-view"], "in-view is no tracker"),
        (["--inject", "lag=1"], "names are velocity_lag"),
        (["--inject", "latency=1", "--inject", "latency=1"], "inject must differ"),
        (["--radar", "frnt"], "did you mean 'front'?"),
        (["--jobs", "0"], "jobs must be 1 or more"),
        (["probe-brake"], "scenarios must differ"),
    ],
)
def test_wrong_input_is_one_sentence(tmp_path, args, sentence):
    assert sentence in refused(tmp_path, *args)


@pytest.fixture(scope="module")
def first(tmp_path_factory):
    """A small study: its folder and what the command said."""
    out = tmp_path_factory.mktemp("regret")
    done = CliRunner().invoke(app, [*ASKED, "--attribute", "--inject", "velocity_lag=0.5", "--out", str(out)])
    assert done.exit_code == 0, done.output
    return out, done


def test_the_drives_are_in_one_table_and_the_same_command_finds_them(first):
    out, done = first
    assert "31 runs made, 0 found, 0 failed" in done.output  # 3 x (truth, in-view, tracker, 6 subsets, 1 dose) + 1
    table = pd.read_parquet(out / "drives.parquet")
    assert len(table) == 31
    assert table["J"].notna().all()
    again = CliRunner().invoke(app, [*ASKED, "--attribute", "--inject", "velocity_lag=0.5", "--out", str(out)])
    assert "0 runs made, 31 found, 0 failed" in again.output


def test_drives_of_other_settings_are_refused(first):
    assert "holds runs with duration 0.4, wanted is None" in refused(first[0])
