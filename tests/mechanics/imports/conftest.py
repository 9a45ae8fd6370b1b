import warnings

import pytest

import ephs
from tests.mechanics.imports.models import MODELS


@pytest.fixture
def quiet():
    """Load a model without its warnings."""

    def load(path, **options):
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", ephs.ModelWarning)
            warnings.simplefilter("ignore", ephs.SceneWarning)
            return ephs.load(path, **options)

    return load


@pytest.fixture
def write(tmp_path):
    """Write a text as a model file."""

    def to_file(text, suffix="urdf", name="model"):
        path = tmp_path / f"{name}.{suffix}"
        path.write_text(text, encoding="utf-8")
        return path

    return to_file


@pytest.fixture(params=sorted(MODELS))
def model(request, write):
    """One of the models."""
    return write(MODELS[request.param], request.param)
