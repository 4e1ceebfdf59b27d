"""The page docs/learned-policies.md: policies trained on truth and on tracks, each driven on both."""
