"""Installation of optional packages."""


def install(extra: str) -> str:
    """The command that installs an extra of pyproject.toml, for a message about a missing package.

    It installs from the clone, not by name: on PyPI, raccoon is another project.
    """
    return f"pip install '.[{extra}]' in raccoon's own folder (PyPI's raccoon is another project)"
