"""One module a command: a frozen dataclass whose fields are its flags and whose `run` does the work."""

from stereoforge.commands.render import Render

COMMANDS = {"render": Render}
"""Every command by its name, in the order of use."""
