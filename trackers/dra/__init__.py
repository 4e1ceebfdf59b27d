"""Data-region association with interacting motion models: DRA, DRA-IMM and EDRA-IMM of Xu et al. (2023)."""

from trackers.dra.filter import DataRegion
from trackers.dra.parameters import PARAMETERS, Parameters, ProcessNoise
from trackers.dra.state import DataRegionInfo, DataRegionState

__all__ = ["PARAMETERS", "DataRegion", "DataRegionInfo", "DataRegionState", "Parameters", "ProcessNoise"]
