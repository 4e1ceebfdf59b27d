"""Compile, before many processes need it, what trackers and radars have compiled."""

from concurrent.futures import ProcessPoolExecutor
from contextlib import closing
from multiprocessing import get_context

import numpy as np

from sensors import find
from testbed.command_line.info import folders
from testbed.environment.registration import make
from trackers import DEFAULT, Scan, build, prior
from trackers.compiled import available


def compile_all() -> None:
    """Compile, half of it in a process of its own."""
    if available() and not all(folder.is_dir() for folder in folders().values()):
        with ProcessPoolExecutor(2, get_context("spawn")) as pool:
            for half in (pool.submit(run_filter), pool.submit(run_steps, "rm-koch")):
                half.result()
    run_steps(DEFAULT)


def run_steps(tracker: str) -> None:
    """Some steps of a tracker."""
    with closing(make("cut-in", tracker=tracker, radar="surround", warm_up=0.5)) as env:
        env.reset(seed=0)


def run_filter() -> None:
    """One step of the filter of the default tracker."""
    filter = build(DEFAULT, find("surround").models).filter
    state = filter.init(prior(np.zeros((1, 3))))
    filter.update(filter.predict(state, 0.1), Scan.from_xy(np.array([[[-2.0, 0.0]]])))
