"""A kernel: its machine code by kinds of arguments, from the user's folder or from numba."""

import threading
from collections.abc import Callable
from functools import partial
from typing import Any

from pgm_places.kernels.argument_kinds import Kinds, description, kinds_of
from pgm_places.kernels.deferred import Deferred
from pgm_places.kernels.machine_code import load_code, save_code

__all__ = ["Kernel"]

_lock = threading.RLock()


class Kernel(Deferred):
    """A function that is called as machine code."""

    def __init__(self, plain: Callable[..., Any], **options: Any) -> None:
        super().__init__(plain, **options)
        self._codes: dict[Kinds | None, Callable[..., Any]] = {}

    def __call__(self, *arguments: Any, **named: Any) -> Any:
        """Call the machine code for arguments of these kinds."""
        kinds = None if named else kinds_of(arguments)
        code = self._codes.get(kinds)
        if code is None:
            code = self._code_for(kinds, arguments)
        return code(*arguments, **named)

    def ready(self, arguments: tuple[Any, ...]) -> Callable[[], Any]:
        """A call for these very arguments, its machine code already found."""
        return partial(self._code_for(kinds_of(arguments), arguments), *arguments)

    def _code_for(self, kinds: Kinds | None, arguments: tuple[Any, ...]) -> Callable[..., Any]:
        with _lock:
            if kinds not in self._codes:
                self._codes[kinds] = self._found(kinds, arguments)
            return self._codes[kinds]

    def _found(self, kinds: Kinds | None, arguments: tuple[Any, ...]) -> Callable[..., Any]:
        words = None if kinds is None else description(kinds)
        code = None if words is None else load_code(self, words)
        if code is not None:
            return code
        from pgm_places.kernels.compiling import compile_for, dispatcher_of

        if words is None or len(arguments) != self.plain.__code__.co_argcount:
            return dispatcher_of(self)  # numba chooses the code at each call
        code, stored = compile_for(self, arguments)
        if stored is not None:
            save_code(self, words, stored)
        return code
