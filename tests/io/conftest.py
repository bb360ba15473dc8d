"""What tests of readers share: a file to read, and what a refusal must look like."""

import pytest


@pytest.fixture
def write(tmp_path):
    """Writes a small file and gives its path."""

    def write(text, name="film.csv"):
        path = tmp_path / name
        path.write_text(text)
        return path

    return write


@pytest.fixture
def refusal():
    """refusal(read, path, error, *said): reads, expects `error`, and finds every one of `said` in one
    sentence that starts with the file's name."""

    def refusal(read, path, error, *said, **kwargs):
        with pytest.raises(error) as caught:
            read(path, **kwargs)
        message = str(caught.value)
        assert type(caught.value) is error
        assert message.startswith(str(path))  # and only what follows may hold the words looked for
        for words in said:
            assert words in message.removeprefix(str(path)), message
        assert "\n" not in message
        assert not message.endswith(".")

    return refusal
