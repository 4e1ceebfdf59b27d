import subprocess

import numpy as np
import pytest

from testbed.log import RunLog, paths, reader
from testbed.log.screenshot import viewer_command
from tests.testbed.log import log_content, log_runs


@pytest.fixture(scope="module")
def log(tmp_path_factory):
    return log_runs.write(tmp_path_factory.mktemp("log") / "run.rrd", steps=32)


def rerun(*arguments):
    program = viewer_command([])[0]
    return subprocess.run([program, *map(str, arguments)], capture_output=True, text=True, timeout=60, check=False)


@pytest.mark.parametrize("every", [1, 7, 100])
def test_digest_does_not_know_the_blocks(log, tmp_path, every):
    again = log_runs.write(tmp_path / "again.rrd", steps=32, every=every, meta=log_runs.META._replace(run_id="other"))
    assert log_content.digest(again) == log_content.digest(log)


def test_digest_survives_the_optimizer_of_rerun(log, tmp_path):
    assert rerun("rrd", "optimize", log, "-o", tmp_path / "small.rrd").returncode == 0
    assert log_content.digests(tmp_path / "small.rrd") == log_content.digests(log)


def test_digest_tells_seeds_apart(log, tmp_path):
    other = log_runs.write(tmp_path / "other.rrd", steps=32, seed=1)
    assert log_content.digest(other) != log_content.digest(log)


def test_a_single_changed_value_is_found_and_located(log, tmp_path):
    with RunLog(tmp_path / "a.rrd", log_runs.META) as changed:
        changed.static(log_runs.road(), log_runs.SENSORS)
        for record in log_runs.records(32):
            if record.frame.step == 17:
                record.frame.scene.objects.pose[3, 1] += 1e-3
            changed.step(*record)
        changed.close(log_runs.SUMMARY)
    before, after = log_content.digests(log), log_content.digests(tmp_path / "a.rrd")
    assert {key for key in before if before[key] != after[key]} == {
        f"/{paths.TRUTH_HEADING} Arrows2D:origins", f"/{paths.TRUTH_NAMES} Points2D:positions"
    }  # fmt: skip


def test_rerun_finds_the_file_in_order(log):
    assert rerun("rrd", "verify", log).returncode == 0


def test_no_wall_clock_is_in_the_log(log):
    timelines = {name for _, batch in reader.batches(log) for name in batch.schema.names if name.startswith("log_")}
    assert timelines == set()


def test_span_and_steps(log):
    assert reader.span(log) == pytest.approx((0.0, 31 * log_runs.DT), abs=1e-9)
    assert np.array_equal(reader.steps(log), np.arange(32))


def test_what_is_not_there_is_said():
    with pytest.raises(FileNotFoundError, match=r"there is no log nowhere\.rrd"):
        log_content.digest("nowhere.rrd")


def test_unknown_entities_are_said(log):
    with pytest.raises(LookupError, match="no entity 'metrics/gdw/"):
        reader.scalars(log, "metrics/gdw/**")
    with pytest.raises(ValueError, match="not a scalar"):
        reader.scalars(log, paths.detections("contour"), "radar:doppler")
