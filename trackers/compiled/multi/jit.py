"""The compiler of the functions of this folder."""

from pathlib import Path

from trackers.compiled.jit import Compiler

compiled = Compiler(Path(__file__).parent)
