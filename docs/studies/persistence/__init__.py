"""The page docs/persistence.md: what scattering centres that stay on a body change for trackers."""
