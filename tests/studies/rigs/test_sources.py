"""Every number of the catalogue's radars has a source."""

from dataclasses import replace

import pytest

from sensors import RADARS
from studies.rigs import sources
from studies.rigs.sources import LEGEND, SENSORS, SOURCES, source, unsourced


def test_every_number_that_is_no_default_has_a_source():
    assert unsourced() == []


def test_a_number_without_a_source_is_found(monkeypatch):
    changed = {**SENSORS, "SIDE": replace(SENSORS["SIDE"], grazing=0.9)}
    monkeypatch.setattr(sources, "SENSORS", changed)
    assert unsourced() == [("SIDE", "grazing")]


def test_every_radar_of_every_rig_is_one_of_those_on_the_page():
    known = [replace(sensor, mount=(0.0, 0.0, 0.0)) for sensor in SENSORS.values()]
    for radar in RADARS.values():
        for sensor in radar.sensors:
            assert replace(sensor, mount=(0.0, 0.0, 0.0)) in known, radar.name


@pytest.mark.parametrize("sensor", SOURCES)
def test_sources_name_fields_once_with_keys_of_the_legend(sensor):
    names = " ".join(SOURCES[sensor].values()).split()
    assert len(names) == len(set(names))
    assert all(hasattr(SENSORS[sensor], name) for name in names)
    assert set(SOURCES[sensor]) <= set(LEGEND)


def test_a_source_by_hand():
    assert (source("ROADSIDE", "sigma_rate"), source("IMAGING", "sigma_rate"), source("SIDE", "scatter")) == (
        "S",
        "R",
        "-",
    )
