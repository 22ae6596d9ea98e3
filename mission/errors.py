"""How does a mistake of the person at the keyboard travel to the command line?  Light: imported by every command."""


class InputError(ValueError):
    """Something that was handed in is wrong; the text is one line that names file, key and value. Exit code 2."""


class FlightError(RuntimeError):
    """The flight could not be made; the text is one line. Exit code 1."""
