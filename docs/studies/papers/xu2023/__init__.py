"""Xu et al. (2023): data-region association and interacting motion models; Table II and figures 5 and 6."""
