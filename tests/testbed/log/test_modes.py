"""Motion models in the log: the probabilities of a tracker can be read back, and logs of other trackers have none."""

import numpy as np
import pytest

from testbed.log import blueprint, layers, paths, reader
from testbed.log.modes import mode_names, modes_of, probabilities
from tests.testbed.log import log_content, log_runs
from trackers.motion.modes import Modes

MIXING = log_runs.MIXING
NAMES = ("cv", "ca", "ct")


@pytest.fixture(scope="module")
def log(tmp_path_factory):
    return log_runs.write(tmp_path_factory.mktemp("log") / "run.rrd", steps=45, meta=MIXING)


def pages(meta, modes):
    metrics = {name: tuple(score.mean) for name, score in next(log_runs.records(1)).scores.items()}
    metrics = dict(zip(meta.trackers, metrics.values(), strict=True))
    layout = blueprint.layout(meta, metrics, (2,), log_runs.road(), True, modes)
    return [str(page.name) for page in layout.root_container.contents[1].contents[1].contents], layout


def views(part):
    if hasattr(part, "class_identifier"):
        return [part]
    return [view for child in part.contents for view in views(child)]


def test_trackers_that_mix_motion_models_have_names_for_them_and_others_none():
    assert mode_names("edra-imm") == mode_names("dra-imm") == NAMES
    assert mode_names("htg-map:size=ends,motion=on") == Modes().names
    assert mode_names("dra") == mode_names("htg-map") == mode_names("truth") == mode_names("no such tracker") == ()


@pytest.mark.parametrize("level", ["full", "metrics"])
def test_probabilities_come_back_by_object_as_the_tracker_gave_them(tmp_path, level):
    path = log_runs.write(tmp_path / "run.rrd", steps=45, meta=MIXING, level=level)
    given = np.stack([log_runs.mode_at(step, np.arange(100, 105)) for step in range(45)])
    for number in (0, 1, 3):
        entity = paths.of_object(number, "edra-imm")
        for k, name in enumerate(NAMES):
            steps, values = reader.scalars(path, entity, f"mode:{name}")[entity]
            assert np.array_equal(steps, np.arange(45))
            assert np.isnan(values[0])
            assert np.array_equal(values[1:], given[1:, number, k])


def test_probabilities_end_with_a_gap_when_the_track_is_lost(log):
    entity = paths.of_object(2, "edra-imm")
    steps, values = reader.scalars(log, entity, "mode:ct")[entity]
    assert steps.tolist() == [*range(21), *range(40, 45)]
    assert np.flatnonzero(np.isnan(values)).tolist() == [0, 20]


def test_the_most_likely_model_stands_behind_the_id_of_a_track(log):
    rows = {r["step"]: r["Points2D:labels"] for r in label_rows(log, "edra-imm")}
    assert rows[0] == ["100", "101", "102", "103", "104"]
    assert rows[1] == ["100 cv", "101 ca", "102 cv", "103 ca", "104 cv"]
    assert rows[10] == ["100 ct", "101 ca", "102 ct", "103 ca", "104 ct"]
    assert {label for r in label_rows(log, "rm-feldmann") for label in r["Points2D:labels"]} == set(rows[0])


def label_rows(path, name):
    return [row for row in log_content.rows(path, paths.tracker(name, "center")) if row.get("step") is not None]


def test_a_tracker_with_one_model_leaves_the_log_as_it_was(log):
    components = log_content.components(log)
    assert not [c for c in components[paths.of_object(0, "rm-feldmann")] if c.startswith("mode:")]
    plain = next(log_runs.records(1))
    modes = modes_of(log_runs.META.trackers)
    without, named = (layers.object_rows(plain.frame, plain.scores, modes) for modes in ({}, modes))
    assert list(named) == list(without)
    assert named == without


def test_names_that_do_not_fit_the_probabilities_are_not_written():
    *_, last = log_runs.mixing_records(3)
    _, info = last.frame.outputs["edra-imm"]
    assert set(probabilities(info, NAMES)) == {100, 101, 102, 103, 104}
    assert probabilities(info, ("cv", "ct")) == probabilities(info, ()) == {}


def test_the_layout_has_a_page_of_motion_models_for_trackers_that_mix_some_only():
    plain, _ = pages(log_runs.META, modes_of(log_runs.META.trackers))
    mixing, layout = pages(MIXING, modes_of(MIXING.trackers))
    assert [page for page in mixing if page not in plain] == ["Motion: veh_02"]
    assert [page for page in mixing if page in plain] == plain
    named = {str(view.name): view for view in views(layout.root_container)}
    plot = named["veh_02: motion model of edra-imm [probability]"]
    assert plot.contents == [f"+ /{paths.of_object(2, 'edra-imm')}"]


def test_every_line_of_the_motion_page_is_in_the_log(log):
    _, layout = pages(MIXING, modes_of(MIXING.trackers))
    known = log_content.components(log)
    plot = next(v for v in views(layout.root_container) if "motion model" in str(v.name))
    ((path, lines),) = plot.visualizer_overrides.items()
    sources = {mapping.source_component for line in lines for mapping in line.mappings}
    assert sources == {f"mode:{name}" for name in NAMES} <= known[path.strip("/")]
