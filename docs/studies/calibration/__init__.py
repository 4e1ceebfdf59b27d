"""The page docs/calibration.md: the imaging radar beside a real one, on vehicles that it was not fitted on."""
