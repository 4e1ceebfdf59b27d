"""Settings of every test run, before numpy is imported."""

import os

# Tests run on all cores already (`pytest -n auto`): threads of the linear algebra would only wait for each other.
for name in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(name, "1")
