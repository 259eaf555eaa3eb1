"""Generated data: buildings, robot-like maps of plans, and drives of a simulated robot."""

import lazy_loader

__getattr__, _, __all__ = lazy_loader.attach_stub(__name__, __file__)
