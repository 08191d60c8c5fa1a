"""Packages that only some need: how to install them."""


def install(extra: str) -> str:
    """The command that installs an extra of pyproject.toml, for a message about what is missing.

    From the clone, never by name: on PyPI, raccoon is another project.
    """
    return f"pip install '.[{extra}]' in raccoon's own folder (PyPI's raccoon is another project)"
