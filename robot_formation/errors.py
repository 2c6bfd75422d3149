"""The project's error base: its text is one whole sentence for the person who typed the command."""


class FormationError(ValueError):
    """Something from outside is wrong; the text says what and what to do. The command line ends with exit code 2."""
