"""Reading of a recipe from its text, and refusals."""

import pytest

from pellicle.errors import DataError
from pellicle.recipes import read_recipe


@pytest.fixture
def read(tmp_path):
    def read(text: str):
        path = tmp_path / "film.toml"
        path.write_text(text)
        return read_recipe(path)

    return read


@pytest.fixture
def scene(read):
    return lambda text: read(text).scene()


@pytest.fixture
def refused(read, tmp_path):
    def refused(text: str, *said: str):
        with pytest.raises(DataError) as caught:
            read(text).scene()
        message = str(caught.value)
        assert message.startswith(f"{tmp_path / 'film.toml'}: ")
        assert "\n" not in message
        for words in said:
            assert words in message, message

    return refused
