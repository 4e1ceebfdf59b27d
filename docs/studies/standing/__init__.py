"""Returns of what stands still: those of a real radar beside those of ours."""
