"""The name of the default tracker, apart from its table: commands print it without loading any tracker."""

DEFAULT = "imm-spline"  # what commands and environments use where no tracker is named
