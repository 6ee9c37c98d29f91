"""What several tests need: the recordings beside the checkout, and a seeded generator."""

from pathlib import Path

import numpy as np
import pytest

SHARED_DATA = Path(__file__).resolve().parents[2] / "shared" / "data"


@pytest.fixture(scope="session")
def shared_data() -> Path:
    """The folder of recordings, tire files and golden values; they are not part of the project."""
    if not SHARED_DATA.is_dir():
        pytest.skip("needs the recordings of ../shared/data, which are not part of the project")
    return SHARED_DATA


@pytest.fixture
def rng() -> np.random.Generator:
    return np.random.default_rng(20260101)
