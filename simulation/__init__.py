"""Generated data: buildings, and robot-like maps of plans."""

import lazy_loader

__getattr__, _, __all__ = lazy_loader.attach_stub(__name__, __file__)
