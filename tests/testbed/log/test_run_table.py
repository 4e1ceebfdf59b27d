import pytest

from testbed.experiments.single import RunConfig, run
from testbed.log.run_table import run_table


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    out = tmp_path_factory.mktemp("logs")
    for seed in (0, 1):
        run(RunConfig("xia2020-lane", ("rm-feldmann", "htg-mm"), seed=seed, duration=1.0, out=str(out), log="metrics"))
    return out


def test_every_log_of_a_folder_is_a_row_with_its_settings_and_its_summary(folder):
    table = run_table(folder)
    assert sorted(table["seed"]) == [0, 1]
    assert set(table["scenario"]) == {"xia2020-lane"}
    assert set(table["trackers"]) == {"rm-feldmann htg-mm"}
    assert (table["htg_mm_gospa"] > 0).all()


def test_the_index_names_the_runs(folder):
    assert list(run_table(folder).index) == sorted(path.stem for path in folder.glob("*.rrd"))


def test_a_folder_without_logs_is_refused_in_one_sentence(tmp_path):
    with pytest.raises(ValueError, match=r"holds no \.rrd log"):
        run_table(tmp_path)
