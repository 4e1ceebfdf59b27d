"""The page docs/consistency.md: whether the covariances of a tracker match its errors."""
