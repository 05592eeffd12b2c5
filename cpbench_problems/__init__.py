"""Sources of problems: families of generated problems, scenes of rigid bodies, and file formats of other programs.

They come in as those of any other package do, by the entry point `cpbench.plugins`; nothing is imported before a name
is asked for.
"""

from cpbench import registry

registry.include("generator", f"{__name__}.generators")
registry.include("format", f"{__name__}.formats")
registry.include("exchange", f"{__name__}.formats.exchanges")
