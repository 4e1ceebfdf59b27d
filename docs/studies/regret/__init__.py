"""What tracking error costs in driving: the page docs/regret.md and the committed results that it shows."""
